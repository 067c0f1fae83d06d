"""The sparsity of nodal blocks, and where each element block goes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from verify.xfem.errors import XfemError

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
    corners = cells.shape[1]
    rows, columns = np.repeat(cells, corners, axis=1).ravel(), np.tile(cells, corners).ravel()
    order = _order(columns, node_count)
    order = order[_order(rows[order], node_count)]
    rows, columns = rows[order], columns[order]
    is_first = (np.diff(rows, prepend=-1) != 0) | (np.diff(columns, prepend=-1) != 0)
    starts = np.searchsorted(rows[is_first], np.arange(node_count + 1))
    empty = np.flatnonzero(starts[1:] == starts[:-1])
    if len(empty):
        raise XfemError(f"node {empty[0]} belongs to no cell")
    targets = np.empty(len(order), dtype=np.int32)
    targets[order] = np.cumsum(is_first) - 1
    return BlockPattern(
        starts.astype(np.int32), columns[is_first].astype(np.int32),
        targets.reshape(len(cells), corners, corners),
    )  # fmt: skip


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
