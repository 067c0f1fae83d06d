"""A cut that goes exactly through chosen nodes of a mesh."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_REACH = 0.5  # element sizes: as in `verify.xfem.pieces`; farther off is another place
_AT_END = 1e-9  # element sizes


@dataclass(frozen=True)
class NodalCut:
    """A cut whose level set at the nodes of one mesh is given: zero at the nodes it goes through.

    Attributes
    ----------
    cut : Cut
        What it is everywhere else.
    points : (n, d) float array
        The nodes: this very array, not an equal one.
    values : (n,) float array
        In metres.
    """

    cut: Cut
    points: _Floats
    values: _Floats

    def level_set(self, points: _Floats) -> _Floats:
        """Return the nodal values at the nodes, the level set of the cut elsewhere.

        At single nodes through which the cut goes it is zero too, however far off they are.
        """
        if points is self.points:
            return self.values
        values = np.asarray(self.cut.level_set(points))
        on_cut = self.points[self.values == 0.0]
        if len(on_cut) and len(points):
            values = np.where(np.isin(_rows(points), _rows(on_cut)), 0.0, values)
        return values

    def depth(self, points: _Floats) -> _Floats:
        """Depth of the cut itself."""
        return self.cut.depth(points)

    def through(self, nodes: NDArray) -> "NodalCut":
        """Return the cut that goes through these nodes (numbers or mask) as well."""
        values = self.values.copy()
        values[nodes] = 0.0
        return replace(self, values=values)

    @staticmethod
    def on(mesh: SimplexMesh, cuts: Iterable[Cut]) -> list["NodalCut"]:
        """Return cuts with their own values at the nodes of a mesh."""
        return [NodalCut(cut, mesh.points, np.asarray(cut.level_set(mesh.points))) for cut in cuts]


def _rows(points: _Floats) -> NDArray:
    """Each row as one item to compare, bit by bit."""
    rows = np.ascontiguousarray(points + 0.0)  # no negative zeros
    return rows.view(np.dtype((np.void, rows.itemsize * rows.shape[1]))).ravel()


@dataclass(frozen=True)
class CrossedEdges:
    """Edges that a cut crosses between its ends.

    Attributes
    ----------
    plus, minus : (k,) int array
        End nodes on the two sides.
    share : (k,) float array
        Where the cut crosses: 0 at the plus end, 1 at the minus end.
    """

    plus: _Ints
    minus: _Ints
    share: _Floats

    def nearest_ends(self, threshold: float) -> _Ints:
        """Nodes nearer to a crossing than `threshold` of its edge; half: one for each edge."""
        near_plus = self.share <= threshold
        near_minus = (1.0 - self.share <= threshold) & ~near_plus
        return np.unique(np.concatenate([self.plus[near_plus], self.minus[near_minus]]))


def crossed_edges(mesh: SimplexMesh, cut: NodalCut) -> CrossedEdges:
    """Edges with ends strictly on both sides that the cut crosses."""
    first, second = np.triu_indices(mesh.dim + 1, 1)
    sign = np.sign(cut.values)
    a, b = mesh.cells[:, first].ravel(), mesh.cells[:, second].ravel()
    mixed = sign[a] * sign[b] < 0
    a, b = a[mixed], b[mixed]
    ends = np.unique(np.stack([np.where(sign[a] > 0, a, b), np.where(sign[a] > 0, b, a)]), axis=1)
    plus, minus = ends
    above, below = cut.values[plus], -cut.values[minus]
    share = above / (above + below)
    at = mesh.points[plus] + share[:, None] * (mesh.points[minus] - mesh.points[plus])
    size = np.linalg.norm(mesh.points[plus] - mesh.points[minus], axis=1)
    inside = np.abs(cut.level_set(at)) <= _REACH * size
    inside &= cut.depth(at) >= -_AT_END * size
    return CrossedEdges(plus[inside], minus[inside], share[inside])
