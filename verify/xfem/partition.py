"""Parts of cells that cuts divide, with their sub-simplices."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.clip import Simplices
from verify.xfem.zero_points import ZeroPoints

__all__ = ["Partition"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Partition:
    """Pieces of some cells and their sub-simplices.

    Attributes
    ----------
    parent : (p,) int array
        Cell of each piece.
    label : (p, cuts) int8 array
        Side of each cut that split the piece off; 0 if the cut does not split its cell.
    simplices : Simplices
        Sub-simplices of the pieces; their vertices are numbers in `points`.
    points : ZeroPoints
        Mesh nodes and zero points.
    snapped : int
        Nodal level-set values within round-off that were taken as exactly zero.
    tied : (t, 2) int array
        Pairs of pieces of one cell that no cut keeps apart: together they are one.
    """

    parent: _Ints
    label: NDArray[np.int8]
    simplices: Simplices
    points: ZeroPoints
    snapped: int
    tied: _Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @staticmethod
    def whole(cells: _Ints, chosen: _Ints, points: ZeroPoints, snapped: int) -> "Partition":
        """One piece of each chosen cell, before any cut."""
        label = np.zeros((len(chosen), points.values.shape[1]), dtype=np.int8)
        simplices = Simplices.of_cells(np.arange(len(chosen)), cells[chosen])
        return Partition(chosen, label, simplices, points, snapped)

    @property
    def fraction(self) -> _Floats:
        """(p,) share of each piece in the volume of its cell."""
        sub = self.simplices
        return np.bincount(sub.piece, sub.fraction, minlength=len(self.parent))

    def crossed_edges(self, cut: int) -> tuple[_Ints, _Ints]:
        """Edges (q, 2) from plus to minus that a cut crosses, and the piece (q,) of each.

        Of pieces that the cut has divided already none are given.
        """
        sub = self.simplices
        rows = np.flatnonzero(self.label[sub.piece, cut] == 0)
        plus = self.points.values[sub.points[rows], cut] >= 0.0
        row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
        rows = rows[row]
        return np.stack([sub.points[rows, a], sub.points[rows, b]], axis=1), sub.piece[rows]

    def only_split(self) -> "Partition":
        """Leave out the cells that no cut went through; order the pieces by cell."""
        split = (self.label != 0).any(axis=1)
        order = np.flatnonzero(split)
        order = order[np.argsort(self.parent[order], kind="stable")]
        number = np.full(len(split), -1)
        number[order] = np.arange(len(order))
        kept = self.simplices[split[self.simplices.piece]]
        return replace(
            self,
            parent=self.parent[order],
            label=self.label[order],
            simplices=replace(kept, piece=number[kept.piece]),
        )
