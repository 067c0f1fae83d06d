"""Plan of a multifrontal factorisation before it sees a value: fronts, rows and places."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.front_tree import merge_and_order
from verify.accelerated.minimum_degree import minimum_degree

_Ints = NDArray[np.int64]


class FrontPlan(NamedTuple):
    """Fronts in postorder, as kernels take them.

    Attributes
    ----------
    order : (N,) int array
        Nodes in the order of elimination.
    bounds : (F + 1,) int array
        Columns of front s are places bounds[s] to bounds[s + 1] in the order.
    row_start : (F + 1,) int array
        Rows of front s are entries row_start[s] to row_start[s + 1] of `rows`.
    rows : (R,) int array
        Places in the order, ascending, after the columns of the front.
    relative : (R,) int array
        Place of each row among the columns and rows of the parent front.
    parent, level : (F,) int arrays
        Parent front, -1 at a root, and how many are above.
    entry_start : (N + 1,) int array
        Matrix blocks of each column (in the order).
    entry_block, entry_row : (E,) int arrays
        Which block, transposed, adds to which local row of the column's front.
    """

    order: _Ints
    bounds: _Ints
    row_start: _Ints
    rows: _Ints
    relative: _Ints
    parent: _Ints
    level: _Ints
    entry_start: _Ints
    entry_block: _Ints
    entry_row: _Ints


def plan_fronts(
    starts: NDArray[np.int32], columns: NDArray[np.int32], held: NDArray[np.bool_]
) -> FrontPlan:
    """Find order, fronts and places for a sparsity.

    Parameters
    ----------
    starts, columns : int arrays
        Symmetric, as compressed rows.
    held : (N,) bool array
        Nodes that are coupled to no other.
    """
    nodes = len(held)
    node = np.repeat(np.arange(nodes), np.diff(starts))
    blocks = np.flatnonzero((columns == node) | ~(held[node] | held[columns]))
    begins, coupled = np.searchsorted(blocks, starts), columns[blocks].astype(np.int64)
    order, bounds, row_start, rows = minimum_degree(begins, coupled)
    parent = _parents(bounds, row_start, _inverse(order)[rows])
    below = np.diff(row_start)
    order, bounds, tops, level = merge_and_order(order, bounds, parent, below)
    rank, below = _inverse(order), below[tops]
    # rows of a front, ascending: sorted by front and place at once
    front = np.repeat(np.arange(len(tops)), below)
    keys = np.sort(nodes * front + rank[rows[_ranges(row_start[tops], below)]])
    row_start, rows = _starts(below), keys - nodes * front
    parent = _parents(bounds, row_start, rows)

    def places(front: _Ints, row: _Ints) -> _Ints:
        """Places of rows among the columns and rows of fronts."""
        found = row - bounds[front]
        outside = np.flatnonzero(row >= bounds[front + 1])
        front = front[outside]
        at = np.searchsorted(keys, nodes * front + row[outside])
        found[outside] = (bounds[front + 1] - bounds[front]) + at - row_start[front]
        return found

    count = np.diff(begins)[order]
    at = _ranges(begins[order], count)
    column, row = np.repeat(np.arange(nodes), count), rank[coupled[at]]
    lower = row >= column
    at, column, row = at[lower], column[lower], row[lower]
    return FrontPlan(
        order, bounds, row_start, rows, places(parent[front], rows), parent, level,
        np.searchsorted(column, np.arange(nodes + 1)), blocks[at],
        places(np.searchsorted(bounds, column, "right") - 1, row),
    )  # fmt: skip


def stack_depths(parent: _Ints, level: _Ints, entries: _Ints) -> tuple[int, int]:
    """Depths of two stacks of update matrices, of fronts of even levels and of odd ones.

    A front writes its update matrix (of that many entries) on one while those of its children,
    which it then takes, are last on the other.
    """
    freed = np.bincount(parent[parent >= 0], entries[parent >= 0], len(parent)).astype(np.int64)
    even, odd = (
        np.where(level & 1 == mine, entries, 0) - np.where(level & 1 == mine, 0, freed)
        for mine in (0, 1)
    )
    return int(np.cumsum(even).max(initial=0)), int(np.cumsum(odd).max(initial=0))


def _inverse(order: _Ints) -> _Ints:
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank


def _starts(counts: _Ints) -> _Ints:
    return np.concatenate([[0], np.cumsum(counts)])


def _ranges(first: _Ints, counts: _Ints) -> _Ints:
    """Ranges of that many numbers from the first ones on, one after the other."""
    return np.arange(counts.sum()) + np.repeat(first - _starts(counts)[:-1], counts)


def _parents(bounds: _Ints, row_start: _Ints, rows: _Ints) -> _Ints:
    """Front (S,) in whose columns the first row of each is; -1 without rows."""
    parent = np.full(len(bounds) - 1, -1)
    some = np.flatnonzero(np.diff(row_start))
    if len(some):
        first = np.minimum.reduceat(rows, row_start[some])
        parent[some] = np.searchsorted(bounds, first, "right") - 1
    return parent
