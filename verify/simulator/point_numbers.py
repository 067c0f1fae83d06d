"""Arrays that grow, and one number for each point where cuts meet the mesh, in whatever order.

A zero point belongs to the simplex spanned by some mesh nodes (its support) and to the zero sets
of some cuts. If the support has one node more than there are cuts, these sets say which point it
is; otherwise the edge on which it was found does.
"""

from collections import defaultdict
from itertools import count
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.zero_points import ZeroPoints


class GrowingArray:
    """Rows of equal shape.

    Parameters
    ----------
    rows : array
        The first rows; copied.

    Attributes
    ----------
    rows : array
        All rows so far, a view. It stays valid, but not complete, when more are appended.
    """

    def __init__(self, rows: NDArray[Any]) -> None:
        first = np.array(rows)
        self._store = np.empty((max(16, 2 * len(first)), *first.shape[1:]), dtype=first.dtype)
        self._store[: len(first)] = first
        self.rows = self._store[: len(first)]

    def __len__(self) -> int:
        return len(self.rows)

    def append(self, rows: NDArray[Any]) -> None:
        """Append rows (k, ...)."""
        begin = self.extend(len(rows))
        self.rows[begin:] = rows

    def extend(self, count: int) -> int:
        """Append rows without values; the number of the first."""
        begin, end = len(self.rows), len(self.rows) + count
        if end > len(self._store):
            store = np.empty((2 * end, *self._store.shape[1:]), dtype=self._store.dtype)
            store[:begin] = self.rows
            self._store = store
        self.rows = self._store[:end]
        return begin


class RowNumbers:
    """Rows of one length and their numbers."""

    def __init__(self) -> None:
        self._number: defaultdict[bytes, int] = defaultdict(count().__next__)

    def number(self, rows: Ints) -> tuple[Ints, Ints]:
        """Numbers (k,) of rows (k, width), and where each new one comes first.

        New rows get the next numbers, in their order.
        """
        # equal rows often follow each other
        other = np.append(True, (rows[1:] != rows[:-1]).any(axis=1))[: len(rows)]
        keys = rows[other].view(f"V{8 * rows.shape[1]}").ravel().tolist()
        last = len(self._number) - 1
        found = np.fromiter(map(self._number.__getitem__, keys), np.int64, len(keys))
        found = found[np.cumsum(other) - 1]
        before = np.maximum.accumulate(np.concatenate([[last], found[:-1]]))
        return found, np.flatnonzero(found > before)


def distinct(values: Ints) -> Ints:
    """Distinct values (q,), ascending: for a few thousand a sort beats numpy's hashing."""
    ordered = np.sort(values, axis=None)
    first = np.ones(len(ordered), dtype=bool)
    np.not_equal(ordered[1:], ordered[:-1], out=first[1:])
    return ordered[first]


def ranges(bounds: Ints) -> Ints:
    """Integers from the first up to the second bound of each row (k, 2), row after row."""
    counts = bounds[:, 1] - bounds[:, 0]
    ends = np.cumsum(counts)
    shift = np.repeat(bounds[:, 0] - ends + counts, counts)
    return np.arange(len(shift)) + shift


def of_lists(starts: Ints, items: Ints, rows: Ints) -> Ints:
    """Integers of some lists, of which each begins where the one before ends."""
    return items[ranges(np.stack([starts[rows], starts[rows + 1]], axis=1))]


NODES, CUTS = 4, 3  # a point of a tetrahedron has at most that many
NONE = np.iinfo(np.int64).max  # no further node or cut
_WIDTH = NODES + CUTS


