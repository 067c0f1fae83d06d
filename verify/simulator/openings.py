"""Opening of elements ahead of blades whose ways are known.

The rule of all solvers (`swept`): an element opens in the step in which the blade begins to sweep
the cut in the support of one of its nodes; what is then released is held by forces that fade with
the swept share (`verify.xfem.release`). A blade that is led by hand has no way ahead: elements open
when it has crossed them through, and let go at once.
"""

from collections.abc import Callable, Sequence

import numpy as np

from verify.geometry.swept_shares import SweptShares
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
        self._opens = []
        for k, path in enumerate(paths):
            cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
            passage = self._shares.add(sections(phantom, cells, k), _passes(path))
            self._opens.append(passage.let_go)

    def open(self, stroke: Stroke) -> None:
        """Let a stroke that has not begun open elements ahead of its blade."""
        stroke.open_ahead(self._opens[stroke.number], self._strokes[stroke.number])

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
