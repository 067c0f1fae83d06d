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
from verify.simulator.arrays.row_numbers import RowNumbers, find_row, number_of_row
from verify.xfem.zero_points import ZeroPoints

__all__ = ["FoundPoints", "PointNumbers", "runs_through", "spans"]

_Ints = NDArray[np.int64]

_NODES, _CUTS = 4, 3  # a point of a tetrahedron has at most that many
_WIDTH = _NODES + _CUTS


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
    """

    def __init__(self, nodes: int, space: int) -> None:
        self.nodes = nodes
        self.positions = GrowingArray(np.empty((0, space)))
        self.ends = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self.cut = GrowingArray(np.empty(0, dtype=np.int64))
        self._table = RowNumbers(_WIDTH)
        self._nodes_met = RowNumbers(2)
        self._still_met = GrowingArray(np.empty(0, dtype=np.bool_))
        self._supports = GrowingArray(np.empty((0, _WIDTH), dtype=np.int64))

    @property
    def supports(self) -> _Ints:
        """(k, 7) mesh nodes (4) and cuts (3) of each zero point, ascending, padded at the end."""
        return self._supports.rows

    @property
    def nodes_on_cuts(self) -> tuple[_Ints, _Ints, NDArray[np.bool_]]:
        """Table of rows (mesh node, cut), the rows, and whether the cut runs through the node."""
        return self._nodes_met.table, self._nodes_met.rows, self._still_met.rows

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
        self._meet_nodes(points.values[:local], whole_nodes, cuts)
        table, known, count = self._table.open_for(more)
        self._supports.extend(more)
        after = _number_points(
            points.ends,
            cuts[points.cut],
            local,
            self.nodes,
            numbers,
            self._supports.rows,
            self.nodes_on_cuts,
            table,
            known,
            count,
        )
        self._table.close(after)
        self._supports.rows = self._supports.rows[:after]
        for store in (self.positions, self.ends, self.cut):
            store.extend(after - count)
        _write_new(
            numbers,
            local,
            self.nodes,
            count,
            (points.positions, points.ends, cuts[points.cut]),
            (self.positions.rows, self.ends.rows, self.cut.rows),
        )
        return numbers

    def _meet_nodes(self, values: NDArray[np.float64], nodes: _Ints, cuts: _Ints) -> None:
        """Note which cuts run exactly through mesh nodes; of a growing one that may change."""
        zero = values == 0.0
        table, known, count = self._nodes_met.open_for(int(zero.sum()))
        self._still_met.extend(len(known) - count)
        count = _meet_nodes(zero, nodes, cuts, table, known, count, self._still_met.rows)
        self._nodes_met.close(count)
        self._still_met.rows = self._still_met.rows[:count]


@njit(cache=True)
def _write_new(numbers, local, nodes, count, found, stores):
    """Write where points with numbers from `count` on are; of equal points the first is taken."""
    positions, ends, cut = found
    all_positions, all_ends, all_cuts = stores
    for z in range(len(ends)):
        if numbers[local + z] - nodes != count:
            continue
        for i in range(positions.shape[1]):
            all_positions[count, i] = positions[local + z, i]
        for e in range(2):
            all_ends[count, e] = numbers[ends[z, e]]
        all_cuts[count] = cut[z]
        count += 1


@njit(cache=True)
def spans(node, point, count, supports):
    """Whether a mesh node is among those that span the simplex of a point; `count` are nodes."""
    if point < count:
        return point == node
    found = False
    for k in range(_NODES):
        found = found or supports[point - count, k] == node
    return found


@njit(cache=True)
def _meet_nodes(zero, nodes, cuts, table, known, count, met):
    row = np.empty(2, dtype=np.int64)
    for n in range(len(nodes)):
        for c in range(len(cuts)):
            row[0], row[1] = nodes[n], cuts[c]
            if zero[n, c]:
                number, count = number_of_row(row, table, known, count)
                met[number] = True
            else:
                number = find_row(row, table, known)
                if number >= 0:
                    met[number] = False
    return count


@njit(cache=True)
def _merge(row, begin, end, value):
    """Insert a value into an ascending list padded with the largest integer."""
    for k in range(begin, end):
        if row[k] == value:
            return
        if row[k] > value:
            value, row[k] = row[k], value


@njit(cache=True)
def runs_through(cut, node, met, pair):
    """Whether a cut runs exactly through a mesh node; `pair` (2,) is overwritten."""
    table, known, still = met
    pair[0], pair[1] = node, cut
    at = find_row(pair, table, known)
    return at >= 0 and still[at]


@njit(cache=True)
def _number_points(ends, cut, local, nodes, numbers, supports, met, table, known, count):
    none, start, middle = np.iinfo(np.int64).max, np.int64(0), np.int64(_NODES)
    row = np.empty(_WIDTH, dtype=np.int64)
    pair = np.empty(2, dtype=np.int64)
    edge = -np.ones(_WIDTH, dtype=np.int64)
    for z in range(len(ends)):
        for k in range(_WIDTH):
            row[k] = none
        for e in range(2):
            number = numbers[ends[z, e]]
            if number < nodes:
                _merge(row, start, _NODES, number)
                continue
            for k in range(_NODES):
                if supports[number - nodes, k] < none:
                    _merge(row, start, _NODES, supports[number - nodes, k])
        _merge(row, middle, _WIDTH, cut[z])
        first, second = numbers[ends[z, 0]] - nodes, numbers[ends[z, 1]] - nodes
        if first >= 0 and second >= 0:
            for i in range(_NODES, _WIDTH):
                for j in range(_NODES, _WIDTH):
                    common = supports[first, i]
                    if common < none and common == supports[second, j]:
                        _merge(row, middle, _WIDTH, common)
        support, on = 0, 0
        for k in range(_NODES):
            support += row[k] < none
        for k in range(_NODES, _WIDTH):
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
                for k in range(_NODES, _WIDTH):
                    if not node < 0 <= other or supports[other, k] == none:
                        continue
                    if runs_through(supports[other, k], node + nodes, met, pair):
                        _merge(row, middle, _WIDTH, supports[other, k])
            for k in range(_WIDTH):
                supports[number, k] = row[k]
        numbers[local + z] = nodes + number
    return count