class FoundPoints(NamedTuple):
    """What is asked of the points of a patch, as in `ZeroPoints`."""

    positions: Floats
    values: Floats
    ends: Ints
    cut: Ints


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
        self._table = RowNumbers()
        self.met = np.zeros((nodes, 0), dtype=bool)
        self._supports = GrowingArray(np.empty((0, _WIDTH), dtype=np.int64))

    @property
    def supports(self) -> Ints:
        """(k, 7) mesh nodes (4) and cuts (3) of each zero point, ascending, padded at the end."""
        return self._supports.rows

    def number(self, points: ZeroPoints | FoundPoints, whole_nodes: Ints, cuts: Ints) -> Ints:
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
        local, ends = len(whole_nodes), points.ends
        numbers = np.concatenate([whole_nodes, np.full(len(ends), -1)])
        if len(ends) == 0:
            return numbers
        if (beyond := int(cuts.max()) + 1 - self.met.shape[1]) > 0:
            self.met = np.hstack([self.met, np.zeros((self.nodes, beyond), dtype=bool)])
        self.met[whole_nodes[:, None], cuts] = points.values[:local] == 0.0
        # ends that are zero points themselves come first
        while len(rest := np.flatnonzero(numbers[local:] < 0)):
            ready = rest[(numbers[ends[rest]] >= 0).all(axis=1)]
            own = numbers[ends[ready]]
            numbers[local + ready], new = self._number(own, cuts[points.cut[ready]])
            self.positions.append(points.positions[local + ready[new]])
            self.ends.append(own[new])
            self.cut.append(cuts[points.cut[ready[new]]])
        return numbers

    def _number(self, ends: Ints, cut: Ints) -> tuple[Ints, Ints]:
        """Numbers (k,) of the zero points of cuts (k,) on edges (k, 2), and the first new ones."""
        span, on = np.full((len(cut), NODES), NONE), np.full((len(cut), CUTS), NONE)
        span[:, :2], on[:, 0] = np.sort(ends, axis=1), cut
        if on_cuts := bool((ends >= self.nodes).any()):
            known = self.supports_of(ends)
            span = distinct_in_rows(known[:, :, :NODES].reshape(-1, 2 * NODES), NODES)
            first, second = known[:, 0, NODES:], known[:, 1, NODES:]
            common = np.where((first[:, :, None] == second[:, None, :]).any(axis=2), first, NONE)
            on = distinct_in_rows(np.hstack([on, common]), CUTS)
        key = np.hstack([span, on])
        if on_cuts:
            edge = (span < NONE).sum(axis=1) != (on < NONE).sum(axis=1) + 1
            key[edge] = -1
            key[edge, :3] = np.column_stack([cut, ends])[edge]
        number, new = self._table.number(key)
        on = on[new]
        if on_cuts:
            # a cut on which one end lies, and that runs exactly through the other
            others, ends = known[new, ::-1, NODES:], ends[new]
            at = np.nonzero((ends[:, :, None] < self.nodes) & (others < NONE))
            through = np.full(others.shape, NONE)
            through[at] = np.where(self.met[ends[at[:2]], others[at]], others[at], NONE)
            on = distinct_in_rows(np.hstack([on, through.reshape(-1, 2 * CUTS)]), CUTS)
        self._supports.append(np.hstack([span[new], on]))
        return self.nodes + number, new

    def supports_of(self, points: Ints) -> Ints:
        """(..., 7) mesh nodes and cuts of points (...), ascending, padded at the end."""
        found = np.full((*points.shape, _WIDTH), NONE)
        zero = points >= self.nodes
        found[..., 0] = points
        found[zero] = self.supports[points[zero] - self.nodes]
        return found

    def spans(self, nodes: Ints, points: Ints) -> Bools:
        """Whether each of some mesh nodes (q, c) spans the simplex of a point (q,).

        The weights of the others at the point are zero; its own may round to zero.
        """
        found = np.zeros(nodes.shape, dtype=bool)
        for spanned in self.supports_of(points)[:, :NODES].T:
            found |= nodes == spanned[:, None]
        return found


def distinct_in_rows(rows: Ints, most: int) -> Ints:
    """Distinct integers of each row, ascending, at most so many, padded with `NONE`."""
    found = np.sort(rows, axis=1)
    again = found[:, 1:] == found[:, :-1]
    again &= found[:, 1:] < NONE
    if again.any():
        found[:, 1:][again] = NONE
        found.sort(axis=1)
    return found[:, :most]
