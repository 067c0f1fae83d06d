"""One number for each point where cuts meet the mesh, however often and in whatever order.

A zero point belongs to the simplex spanned by some mesh nodes (its support) and to the zero sets
of some cuts. If the support has one node more than there are cuts, these sets say which point it
is; otherwise the edge on which it was found does.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.simulator.arrays.growing_array import GrowingArray
from verify.simulator.arrays.row_numbers import RowNumbers, first_of_new, number_of_row
from verify.xfem.zero_points import ZeroPoints

_Ints = NDArray[np.int64]

NODES, CUTS = 4, 3  # a point of a tetrahedron has at most that many
_WIDTH = NODES + CUTS


class FoundPoints(NamedTuple):
    """What is asked of the points of a patch, as in `ZeroPoints`."""

    positions: NDArray[np.float64]
    values: NDArray[np.float64]
    ends: _Ints
    cut: _Ints


class PointNumbers:
    """Numbers of zero points: mesh nodes keep theirs, zero points follow.

    Attributes
    ----------
    nodes : int
        Number of mesh nodes.
    positions : GrowingArray
        (k, s) of the zero points, in metres.
    ends : GrowingArray
        (k, 2) numbers of the ends (plus, minus) of an edge on which each lies.
    cut : GrowingArray
        (k,) cut whose zero it is on that edge.
    met : (nodes, cuts) bool array
        Whether a cut runs exactly through a mesh node; of a growing cut that may change.
    """

    def __init__(self, nodes: int, space: int) -> None:
        self.nodes = nodes
        self.positions = GrowingArray(np.empty((0, space)))
        self.ends = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self.cut = GrowingArray(np.empty(0, dtype=np.int64))
        self._table = RowNumbers(_WIDTH)
        self.met = np.zeros((nodes, 0), dtype=bool)
        self._supports = GrowingArray(np.empty((0, _WIDTH), dtype=np.int64))

    @property
    def supports(self) -> _Ints:
        """(k, 7) mesh nodes (4) and cuts (3) of each zero point, ascending, padded at the end."""
        return self._supports.rows

    def number(self, points: ZeroPoints | FoundPoints, whole_nodes: _Ints, cuts: _Ints) -> _Ints:
        """Numbers of all points of a patch: its nodes, then its zero points.

        Parameters
        ----------
        points : ZeroPoints or FoundPoints
            Of the patch.
        whole_nodes : int array
            Number in the whole mesh of each node of the patch.
        cuts : int array
            Number in the whole list of each cut of the patch.
        """
        local, more = len(whole_nodes), len(points.ends)
        numbers = np.empty(local + more, dtype=np.int64)
        numbers[:local] = whole_nodes
        if more == 0:
            return numbers
        if (beyond := int(cuts.max()) + 1 - self.met.shape[1]) > 0:
            self.met = np.hstack([self.met, np.zeros((self.nodes, beyond), dtype=bool)])
        self.met[whole_nodes[:, None], cuts] = points.values[:local] == 0.0
        table, known, count = self._table.open_for(more)
        self._supports.extend(more)
        after = _number_points(
            points.ends, cuts[points.cut], numbers, self.met, self._supports.rows, table, known,
            count,
        )  # fmt: skip
        self._table.close(after)
        self._supports.rows = self._supports.rows[:after]
        new = first_of_new(numbers[local:], self.nodes + count)  # of equal points the first
        self.positions.append(points.positions[local + new])
        self.ends.append(numbers[points.ends[new]])
        self.cut.append(cuts[points.cut[new]])
        return numbers

    def spans(self, nodes: _Ints, points: _Ints) -> NDArray[np.bool_]:
        """Whether each of some mesh nodes (q, c) spans the simplex of each point (q, k): q, k, c.

        The weights of the others at the point are zero; its own may round to zero.
        """
        found: NDArray[np.bool_] = points[:, :, None] == nodes[:, None]
        zero = points >= self.nodes
        at, _ = np.nonzero(zero)
        supports = self.supports[points[zero] - self.nodes, :NODES]
        found[zero] = (supports[:, None] == nodes[at, :, None]).any(axis=2)
        return found


@njit(cache=True)
def _merge(row, begin, end, value):
    """Insert a value into an ascending list padded with the largest integer."""
    for k in range(begin, end):
        if row[k] == value:
            return
        if row[k] > value:
            value, row[k] = row[k], value


@njit(cache=True)
def _number_points(ends, cut, numbers, met, supports, table, known, count):
    """Write the numbers of zero points after those of the nodes of a patch; give their count."""
    local, nodes = len(numbers) - len(ends), len(met)
    none, start, middle = np.iinfo(np.int64).max, np.int64(0), np.int64(NODES)
    row = np.empty(_WIDTH, dtype=np.int64)
    edge = -np.ones(_WIDTH, dtype=np.int64)
    for z in range(len(ends)):
        for k in range(_WIDTH):
            row[k] = none
        for e in range(2):
            number = numbers[ends[z, e]]
            if number < nodes:
                _merge(row, start, NODES, number)
                continue
            for k in range(NODES):
                if supports[number - nodes, k] < none:
                    _merge(row, start, NODES, supports[number - nodes, k])
        _merge(row, middle, _WIDTH, cut[z])
        first, second = numbers[ends[z, 0]] - nodes, numbers[ends[z, 1]] - nodes
        if first >= 0 and second >= 0:
            for i in range(NODES, _WIDTH):
                for j in range(NODES, _WIDTH):
                    common = supports[first, i]
                    if common < none and common == supports[second, j]:
                        _merge(row, middle, _WIDTH, common)
        support, on = 0, 0
        for k in range(NODES):
            support += row[k] < none
        for k in range(NODES, _WIDTH):
            on += row[k] < none
        before = count
        if support == on + 1:
            number, count = number_of_row(row, table, known, count)
        else:
            edge[0], edge[1], edge[2] = cut[z], first + nodes, second + nodes
            number, count = number_of_row(edge, table, known, count)
        if count > before:
            # a cut on which one end lies, and that runs exactly through the other
            for node, other in ((first, second), (second, first)):
                for k in range(NODES, _WIDTH):
                    if not node < 0 <= other or supports[other, k] == none:
                        continue
                    if met[node + nodes, supports[other, k]]:
                        _merge(row, middle, _WIDTH, supports[other, k])
            for k in range(_WIDTH):
                supports[number, k] = row[k]
        numbers[local + z] = nodes + number
    return count
