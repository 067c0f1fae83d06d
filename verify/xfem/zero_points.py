"""Points where edges cross the zero sets of the cuts, one number each for the whole mesh.

`verify.xfem.clip` divides cells at them.

An edge is a pair of numbered points: mesh nodes, or zero points of cuts applied before. The same
edge and cut always give the same number. So neighbouring elements agree to the last bit on the
position, and on the sign of every other cut there.

Asking may append: `find` and `on_edges` number what they have not met before, and change nothing
else. Points that no sub-simplex uses do no harm.
"""

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints

_NONE = np.zeros(0, dtype=np.int64)
_NEVER = np.iinfo(np.int64).max


class ZeroPoints:
    """Mesh nodes followed by the zero points found so far.

    Parameters
    ----------
    positions : (n, d) float array
        Mesh nodes, in metres.
    values : (n, cuts) float array
        Nodal level sets in metres; those up to `snap` in size are exactly zero already.
    snap : float
        Values at new points up to this size are taken as exactly zero, in metres.

    Attributes
    ----------
    positions, values
        The same, with the zero points appended.
    nodes : int
        Number of mesh nodes.
    ends : (k, 2) int array
        Ends (plus, minus) of the edge of each zero point.
    cut : (k,) int array
        Cut of each zero point.
    turn : (k,) int array
        When each zero point was first used: the number of that call of `divided`.
    """

    def __init__(self, positions: Floats, values: Floats, snap: float) -> None:
        self.positions = positions
        self.values = values
        self.nodes = len(positions)
        self.ends = np.zeros((0, 2), dtype=np.int64)
        self.cut, self.turn = _NONE, _NONE
        self._turns = 0
        self._snap = snap
        self._room = values[:0]  # of which the values are the first rows, for those to come
        # edges (plus << 32 | minus) that are known, ascending, on each the cuts, ascending, and
        # their points; the last entry is none
        self._edge, self._of, self._point = np.array([[_NEVER], [0], [0]])

    def shares(self, cut: Ints, plus: Ints, minus: Ints) -> tuple[Floats, Floats]:
        """Compute (r, s), (q,) each, of the zero points z = s·plus + r·minus on edges."""
        above, below = self.values[plus, cut], self.values[minus, cut]
        return above / (above - below), -below / (above - below)

    def find(self, cut: Ints, plus: Ints, minus: Ints) -> Ints:
        """Find numbers (q,) of zero points of cuts (q,) on edges from φ ≥ 0 to φ < 0, (q,) each.

        Where φ is exactly zero at the plus end, the zero point is that end. New points are
        numbered in the order of their ends, whatever the order in which they are asked for.
        """
        edge = plus << 32 | minus
        at, known = self._places(edge, cut)
        new = np.flatnonzero(~known)
        if len(new) == 0:
            return self._point[at]
        new = new[np.lexsort((cut[new], edge[new]))]
        first = np.ones(len(new), dtype=bool)
        first[1:] = (np.diff(edge[new]) != 0) | (np.diff(cut[new]) != 0)
        new = new[first]
        point = self._append(cut[new], plus[new], minus[new])
        self._edge = np.insert(self._edge, at[new], edge[new])
        self._of = np.insert(self._of, at[new], cut[new])
        self._point = np.insert(self._point, at[new], point)
        return self._point[self._places(edge, cut)[0]]

    def _places(self, edge: Ints, cut: Ints) -> tuple[Ints, Bools]:
        """Find places (q,) of pairs of edge and cut among known ones, and whether they exist."""
        at = np.searchsorted(self._edge, edge)
        while (before := (self._edge[at] == edge) & (self._of[at] < cut)).any():
            at += before
        return at, (self._edge[at] == edge) & (self._of[at] == cut)

    def on_edges(self, cut: Ints, points: Ints) -> Ints:
        """Find numbers (q, c, c) of points of cuts (q,) on edges of simplices with points (q, c).

        Entry ab is the point between corner a, where φ ≥ 0, and b, where φ < 0; if a = b it is
        the corner itself, elsewhere 0, which is not read.
        """
        plus = self.values[points, cut[:, None]] >= 0.0
        row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
        number = np.zeros((*points.shape, points.shape[1]), dtype=np.int64)
        number[row, a, b] = self.find(cut[row], points[row, a], points[row, b])
        corner = np.arange(points.shape[1])
        number[:, corner, corner] = points
        return number

    def divided(self, numbers: Ints) -> None:
        """Note that cells were divided at points, of which mesh nodes do not count."""
        used = numbers[numbers >= self.nodes] - self.nodes
        self.turn[used] = np.minimum(self.turn[used], self._turns)
        self._turns += 1

    def in_order(self, numbers: Ints) -> Ints:
        """Sort places (k,) of zero points in `ends` as divisions used them, last ends first.

        Bisecting edges in this order gives the diagonals by which `verify.xfem.clip` divides faces.
        Of a triangle with zero points ab, ac, b < c, bisection at ac comes first and makes b–ac.
        """
        ends = self.ends[numbers]
        return numbers[np.lexsort([-ends[:, 1], -ends[:, 0], self.turn[numbers]])]

    def _append(self, cut: Ints, plus: Ints, minus: Ints) -> Ints:
        """Assign numbers to points on edges that had none."""
        r, s = self.shares(cut, plus, minus)
        new = r > 0.0
        point = np.where(new, len(self.positions) - 1 + np.cumsum(new), plus)
        r, s, p, m, cut = r[new, None], s[new, None], plus[new], minus[new], cut[new]
        values = s * self.values[p] + r * self.values[m]
        values[np.abs(values) <= self._snap] = 0.0
        values[np.arange(len(p)), cut] = 0.0
        count = len(self.values) + len(p)
        if count > len(self._room):
            self._room = np.empty((2 * count, values.shape[1]))
            self._room[: len(self.values)] = self.values
        self._room[len(self.values) : count] = values
        self.values = self._room[:count]
        self.positions = np.concatenate(
            [self.positions, s * self.positions[p] + r * self.positions[m]]
        )
        self.ends = np.concatenate([self.ends, np.stack([p, m], axis=1)])
        self.cut = np.concatenate([self.cut, cut])
        self.turn = np.concatenate([self.turn, np.full(len(p), _NEVER)])
        return point
