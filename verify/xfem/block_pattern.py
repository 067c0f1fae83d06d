"""The sparsity of nodal blocks, and where each element block goes: no triplets, no sorting."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from verify.xfem.errors import XfemError
from verify.xfem.short_sort import sort_short

__all__ = ["BlockPattern", "block_pattern", "symmetric_product"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int32]


@dataclass(frozen=True)
class BlockPattern:
    """Compressed rows of nodal blocks.

    Attributes
    ----------
    starts : (N + 1,) int array
        First block of each row.
    columns : (B,) int array
        Column of each block, ascending in a row.
    targets : (p, c, c) int array
        Block to which the pair (row corner, column corner) of each cell adds; B and more are
        blocks aside that `fold` takes to others.
    folding : (B, S) csr_array, optional
        Share of each of the S blocks aside in those of the pattern.
    """

    starts: _Ints
    columns: _Ints
    targets: _Ints
    folding: csr_array | None = None

    def unfold(self, blocks: _Floats) -> _Floats:
        """Return what elements are to be added to: the blocks themselves if none lie aside."""
        if self.folding is None:
            return blocks
        return np.zeros((len(self.columns) + self.folding.shape[1], *blocks.shape[1:]))

    def fold(self, added: _Floats, blocks: _Floats) -> None:
        """Add what `unfold` has given, and elements have added to, to the blocks (B, d, d)."""
        if self.folding is None:
            return
        count = len(self.columns)
        blocks += added[:count]
        aside = added[count:].reshape(len(added) - count, -1)
        blocks += (self.folding @ aside).reshape(blocks.shape)

    @property
    def node_count(self) -> int:
        """Number of block rows."""
        return len(self.starts) - 1

    @cached_property
    def diagonal(self) -> _Ints:
        """(N,) the block on the diagonal of each row."""
        return _diagonal(self.starts, self.columns)

    @cached_property
    def mirror(self) -> _Ints:
        """(B,) of each block (i, j), the place of (j, i)."""
        return _mirror(self.starts, self.columns)

    def symmetric_product(self, blocks: _Floats, vector: _Floats, out: _Floats) -> None:
        """Write K v (N, d); blocks (B, d, d) below the diagonal are not read."""
        symmetric_product(self.starts, self.columns, self.diagonal, blocks, vector, out)

    def matrix(self, blocks: NDArray[np.float64]) -> bsr_array:
        """Return the matrix of the given blocks (B, d, d), without a copy."""
        size = self.node_count * blocks.shape[1]
        return bsr_array((blocks, self.columns, self.starts), shape=(size, size))


def block_pattern(cells: NDArray[np.int64], node_count: int) -> BlockPattern:
    """Sparsity of a mesh: nodes are coupled when a cell contains both.

    Parameters
    ----------
    cells : (p, c) int array
    node_count : int
        Every node must belong to a cell.

    Raises
    ------
    XfemError
        If cells are no rows of integers, have a node that does not exist, or leave one out.
    """
    if cells.ndim != 2 or not np.issubdtype(cells.dtype, np.integer):
        raise XfemError(
            f"cells: {cells.dtype} array of shape {cells.shape}; expected integers, (p, c)"
        )
    if cells.size and not 0 <= cells.min() <= cells.max() < node_count:
        raise XfemError(f"a cell has a node outside 0..{node_count - 1}")
    starts, columns, targets = _pattern(np.ascontiguousarray(cells), node_count)
    empty = np.flatnonzero(starts[1:] == starts[:-1])
    if len(empty):
        raise XfemError(f"node {empty[0]} belongs to no cell")
    return BlockPattern(starts, columns, targets)


@njit(cache=True)
def _pattern(cells, node_count):
    count, corners = cells.shape
    first = np.zeros(node_count + 1, dtype=np.int64)
    for cell in range(count):
        for a in range(corners):
            first[cells[cell, a] + 1] += 1
    for node in range(node_count):
        first[node + 1] += first[node]
    around = np.empty(first[node_count], dtype=np.int64)
    fill = first[:-1].copy()
    for cell in range(count):
        for a in range(corners):
            around[fill[cells[cell, a]]] = cell
            fill[cells[cell, a]] += 1

    starts = np.zeros(node_count + 1, dtype=np.int32)
    mark = np.full(node_count, -1, dtype=np.int64)
    columns = np.empty(corners * corners * count, dtype=np.int32)
    place = np.empty(node_count, dtype=np.int32)
    targets = np.empty((count, corners, corners), dtype=np.int32)
    used = 0
    for node in range(node_count):
        begin = used
        for k in range(first[node], first[node + 1]):
            for b in range(corners):
                other = cells[around[k], b]
                if mark[other] != node:
                    mark[other] = node
                    columns[used] = other
                    used += 1
        sort_short(columns[begin:used])
        starts[node + 1] = used
        for k in range(begin, used):
            place[columns[k]] = k
        for k in range(first[node], first[node + 1]):
            cell = around[k]
            for a in range(corners):
                if cells[cell, a] == node:
                    for b in range(corners):
                        targets[cell, a, b] = place[cells[cell, b]]
    return starts, columns[:used].copy(), targets


@njit(cache=True)
def _diagonal(starts, columns):
    place = np.empty(len(starts) - 1, dtype=np.int32)
    for node in range(len(place)):
        for k in range(starts[node], starts[node + 1]):
            if columns[k] == node:
                place[node] = k
    return place


@njit(cache=True)
def _mirror(starts, columns):
    # rows are met in ascending order, so each block is the next one in the row of its column
    following, place = starts[:-1].copy(), np.empty(len(columns), dtype=np.int32)
    for k in range(len(columns)):
        place[k] = following[columns[k]]
        following[columns[k]] += 1
    return place


@njit(cache=True)
def symmetric_product(starts, columns, diagonal, blocks, vector, out):
    """Write K v (N, d) to `out`; blocks (B, d, d) below the diagonal are not read."""
    space = vector.shape[1]
    out[:] = 0.0
    for row in range(len(diagonal)):
        for k in range(diagonal[row], starts[row + 1]):
            column = columns[k]
            for a in range(space):
                for b in range(space):
                    out[row, a] += blocks[k, a, b] * vector[column, b]
                    if column != row:
                        out[column, b] += blocks[k, a, b] * vector[row, a]
