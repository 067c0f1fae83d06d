"""Wait of the places of a cut until the blade has left the element in which they are.

A blade opens elements as a whole, behind it. The tip of the cut lags by something between nothing
and an element; its mean is the delay that costs as much in a solution that opens everywhere in
time. An advance of the tip by s changes the displacement by s ∂u/∂a, which is square integrable at
the tip (1/√r): the delay is an error of order 1 in h in the mean square, and at any fixed place.
"""

import numpy as np

from verify.scene import Scene, ToolPathCut
from verify.solution import Solution
from verify.solvers.xfem_cuts import cuts_of
from verify.solvers.xfem_openings import seam_times

__all__ = ["mean_wait"]


def mean_wait(scene: Scene, solution: Solution) -> float | None:
    """Mean over the realised cut of the time from the blade's passing to the opening, s.

    Parameters
    ----------
    scene : Scene
    solution : Solution
        Whose facets of the cut are those of its elements.

    Returns
    -------
    float or None
        None if no blade opens anything.
    """
    if not any(isinstance(cut, ToolPathCut) for cut in scene.cuts) or not len(solution.cut_facets):
        return None
    facets, size = solution.cut_facets, solution.size or 1.0
    asked, levels = scene.cuts, cuts_of(scene, size)
    whole = [np.nan if isinstance(cut, ToolPathCut) else 0.0 for cut in asked]
    middles = facets.mean(axis=1, keepdims=True)
    waits = seam_times(asked, levels, facets, whole) - seam_times(asked, levels, middles, whole)
    edges = facets[:, 1:] - facets[:, :1]
    measures = np.sqrt(np.linalg.det(edges @ edges.swapaxes(1, 2)).clip(0.0))
    return float(np.average(waits, weights=measures))
