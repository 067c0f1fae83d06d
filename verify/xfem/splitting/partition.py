"""Pieces of cells that cuts divide, with their sub-simplices."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.splitting.zero_points import ZeroPoints

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
    sub_piece : (k,) int array
        Piece of each sub-simplex.
    sub_points : (k, d + 1) int array
        Its vertices, as numbers in `points`.
    sub_barycentric : (k, d + 1, d + 1) float array
        Barycentric coordinates of its vertices (second axis) in its cell.
    sub_fraction : (k,) float array
        Its share of the volume of its cell.
    sub_sign : (k,) int8 array
        Its orientation in its cell, +1 or -1: from how it came about, hence right for any sliver.
    points : ZeroPoints
        Mesh nodes and zero points.
    snapped : int
        Nodal level-set values that were taken as exactly zero.
    tied : (t, 2) int array
        Pairs of pieces of one cell that no cut keeps apart: together they are one.
    """

    parent: _Ints
    label: NDArray[np.int8]
    sub_piece: _Ints
    sub_points: _Ints
    sub_barycentric: _Floats
    sub_fraction: _Floats
    sub_sign: NDArray[np.int8]
    points: ZeroPoints
    snapped: int
    tied: _Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @property
    def fraction(self) -> _Floats:
        """(p,) share of each piece in the volume of its cell."""
        return np.bincount(self.sub_piece, self.sub_fraction, minlength=len(self.parent))

    @property
    def sides(self) -> NDArray[np.int8]:
        """(p, cuts) side of each cut on which a piece lies, 0 if it lies on both."""
        side = self.label.copy()
        plus = self.points.values[self.sub_points] >= 0.0
        for cut in range(side.shape[1]):
            above = np.bincount(self.sub_piece, plus[:, :, cut].any(axis=1), len(side)) > 0
            below = np.bincount(self.sub_piece, ~plus[:, :, cut].all(axis=1), len(side)) > 0
            whole = self.label[:, cut] == 0
            side[whole, cut] = above[whole].astype(np.int8) - below[whole].astype(np.int8)
        return side

    @property
    def simplices(self) -> tuple[_Ints, _Ints, _Floats, _Floats, NDArray[np.int8]]:
        """Piece, points, barycentric corners, share and sign of the sub-simplices."""
        return (
            self.sub_piece,
            self.sub_points,
            self.sub_barycentric,
            self.sub_fraction,
            self.sub_sign,
        )

    def with_simplices(
        self,
        piece: _Ints,
        points: _Ints,
        barycentric: _Floats,
        fraction: _Floats,
        sign: NDArray[np.int8],
    ) -> "Partition":
        """Return the same with other sub-simplices."""
        return replace(
            self,
            sub_piece=piece,
            sub_points=points,
            sub_barycentric=barycentric,
            sub_fraction=fraction,
            sub_sign=sign,
        )
