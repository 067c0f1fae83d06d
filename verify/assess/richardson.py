"""Richardson extrapolation and grid convergence index: what a sequence of levels is worth.

After P. J. Roache, *Verification and Validation in Computational Science and Engineering*
(1998): an observed order that is near the theoretical one earns the safety factor 1.25; any
other sequence gets the factor 3 and the theoretical order, or the observed one if it is lower.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite, log

from verify.errors import InputError

_ROUND_OFF = 1e-13  # relative: below this, differences of levels say nothing
_DEVIATIONS = 2.0  # of the error around a place: 95 % of a normal distribution


@dataclass(frozen=True)
class Extrapolation:
    """What a quantity is known to be.

    Parameters
    ----------
    value : float
        On the finest level.
    extrapolated : float
        By Richardson, with the order used; equal to `value` where there is no sane order.
    half_width : float
        The true value is taken to lie within this of `value`.
    order : float or None
        Observed order, if there is one.
    reason : str
        How the half-width came about.
    """

    value: float
    extrapolated: float
    half_width: float
    order: float | None
    reason: str


def extrapolate(
    values: Sequence[float],
    sizes: Sequence[float],
    theoretical: float,
    best: float | None = None,
    second: float | None = None,
    falls: float = inf,
) -> Extrapolation:
    """Judge a scalar from at least three levels, coarse to fine.

    Parameters
    ----------
    values, sizes : sequence of float
        The quantity and the element size of each level.
    theoretical : float
        Order that can be counted on; used where the observed one is not sane.
    best : float, optional
        Largest sane order (default: twice the theoretical one, as for energies).
    second : float, optional
        Order that a second estimate gives (twice that of the field's energy norm); used where
        the observed one is not sane. A single number may be right by accident on one level.
    falls : float
        Factor by which the error can at most be counted on to fall between the last two levels,
        whatever the order of the elements.

    Raises
    ------
    InputError
        If there are fewer than three levels, or they do not go from coarse to fine.
    """
    _check(values, sizes)
    coarse, middle, fine = values[-3:]
    first, last = middle - coarse, fine - middle
    ratio = sizes[-2] / sizes[-1]
    floor = _ROUND_OFF * max(abs(v) for v in values)
    if abs(last) <= floor and abs(first) <= floor:
        width = 3 * max(abs(last), abs(first), floor)
        return Extrapolation(fine, fine, width, None, "converged to round-off")
    order = observed_order(abs(first), abs(last), sizes[-3:]) if first * last > 0 else None
    limit = 2 * theoretical if best is None else best
    if order is not None and 0.5 * theoretical <= order <= limit + 0.5:
        step = last / (min(ratio ** min(order, limit), falls) - 1)
        text = f"observed order {order:.2f}, safety factor 1.25"
        return Extrapolation(fine, fine + step, max(1.25 * abs(step), floor), order, text)
    if second is None:
        width, text = _careful(abs(first), abs(last), ratio, order, theoretical, falls)
    else:
        used = min(second, limit)
        width = _widest(abs(first), abs(last), min(ratio**used, falls))
        text = f"{_why(order)}: order {used:.2g} as of the field, safety factor 3"
    return Extrapolation(fine, fine, max(width, floor), order, text)


def field_uncertainty(
    differences: Sequence[float],
    sizes: Sequence[float],
    theoretical: float,
    safety: float = 1.25,
    falls: float = inf,
) -> Extrapolation:
    """Estimate the error norm of the finest of several reference fields.

    Parameters
    ----------
    differences : sequence of float
        Norms of the differences of successive levels, one fewer than `sizes`.
    sizes : sequence of float
        Element sizes, coarse to fine, at least three.
    theoretical : float
        Order in this norm that can be counted on.
    safety : float
        Factor where the observed order is sane; 3 elsewhere.
    falls : float
        See `extrapolate`.

    Returns
    -------
    Extrapolation
        `half_width` bounds the norm of the finest field's error, so that an error measured
        against it is off by at most that much.
    """
    _check([0.0, *differences], sizes)
    first, last = differences[-2:]
    ratio = sizes[-2] / sizes[-1]
    if last == 0.0 and first == 0.0:
        return Extrapolation(0.0, 0.0, 0.0, None, "successive levels are equal")
    order = observed_order(first, last, sizes[-3:])
    if order is not None and 0.5 * theoretical <= order <= 2 * theoretical + 0.5:
        width = safety * last / (min(ratio ** min(order, theoretical), falls) - 1)
        text = f"observed order {order:.2f}, safety factor {safety:g}"
        return Extrapolation(last, 0.0, width, order, text)
    width, text = _careful(first, last, ratio, order, theoretical, falls)
    return Extrapolation(last, 0.0, width, order, text)


def place_uncertainty(
    value: float,
    differences: Sequence[float],
    sizes: Sequence[float],
    theoretical: float,
    falls: float = inf,
) -> Extrapolation:
    """Estimate the error of a value at one place, from how levels differ around it.

    At one place errors change sign from level to level, so that neither an order nor a size can
    be had from three values; from root mean squares around it both can. The error at the place
    is one draw from those around: within two of their root mean squares in 95 of 100.

    Parameters
    ----------
    value : float
        On the finest level.
    differences : sequence of float
        Root mean squares around the place of the differences of successive levels, one fewer
        than `sizes`.
    sizes : sequence of float
        Element sizes, coarse to fine, at least three.
    theoretical : float
        Order in L2 that can be counted on.
    falls : float
        See `extrapolate`.
    """
    around = field_uncertainty(differences, sizes, theoretical, _DEVIATIONS, falls)
    width = max(around.half_width, _ROUND_OFF * abs(value))
    return Extrapolation(value, value, width, around.order, f"around the place: {around.reason}")


def observed_order(first: float, last: float, sizes: Sequence[float]) -> float | None:
    """Find the order p with first / last = (h₀ᵖ − h₁ᵖ) / (h₁ᵖ − h₂ᵖ), or None if there is none.

    The refinement ratios may differ; the right side grows with p, so that bisection finds it.
    """
    if first <= 0.0 or last <= 0.0:
        return None
    r, s = sizes[0] / sizes[1], sizes[1] / sizes[2]
    target = log(first / last)

    def excess(p: float) -> float:
        return log((r**p - 1) / (1 - s**-p)) - target

    low, high = 1e-3, 20.0
    if excess(low) > 0:
        return None  # the differences do not shrink as any positive order would make them
    if excess(high) < 0:
        return inf
    while high - low > 1e-10:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0 else (low, middle)
    return 0.5 * (low + high)


def _careful(
    first: float, last: float, ratio: float, order: float | None, theoretical: float, falls: float
) -> tuple[float, str]:
    """Half-width with safety factor 3, and its reason.

    An observed order below the theoretical one is believed as far as it makes things worse;
    where differences grow, no more than order 1 is counted on.
    """
    used, why = theoretical if order is None else min(theoretical, max(order, 0.25)), _why(order)
    if order is None and last > first:  # not even the sign of convergence
        used, why = min(theoretical, 1.0), "differences grow"
    width = _widest(first, last, min(ratio**used, falls))
    return width, f"{why}: order {used:.2g}, safety factor 3"


def _why(order: float | None) -> str:
    return "no order" if order is None else f"observed order {order:.2f} is not sane"


def _widest(first: float, last: float, falls: float) -> float:
    """Half-width with safety factor 3 where errors fall by a factor from level to level.

    The coarser difference counts, scaled down, in case the finer one is small by accident.
    """
    return 3 * max(last, first / falls) / (falls - 1)


def _check(values: Sequence[float], sizes: Sequence[float]) -> None:
    if len(values) != len(sizes) or len(values) < 3:
        raise InputError(f"{len(values)} levels of a reference; an uncertainty needs at least 3")
    if any(b >= a for a, b in pairwise(sizes)) or min(sizes) <= 0:
        raise InputError(f"element sizes {list(sizes)} must fall from level to level")
    if not all(isfinite(v) for v in values):
        raise InputError(f"levels with values that are not finite: {list(values)}")
