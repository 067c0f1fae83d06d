"""The sparsity of nodal blocks, and where each element block goes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from verify.xfem.errors import XfemError

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
        rows = np.repeat(np.arange(self.node_count), np.diff(self.starts))
        return np.flatnonzero(rows == self.columns).astype(np.int32)

    @cached_property
    def mirror(self) -> _Ints:
        """(B,) of each block (i, j), the place of (j, i)."""
        return _order(self.columns, self.node_count)

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
    counts = np.bincount(cells.ravel(), minlength=node_count)
    if not counts.all():
        raise XfemError(f"node {int(np.argmin(counts > 0))} belongs to no cell")
    first = np.concatenate([[0], np.cumsum(counts)])
    around = _order(cells.ravel(), node_count) // cells.shape[1]
    return BlockPattern(*_pattern(np.ascontiguousarray(cells), first, around))


@njit(cache=True)
def _pattern(cells, first, around):
    """Rows, columns and targets; `around` holds the cells of node n from first[n] on."""
    (count, corners), nodes = cells.shape, len(first) - 1
    mark, used = np.full(nodes, -1), 0
    starts = np.zeros(nodes + 1, dtype=np.int32)
    found = np.empty(corners * corners * count, dtype=np.int32)
    for node in range(nodes):
        for k in range(first[node], first[node + 1]):
            for b in range(corners):
                other = cells[around[k], b]
                if mark[other] != node:
                    mark[other], found[used] = node, other
                    used += 1
        starts[node + 1] = used
    # the pattern is symmetric: nodes that enter the rows of others one by one come in order
    columns, fill = np.empty(used, dtype=np.int32), starts[:-1].copy()
    for node in range(nodes):
        for k in range(starts[node], starts[node + 1]):
            columns[fill[found[k]]] = node
            fill[found[k]] += 1
    place = np.empty(nodes, dtype=np.int32)
    targets = np.empty((count, corners, corners), dtype=np.int32)
    for node in range(nodes):
        for k in range(starts[node], starts[node + 1]):
            place[columns[k]] = k
        for k in range(first[node], first[node + 1]):
            for a in range(corners):
                if cells[around[k], a] == node:
                    for b in range(corners):
                        targets[around[k], a, b] = place[cells[around[k], b]]
    return starts, columns, targets


def _order(keys: NDArray, count: int) -> _Ints:
    """Stable order of keys in 0…count − 1: a transposition counts, and does not compare."""
    rows = np.arange(len(keys) + 1)
    matrix = csr_array((np.zeros(len(keys), np.int8), keys, rows), shape=(len(keys), count))
    order: _Ints = matrix.tocsc().indices.astype(np.int32)
    return order


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
