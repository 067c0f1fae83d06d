"""The field of a solution on a membrane, at points of the surface as asked.

A point belongs to the nearest triangle of the solution. Where the two surfaces are the same that
is the triangle that holds it; where they are two triangulations of one curved surface they lie a
sagitta apart, and the foot of a point beside a cut might fall across it. So only those triangles
count that lie on the point's side of the planes of the cuts, or ahead of a tip on both.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.membrane_body import MembraneBody
from verify.solution import Solution

Array = NDArray[np.float64]
Sides = NDArray[np.int8]

# A triangle of which less than this share reaches across a plane is on one side of it: meshes that
# conform to a cut may let it pass through a node that is so close.
_ACROSS = 1e-4


class MembraneField(SolutionField):
    """Evaluate a solution of a membrane, on the sides of the cuts of its body.

    Parameters
    ----------
    solution : Solution
    body : MembraneBody
    step : int
        Output time that is evaluated; default the last.
    sided : bool
        Whether points are evaluated on their sides of the cuts.

    Attributes
    ----------
    off_surface : float
        Largest distance of the corners and centres of the body's triangles from the solution's
        surface, m.
    """

    def __init__(
        self, solution: Solution, body: MembraneBody, step: int = -1, sided: bool = True
    ) -> None:
        super().__init__(solution, step)
        self._patches = body.patches if sided else []
        level = [patch.level(self.shape.corners.reshape(-1, 3)) for patch in self._patches]
        self._sides = _sides_of(np.array(level).reshape(len(level), len(self.shape.corners), 3))
        probes = np.concatenate([body.corners.reshape(-1, 3), body.corners.mean(axis=1)])
        self.off_surface = float(self._on_surface(probes)[1].max())

    def _wanted(self, points: Array, near: Array | None) -> Sides:
        """Find the sides (n, p) of planes that points lie on; of one on it, that of `near`."""
        wanted = np.zeros((len(points), len(self._patches)), dtype=np.int8)
        for k, patch in enumerate(self._patches):
            level = patch.level(points)
            on = np.abs(level) <= ROUND_OFF * self.scale
            towards = 0.0 if near is None else patch.level(near) - level
            wanted[:, k] = np.sign(np.where(on, towards, level))
        return wanted


def _sides_of(level: Array) -> Sides:
    """Sides (m, p) of planes that triangles lie on, of the levels (p, m, 3) of their corners."""
    low, high = level.min(axis=2), level.max(axis=2)
    both = np.minimum(-low, high) > _ACROSS * (high - low)
    return np.ascontiguousarray(np.where(both, 0, np.sign(low + high)).T.astype(np.int8))
