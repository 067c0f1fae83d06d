"""Points where edges cross the zero sets of the cuts, one number each for the whole mesh.

An edge is a pair of numbered points: mesh nodes, or zero points of cuts applied before. Asking
twice for the same edge and cut gives the same number, so that neighbouring elements agree on the
position, and on the sign of every other cut there, to the last bit.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays.growing_array import GrowingArray
from verify.xfem.arrays.row_numbers import EdgeTable, RowNumbers
from verify.xfem.splitting.split_kernels import (
    edges_of_cells,
    first_divided,
    points_of_edges,
    points_on_edges,
)

__all__ = ["ZeroPoints"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class ZeroPoints:
    """Mesh nodes followed by the zero points found so far.

    Parameters
    ----------
    positions : (n, d) float array
        Mesh nodes, in metres.
    values : (n, cuts) float array
        Nodal level sets, already snapped.
    snap : float
        Level-set values up to this size are taken as exactly zero, in metres.

    Attributes
    ----------
    positions, values
        The same, with the zero points appended.
    ends : (k, 2) int array
        Ends (plus, minus) of the edge of each zero point.
    cut : (k,) int array
        Cut of each zero point.
    turn : (k,) int array
        When a division of cells first used each zero point, counting `divided`.
    """

    def __init__(self, positions: _Floats, values: _Floats, snap: float) -> None:
        self.positions = positions
        self.values = values
        self.ends = np.zeros((0, 2), dtype=np.int64)
        self.cut = np.zeros(0, dtype=np.int64)
        self.turn = np.zeros(0, dtype=np.int64)
        self._turns = 0
        self._snap = snap
        self._edges = RowNumbers(3)
        self._point = GrowingArray(np.zeros(0, dtype=np.int64))

    @property
    def nodes(self) -> int:
        """Number of mesh nodes."""
        return len(self.positions) - len(self.ends)

    @property
    def table(self) -> EdgeTable:
        """The points by edge, for kernels: see `point_on_edge`."""
        return EdgeTable(self._edges.table, self._edges.rows, self._point.rows)

    def shares(self, cut: int, plus: _Ints, minus: _Ints) -> tuple[_Floats, _Floats]:
        """(r, s) of the zero points z = s·plus + r·minus on edges from φ ≥ 0 to φ < 0."""
        above, below = self.values[plus, cut], self.values[minus, cut]
        return above / (above - below), -below / (above - below)

    def find(self, cut: int, plus: _Ints, minus: _Ints) -> _Ints:
        """Numbers of the zero points of `cut` on edges (plus, minus).

        Where φ is exactly zero at the plus end, the zero point is that end. New points are
        numbered in the order of their ends, whatever the order in which they are asked for.
        """
        before = len(self._edges)
        edge = self._edges.number(np.stack([np.full(len(plus), cut), plus, minus], axis=1))
        if len(self._edges) > before:
            self._append(cut, before)
        return self._point.rows[edge]

    def cross(self, chosen: _Ints, cells: _Ints) -> tuple[_Ints, _Floats, _Floats]:
        """Find the points at which the only cut crosses the edges of cells, before any other.

        Parameters
        ----------
        chosen : (q,) int array
            Cells that have corners on both sides.
        cells : (m, d + 1) int array

        Returns
        -------
        edges : (q, e) int array
            Edges of each cell that are crossed, -1 where there are no more.
        places : (k, s) float array
            Where each edge is crossed, in metres.
        size : (q,) float array
            Longest edge of each cell, in metres.
        """
        corners = cells.shape[1]
        most = (corners // 2) * (corners - corners // 2)
        edges, size = np.empty((len(chosen), most), dtype=np.int64), np.empty(len(chosen))
        table, known, _ = self._edges.open_for(edges.size)
        count = edges_of_cells(
            chosen, cells, self.positions, self.values, table, known, edges, size
        )
        self._edges.close(count)
        known = known[:count]
        places, share = points_on_edges(known, self.positions, self.values)
        order = np.argsort(known[:, 1] << 32 | known[:, 2])
        point, self.ends, new = points_of_edges(known, order, share, places, len(self.positions))
        self._point.append(point)
        self.values = np.concatenate([self.values, np.zeros((len(new), 1))])
        self.positions = np.concatenate([self.positions, new])
        self.cut = np.zeros(len(new), dtype=np.int64)
        self.turn = np.full(len(new), np.iinfo(np.int64).max)
        return edges, places, size

    def divided(self, numbers: _Ints) -> None:
        """Note that cells were divided at points (s, d + 1), of which mesh nodes do not count."""
        first_divided(numbers, self.nodes, self.turn, self._turns)
        self._turns += 1

    def in_order(self, numbers: _Ints) -> _Ints:
        """Places (k,) of zero points in `ends`, as divisions used them, last ends first.

        Bisecting edges in this order gives the diagonals of the staircase on faces.
        """
        ends = self.ends[numbers]
        turn = self.turn if len(self.turn) == len(self.cut) else self.cut
        return numbers[np.lexsort([-ends[:, 1], -ends[:, 0], turn[numbers]])]

    def _append(self, cut: int, before: int) -> None:
        """Give points to the edges from number `before` on."""
        edges = self._edges.rows[before:]
        order = np.argsort(edges[:, 1] << 32 | edges[:, 2])
        plus, minus = edges[order, 1], edges[order, 2]
        r, s = self.shares(cut, plus, minus)
        new = r > 0.0
        self._point.extend(len(edges))
        self._point.rows[before + order] = np.where(
            new, len(self.positions) - 1 + np.cumsum(new), plus
        )
        r, s, p, m = r[new, None], s[new, None], plus[new], minus[new]
        values = s * self.values[p] + r * self.values[m]
        values[np.abs(values) <= self._snap] = 0.0
        values[:, cut] = 0.0
        self.values = np.concatenate([self.values, values])
        self.positions = np.concatenate(
            [self.positions, s * self.positions[p] + r * self.positions[m]]
        )
        self.ends = np.concatenate([self.ends, np.stack([p, m], axis=1)])
        self.cut = np.concatenate([self.cut, np.full(len(p), cut)])
        self.turn = np.concatenate([self.turn, np.full(len(p), np.iinfo(np.int64).max)])
