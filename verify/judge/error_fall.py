"""Fall of errors from level to level: that of the elements, and that of other sources."""

from collections.abc import Sequence
from math import inf

from verify.compare.body import AnyBody
from verify.compare.realised import cut_deviation
from verify.scene import Scene
from verify.solution import Solution

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
