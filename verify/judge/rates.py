"""Observed orders of convergence, with reasons where an order means nothing.

And how errors fall from level to level: those of the elements, and those of other sources.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf, log

from verify.compare.body import AnyBody
from verify.compare.realised import cut_deviation
from verify.result import Rate, Regularisation, SolveRecord
from verify.scene import Scene
from verify.scene.parts import END_OF_SUPPORT
from verify.solution import Solution

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
    shifts = [
        max((r.size or 0.0 for r in one.regularisations if _is_shift(r)), default=0.0)
        for one in records
    ]
    if not any(shifts):
        return ""
    return f"supports hold {', '.join(f'{s:.2g}' for s in shifts)} h beyond where their parts end"


def _is_shift(entry: Regularisation) -> bool:
    return entry.kind == END_OF_SUPPORT and entry.unit == "h"


_ON_THE_CUT = 1e-10  # of the body's size


def counted_order(scene: Scene | None, solution: Solution) -> float:
    """Return the order in the energy norm that can be counted on: that of the elements.

    It is ½ where a blade goes on its way: its tip is everywhere once, and no mesh graded to it.
    """
    return 0.5 if scene is not None and cut_on_the_way(scene) else solution.order


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
