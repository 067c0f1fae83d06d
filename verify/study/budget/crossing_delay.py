"""Wait of the places of a cut until the blade has left the element in which they are.

A blade opens elements as a whole, behind it. The tip of the cut lags by something between nothing
and an element; its mean is the delay that costs as much in a solution that opens everywhere in
time. An advance of the tip by s changes the displacement by s ∂u/∂a, which is square integrable at
the tip (1/√r): the delay is an error of order 1 in h in the mean square, and at any fixed place.
"""

import numpy as np

from verify.compare.body import AnyBody
from verify.compare.sides import distance_to_cut
from verify.scene import Scene, ToolPathCut
from verify.solution import Solution


def mean_wait(scene: Scene, body: AnyBody, solution: Solution) -> float | None:
    """Mean over the realised cut of the time from the blade's passing to the opening, s.

    Parameters
    ----------
    scene : Scene
    body : AnyBody
        With the cuts as asked.
    solution : Solution
        Whose facets of the cut are those of its elements.

    Returns
    -------
    float or None
        None if no blade opens anything, or what it opens is not late.
    """
    blades = {cut.name: cut for cut in scene.cuts if isinstance(cut, ToolPathCut)}
    facets = solution.cut_facets
    if not blades or not len(facets) or scene.analysis.opening != "late":
        return None
    count, corners, space = facets.shape
    middles = facets.mean(axis=1)
    away = np.stack([
        distance_to_cut(pieces, facets.reshape(-1, space))[0].reshape(count, corners).max(axis=1)
        + distance_to_cut(pieces, middles)[0]
        for pieces in body.cuts.values()
    ])  # fmt: skip
    waits = np.zeros(count)
    for k, name in enumerate(body.cuts):
        mine = np.flatnonzero(away.argmin(axis=0) == k)
        if name in blades and len(mine):
            passed = blades[name].passed_at(facets[mine].reshape(-1, space))
            waits[mine] = passed.reshape(len(mine), corners).max(axis=1)
            waits[mine] -= blades[name].passed_at(middles[mine])
    edges = facets[:, 1:] - facets[:, :1]
    measures = np.sqrt(np.linalg.det(edges @ edges.swapaxes(1, 2)).clip(0.0))
    return float(np.average(waits, weights=measures))
