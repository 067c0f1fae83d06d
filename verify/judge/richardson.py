"""Richardson extrapolation and grid convergence index: what a sequence of levels is worth.

After P. J. Roache, *Verification and Validation in Computational Science and Engineering* (1998),
and W. L. Oberkampf, C. J. Roy, *Verification and Validation in Scientific Computing* (2010),
section 8.7. The half-width of the finest of three levels is

    F max(|d₂|, |d₁|/rᵖ) / (rᵖ − 1),    p = min(max(½, p̂), p_f),

with the last difference d₂ and the one before, d₁, the last refinement ratio r, the formal order
p_f and the observed one p̂. F = 1.6 from p̂ = 0.9 p_f on, 2.5 below; without an observed order
F = 3 and p = ½. Both differences count, because one is small by accident where terms of several
orders cancel; norms of differences do not cancel, and there the last one counts alone.
Oberkampf and Roy's rule is |d₂| alone, with 1.25 where p̂ is within a tenth of p_f and 3
elsewhere. `verify study calibration` counts how often half-widths cover series of mixed orders.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf, isfinite, log

from verify.errors import InputError

_ROUND_OFF = 1e-13  # relative: below this, differences of levels say nothing
_NEAR = 0.9  # of the formal order, from which on an observed one counts as near
_SAFETY_NEAR, _SAFETY_LOW, _SAFETY_WITHOUT = 1.6, 2.5, 3.0  # of an order: near, too low, none
_LEAST = 0.5  # order that is counted on at least, if the formal one is not lower
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
    values: Sequence[float], sizes: Sequence[float], formal: float, falls: float = inf
) -> Extrapolation:
    """Judge a scalar from at least three levels, coarse to fine.

    Parameters
    ----------
    values, sizes : sequence of float
        The quantity and the element size of each level.
    formal : float
        Order that can be counted on.
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
    floor = _ROUND_OFF * max(abs(v) for v in values)
    if abs(last) <= floor and abs(first) <= floor:
        width = 3 * max(abs(last), abs(first), floor)
        return Extrapolation(fine, fine, width, None, "converged to round-off")
    order = observed_order(abs(first), abs(last), sizes[-3:]) if first * last > 0 else None
    counted = _counted(formal, falls, sizes)
    fall, (safety, why) = _fall(order, counted, sizes), _safety(order, counted)
    width = safety * max(abs(last), abs(first) / fall) / (fall - 1)
    step = last / (fall - 1) if order else 0.0
    text = f"{why}, safety factor {safety:g}"
    return Extrapolation(fine, fine + step, max(width, floor), order, text)


def field_uncertainty(
    differences: Sequence[float],
    sizes: Sequence[float],
    formal: float,
    falls: float = inf,
    least: float = 1.0,
) -> Extrapolation:
    """Estimate the error norm of the finest of several reference fields.

    Parameters
    ----------
    differences : sequence of float
        Norms of the differences of successive levels, one fewer than `sizes`.
    sizes : sequence of float
        Element sizes, coarse to fine, at least three.
    formal : float
        Order in this norm that can be counted on.
    falls : float
        See `extrapolate`.
    least : float
        Safety factor at least.

    Returns
    -------
    Extrapolation
        `half_width` bounds the norm of the finest field's error, so that an error measured
        against it is off by at most that much.
    """
    _check([0.0, *differences], sizes)
    first, last = differences[-2:]
    if last == 0.0 and first == 0.0:
        return Extrapolation(0.0, 0.0, 0.0, None, "successive levels are equal")
    order, counted = observed_order(first, last, sizes[-3:]), _counted(formal, falls, sizes)
    safety, why = _safety(order, counted)
    safety = max(safety, least)
    width = safety * last / (_fall(order, counted, sizes) - 1)
    text = f"{why}, safety factor {safety:g}"
    return Extrapolation(last, 0.0, width, order, text)


def place_uncertainty(
    value: float,
    differences: Sequence[float],
    sizes: Sequence[float],
    formal: float,
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
    formal : float
        Order in L2 that can be counted on.
    falls : float
        See `extrapolate`.
    """
    around = field_uncertainty(differences, sizes, formal, falls, _DEVIATIONS)
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


def _counted(formal: float, falls: float, sizes: Sequence[float]) -> float:
    """Return the formal order, or the one by which errors can fall if that is less."""
    return min(formal, log(falls) / log(sizes[-2] / sizes[-1]))


def _fall(order: float | None, formal: float, sizes: Sequence[float]) -> float:
    """Factor rᵖ by which the error is taken to fall between the last two levels."""
    return (sizes[-2] / sizes[-1]) ** min(max(_LEAST, order or 0.0), formal)


def _safety(order: float | None, formal: float) -> tuple[float, str]:
    """Safety factor, and why it is that."""
    if order is None:
        return _SAFETY_WITHOUT, "no order"
    if order >= _NEAR * formal:
        return _SAFETY_NEAR, f"observed order {order:.2f}"
    return _SAFETY_LOW, f"observed order {order:.2f} of {formal:.3g}"


def _check(values: Sequence[float], sizes: Sequence[float]) -> None:
    if len(values) != len(sizes) or len(values) < 3:
        raise InputError(f"{len(values)} levels of a reference; an uncertainty needs at least 3")
    if any(b >= a for a, b in pairwise(sizes)) or min(sizes) <= 0:
        raise InputError(f"element sizes {list(sizes)} must fall from level to level")
    if not all(isfinite(v) for v in values):
        raise InputError(f"levels with values that are not finite: {list(values)}")
