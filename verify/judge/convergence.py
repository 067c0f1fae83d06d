"""Convergence over levels: Richardson extrapolation, grid convergence index, observed orders.

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

Below: how errors can be counted on to fall from level to level, by the elements and by other
sources; and the observed rates of solvers, with reasons where an order means nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, isfinite, log

from scipy.optimize import brentq

from verify.compare.body import AnyBody
from verify.compare.realised import cut_deviation
from verify.errors import InputError
from verify.result import Rate, SolveRecord
from verify.scene import Scene
from verify.scene.parts import END_OF_SUPPORT
from verify.solution import Solution

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

    The refinement ratios may differ; the right side grows with p.
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
    return float(brentq(excess, low, high, xtol=1e-10))


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


# Relative errors below this are round-off of a direct solver on 1e5 unknowns.
ROUND_OFF = 1e-11
# The slope may still change by a little more than it last did.
SAFETY = 1.25


def observed_rate(
    solver: str,
    metric: str,
    sizes: Sequence[float],
    errors: Sequence[float],
    uncertainties: Sequence[float],
) -> Rate:
    """Fit the order of `errors` under refinement.

    Parameters
    ----------
    solver, metric : str
    sizes, errors, uncertainties : sequence of float
        Element size (m), relative error and its half-width per level, coarse to fine.

    Returns
    -------
    Rate
        The slope between the two finest levels. Its uncertainty is 1.25 × the change from
        the pair before, plus what the half-widths of the two errors allow. Slopes that fall from
        level to level (``"slowing"``) have that uncertainty without an order.
    """
    levels = list(zip(sizes, errors, uncertainties, strict=True))
    if any(b >= a for a, b in pairwise(sizes)):
        text = ", ".join(f"{size:.3g}" for size in sizes)
        return Rate(solver, metric, None, 0.0, f"mesh sizes {text} m do not fall", [])
    slopes = [
        log(a[1] / b[1]) / log(a[0] / b[0]) if a[1] > 0 and b[1] > 0 else float("nan")
        for a, b in pairwise(levels)
    ]
    shown = ", ".join(f"{slope:.2f}" for slope in slopes)
    pairwise_slopes = [slope for slope in slopes if slope == slope]

    def without(reason: str) -> Rate:
        return Rate(solver, metric, None, 0.0, reason, pairwise_slopes)

    if len(levels) < 3:
        return without(f"too few levels: {len(levels)}; an order with its uncertainty needs 3")
    if any(error <= ROUND_OFF for error in errors[-2:]):
        return without(f"floor: errors {errors[-2]:.1e}, {errors[-1]:.1e} are at round-off")
    for error, width in zip(errors[-2:], uncertainties[-2:], strict=True):
        if width >= 0.5 * error:
            return without(
                f"floor: the uncertainty {width:.1e} of the comparison is not clearly below the "
                f"error {error:.1e}"
            )
    slopes = pairwise_slopes  # an error of exactly 0 on an early level has none
    if len(slopes) < 2:
        return without("too few levels: the error of one is 0; an order needs 3 others")
    if all(slope <= 0 for slope in slopes):
        return without(f"diverging: slopes {shown}")
    span = log(sizes[-2] / sizes[-1])
    allowed = sum(w / e for e, w in zip(errors[-2:], uncertainties[-2:], strict=True)) / span
    change = SAFETY * abs(slopes[-1] - slopes[-2])
    spread = change + allowed
    if min(slopes) >= 0:
        if spread < 0.5 * slopes[-1]:
            return Rate(solver, metric, slopes[-1], spread, "", slopes)
        # a fall that the comparison cannot explain is one
        falls = all(b < a for a, b in pairwise(slopes)) and allowed < change
        if 0.5 * slopes[-1] > change and not falls:
            return without(
                f"floor: slopes {shown}, which the uncertainty of the comparison leaves open by "
                f"{allowed:.2f}"
            )
    if all(b < a for a, b in pairwise(slopes)):
        return replace(without(f"slowing: slopes {shown}"), uncertainty=spread)
    what = "oscillating" if min(slopes) < 0 else "uneven"
    what = "rising" if all(b > a for a, b in pairwise(slopes)) else what
    return without(f"{what}: slopes {shown}, so that the last says little about the next")


def shifted_ends(records: Sequence[SolveRecord]) -> str:
    """Say why levels are no series, if on one of them a support ends inside a facet; else empty.

    What is held then differs from the part by a length that jumps from level to level.
    """
    ends = [
        [r.size or 0.0 for r in one.regularisations if (r.kind, r.unit) == (END_OF_SUPPORT, "h")]
        for one in records
    ]
    shifts = [max(own, default=0.0) for own in ends]
    if not any(shifts):
        return ""
    return f"supports hold {', '.join(f'{s:.2g}' for s in shifts)} h beyond where their parts end"


_ON_THE_CUT = 1e-10  # of the body's size


def counted_order(scene: Scene, solution: Solution) -> float:
    """Return the order in the energy norm that can be counted on: that of the elements.

    It is ½ where a blade goes on its way: its tip is everywhere once, and no mesh graded to it.
    """
    return 0.5 if cut_on_the_way(scene) else solution.order


def error_fall(
    scene: Scene, solutions: Sequence[Solution], sizes: Sequence[float], body: AnyBody
) -> float:
    """Return the largest factor that can be counted on between the last two levels.

    Straight facets approach a curved cut like h². How far they are off it is measured: along a
    short arc their number does not double exactly. Time steps are of second order, and halve
    with the elements. What opens behind a blade is late by the length of a facet, which halves.
    Infinite where none limits the order of the elements.

    Parameters
    ----------
    scene : Scene
    solutions : sequence of Solution
        Levels, coarse to fine, at least two.
    sizes : sequence of float
        Their element sizes, m.
    body : Body or SolidBody or MembraneBody
        With the cuts as asked.
    """
    ratio = sizes[-2] / sizes[-1]
    found = inf if scene.analysis.kind == "static" else ratio**2
    if cut_on_the_way(scene):
        found = ratio
    before, last = (cut_deviation(solution, body) for solution in solutions[-2:])
    if last > _ON_THE_CUT * body.size:
        # an unlucky pair of meshes is still one refinement apart
        found = min(found, max(before / last, ratio))
    return found


def cut_on_the_way(scene: Scene) -> bool:
    """Whether a blade cuts on its way in a scene."""
    return any(cut.on_the_way for cut in scene.cuts)
