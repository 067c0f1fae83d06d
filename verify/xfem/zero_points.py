"""Points where edges cross the zero sets of the cuts, one number each for the whole mesh.

`verify.xfem.clip` divides cells at them.

An edge is a pair of numbered points: mesh nodes, or zero points of cuts applied before. Asking
twice for the same edge and cut gives the same number, so that neighbouring elements agree on the
position, and on the sign of every other cut there, to the last bit.

Asking may append: `find` and `on_edges` number what they have not met before, and change nothing
else. Points that no sub-simplex uses do no harm.
"""

import numpy as np

from verify.xfem.arrays import Floats, Ints

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
        # per cut: edges (plus << 32 | minus), ascending, and the point of each
        self._known: dict[int, tuple[Ints, Ints]] = {}

    def shares(self, cut: int | Ints, plus: Ints, minus: Ints) -> tuple[Floats, Floats]:
        """(r, s), (q,) each, of the zero points z = s·plus + r·minus on edges (plus, minus)."""
        above, below = self.values[plus, cut], self.values[minus, cut]
        return above / (above - below), -below / (above - below)

    def find(self, cut: int, plus: Ints, minus: Ints) -> Ints:
        """Numbers (q,) of the zero points of `cut` on edges from `plus`, φ ≥ 0, to `minus`, φ < 0.

        Where φ is exactly zero at the plus end, the zero point is that end. New points are
        numbered in the order of their ends, whatever the order in which they are asked for.
        """
        edge = plus << 32 | minus
        known, point = self._known.get(cut, (_NONE, _NONE))
        new = np.unique(edge)
        if len(known):
            new = new[known[np.minimum(np.searchsorted(known, new), len(known) - 1)] != new]
        if len(new):
            known = np.concatenate([known, new])
            point = np.concatenate([point, self._append(cut, new >> 32, new & 0xFFFFFFFF)])
            order = np.argsort(known)
            known, point = self._known[cut] = known[order], point[order]
        return point[np.searchsorted(known, edge)]

    def on_edges(self, cut: int, points: Ints) -> Ints:
        """Numbers (q, c, c) of the points of `cut` on the edges of simplices with points (q, c).

        Entry ab is the point between corner a, where φ ≥ 0, and b, where φ < 0; if a = b it is
        the corner itself, elsewhere 0, which is not read.
        """
        plus = self.values[points, cut] >= 0.0
        row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
        number = np.zeros((*points.shape, points.shape[1]), dtype=np.int64)
        number[row, a, b] = self.find(cut, points[row, a], points[row, b])
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

    def _append(self, cut: int, plus: Ints, minus: Ints) -> Ints:
        """Points on edges that had none."""
        r, s = self.shares(cut, plus, minus)
        new = r > 0.0
        point = np.where(new, len(self.positions) - 1 + np.cumsum(new), plus)
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
        self.turn = np.concatenate([self.turn, np.full(len(p), _NEVER)])
        return point
