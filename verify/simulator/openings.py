"""Opening of elements ahead of blades whose ways are known.

The rule of all solvers (`swept`): an element opens in the step in which the blade begins to sweep
the cut in the support of one of its nodes; what is then released is held by forces that fade with
the swept share (`verify.xfem.release`). A blade that is led by hand has no way ahead: elements open
when it has crossed them through, and let go at once.
"""

from collections.abc import Callable, Sequence

import numpy as np

from verify.geometry.spatial import measures
from verify.geometry.swept_shares import SweptShares, swept_measure
from verify.simulator.semi_progressive import SemiProgressiveCutter, Stroke
from verify.solvers.openings_of_scene import sections
from verify.xfem.arrays import Floats, Ints
from verify.xfem.mesh import SimplexMesh
from verify.xfem.tool_path import ToolPath


class KnownWays:
    """Strokes whose paths are known: when they open elements, and how forces fade.

    Parameters
    ----------
    mesh : SimplexMesh
    paths : sequence of ToolPath
        In the order of the strokes.
    """

    def __init__(self, mesh: SimplexMesh, paths: Sequence[ToolPath]) -> None:
        gone = SemiProgressiveCutter(mesh)
        for path in paths:
            gone.begin(path)
        gone.advance(np.inf)
        phantom = gone.phantom_mesh()
        self._shares, self._strokes = SweptShares(len(mesh.cells)), gone.strokes
        self._opens, self._passed = [], []
        for k, path in enumerate(paths):
            cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
            cut, passed_at = sections(phantom, cells, k), _passes(path)
            self._opens.append(self._shares.add(cut, passed_at).let_go)
            times = passed_at(cut.points.reshape(-1, mesh.space)).reshape(cut.points.shape[:2])
            self._passed.append((np.sort(times), measures(cut.points)))

    def open(self, stroke: Stroke) -> None:
        """Let a stroke that has not begun open elements ahead of its blade."""
        stroke.open_ahead(self._opens[stroke.number], self._strokes[stroke.number])

    def areas(self, time: float) -> Floats:
        """Area (strokes,) that each blade has swept in the body, m² (in the plane m)."""
        return np.array([swept_measure(*passed, time) for passed in self._passed])

    def fading(
        self, place: Ints, step: float
    ) -> Callable[[Ints, float], Callable[[float], Floats]]:
        """Return what makes the factors of the forces on dof nodes, from the start of a step on.

        Parameters
        ----------
        place : (N,) int array
            Mesh node of each dof node.
        step : float
            What opens in it is released at its start, s.
        """
        return lambda nodes, time: self._shares.fading(place[nodes], time, step).at


def _passes(path: ToolPath) -> Callable[[Floats], Floats]:
    return lambda points: path.time_at(path.sweep.probed(points)[:, 2])
