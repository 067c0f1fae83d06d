"""Sparsity of nodal blocks, where each element block goes, and supports in the matrix."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array

from verify.compiled import njit
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.phantom import PhantomMesh

_Places = NDArray[np.int32]
_ROUND_OFF = 1e-14  # of the largest diagonal entry of a node


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
        Block of `corners` to which the pair (row corner, column corner) of each cell adds.
    """

    starts: _Places
    columns: _Places
    targets: _Places

    @property
    def corners(self) -> "BlockPattern":
        """Sparsity of the corners of cells: this one, unless some corners follow others."""
        return self

    def unfold(self, blocks: Floats) -> Floats:
        """Return an array for the blocks of `corners`: the given one, or zeros for others."""
        return blocks

    def fold(self, added: Floats, blocks: Floats) -> None:
        """Add what elements have added to the array of `unfold` to the blocks (B, d, d).

        Here that array is the blocks themselves: nothing is left to do.
        """

    @property
    def node_count(self) -> int:
        """Number of block rows."""
        return len(self.starts) - 1

    @cached_property
    def diagonal(self) -> _Places:
        """(N,) the block on the diagonal of each row."""
        rows = np.repeat(np.arange(self.node_count), np.diff(self.starts))
        return np.flatnonzero(rows == self.columns).astype(np.int32)

    @cached_property
    def mirror(self) -> _Places:
        """(B,) of each block (i, j), the place of (j, i)."""
        return np.asarray(order_by_counting(self.columns, self.node_count))

    def matrix(self, blocks: Floats) -> bsr_array:
        """Return the matrix of the given blocks (B, d, d), without a copy."""
        size = self.node_count * blocks.shape[1]
        return bsr_array((blocks, self.columns, self.starts), shape=(size, size))


def block_pattern(cells: Ints, node_count: int) -> BlockPattern:
    """Make the sparsity of a mesh: nodes are coupled when a cell contains both.

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
    around, corner = np.divmod(order_by_counting(cells.ravel(), node_count), cells.shape[1])
    return BlockPattern(*_pattern(np.ascontiguousarray(cells), first, around, corner))


@njit(cache=True)
def _pattern(cells, first, around, corner):
    """Make rows, columns and targets; cells of node n, and its corner, come from first[n] on."""
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
            for b in range(corners):
                targets[around[k], corner[k], b] = place[cells[around[k], b]]
    return starts, columns, targets


@njit(cache=True)
def order_by_counting(keys, count):
    """Sort keys in 0…count − 1 stably, by counting."""
    fill, order = np.zeros(count + 1, dtype=np.int64), np.empty(len(keys), dtype=np.int32)
    for key in keys:
        fill[key + 1] += 1
    fill = np.cumsum(fill)
    for k in range(len(keys)):
        order[fill[keys[k]]] = k
        fill[keys[k]] += 1
    return order


def body_pattern(phantom: PhantomMesh, couplings: Ints | None = None) -> BlockPattern:
    """Make the sparsity of a body; its first cells are the pieces.

    Parameters
    ----------
    phantom : PhantomMesh
    couplings : (k, 2) int array, optional
        Further pairs of dof nodes that are to be coupled.
    """
    extra = np.empty((0, 2), dtype=np.int64) if couplings is None else couplings
    if phantom.aggregation is not None:
        found: BlockPattern = phantom.aggregation.pattern(extra)
        return found
    return block_pattern(_with_pairs(phantom.cells, extra), phantom.node_count)


def _with_pairs(cells: Ints, pairs: Ints) -> Ints:
    """Append for each pair (i, j) a cell [i, j, j, …], which couples the two nodes."""
    if len(pairs) == 0:
        return cells
    return np.concatenate([cells, pairs[:, [0] + [1] * (cells.shape[1] - 1)]])


def pattern_places(pattern: BlockPattern, rows: Ints, columns: Ints) -> Ints:
    """Find blocks (k,) at the given rows (k,) and columns (k,).

    Raises
    ------
    XfemError
        If the pattern lacks one.
    """
    at, found = find_places(pattern, rows, columns)
    if not found.all():
        raise XfemError(
            "the pattern lacks couplings of this mass or penalty; expected that of the body"
        )
    return at


def find_places(pattern: BlockPattern, rows: Ints, columns: Ints) -> tuple[Ints, Bools]:
    """Find blocks (k,) at given rows and columns (k,), and whether the pattern has them (k,)."""
    of_row = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    keys = of_row * pattern.node_count + pattern.columns
    wanted = rows * pattern.node_count + columns
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return at, keys[at] == wanted


def add_mass(blocks: Floats, places: Ints | slice, values: Floats, scale: float) -> None:
    """Add `scale` times mass entries (k,) to the diagonals of the nodal blocks at `places` (k,)."""
    added = scale * values
    for component in range(blocks.shape[1]):
        blocks[places, component, component] += added


def held_entries(pattern: BlockPattern, fixed: Bools) -> Ints:
    """Find entries (k,) of the blocks, flattened, in rows and columns of fixed components (N, d).

    Entries on the diagonal of the matrix are left out.
    """
    some = fixed.any(axis=1)
    # rows and columns of a node have as many blocks
    most = 2 * int(np.diff(pattern.starts)[some].sum()) * fixed.shape[1] ** 2
    return np.asarray(_held_entries(pattern.starts, pattern.columns, fixed, some, most))


@njit(cache=True)
def _held_entries(starts, columns, fixed, some, most):
    held, count, d = np.empty(most, dtype=np.int64), 0, fixed.shape[1]
    for node in range(len(fixed)):
        for at in range(starts[node], starts[node + 1]):
            other = columns[at]
            if some[node] or some[other]:
                for k in range(d):
                    for l in range(d):
                        if (fixed[node, k] or fixed[other, l]) and (node != other or k != l):
                            held[count] = (at * d + k) * d + l
                            count += 1
    return held[:count]


def constrain(
    pattern: BlockPattern, fixed: Bools, blocks: Floats, held: Ints | None = None
) -> None:
    """Decouple the fixed components: zero their rows and columns except the diagonal.

    Parameters
    ----------
    pattern : BlockPattern
    fixed : (N, d) bool array
    blocks : (B, d, d) float array
        Changed in place. Positive diagonal entries stay, so that scaling stays meaningful. Those
        that are zero or negative, as across a flat or compressed membrane, become one.
    held : (k,) int array, optional
        From `held_entries`, if that is known.
    """
    nodes, axes = np.nonzero(fixed)
    if not len(nodes):
        return
    blocks.reshape(-1)[held_entries(pattern, fixed) if held is None else held] = 0.0
    own = np.einsum("nkk->nk", blocks[pattern.diagonal[nodes]])
    least = _ROUND_OFF * own.max(axis=1, initial=0.0)
    none = own[np.arange(len(nodes)), axes] <= least
    blocks[pattern.diagonal[nodes[none]], axes[none], axes[none]] = 1.0
