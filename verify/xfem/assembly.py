"""Block pattern of a cut body, with couplings that no cell makes, and supports in its matrix.

Without aggregation it is that of the cells. With it a corner without an unknown of its own couples
all that it follows: the elements around such corners add to blocks of their own, from which
`BlockPattern.fold` takes them to those of the unknowns.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.xfem.block_pattern import BlockPattern, block_pattern
from verify.xfem.errors import XfemError
from verify.xfem.phantom import Aggregation, PhantomMesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_ROUND_OFF = 1e-14  # of the largest diagonal entry of a node


def body_pattern(phantom: PhantomMesh, couplings: _Ints | None = None) -> BlockPattern:
    """Sparsity of a body; its first cells are the pieces.

    Parameters
    ----------
    phantom : PhantomMesh
    couplings : (k, 2) int array, optional
        Further pairs of dof nodes that are to be coupled.
    """
    extra = np.empty((0, 2), dtype=np.int64) if couplings is None else couplings
    if phantom.aggregation is None:
        return block_pattern(_with_pairs(phantom.cells, extra), phantom.node_count)
    own = phantom.corner_node[phantom.cells]
    around = np.flatnonzero((own < 0).any(axis=1))
    nodes, weights = _followed(phantom.aggregation, phantom.cells[around])
    # a corner that follows others is represented by one of them
    own[around] = np.take_along_axis(nodes, np.abs(weights).argmax(axis=2)[:, :, None], 2)[:, :, 0]
    pairs = np.concatenate([extra, _pairs(nodes.reshape(len(around), -1), phantom.node_count)])
    plain = block_pattern(_with_pairs(own, pairs), phantom.node_count)
    count, corners = len(plain.columns), phantom.cells.shape[1]
    targets = plain.targets.copy()
    places = np.arange(len(around) * corners**2)
    targets[around] = count + places.reshape(-1, corners, corners)
    # entry (a, b) of the unknowns gets w_ia w_jb of the block (i, j) of a piece
    shape = (len(around), corners, corners, nodes.shape[2], nodes.shape[2])
    weight = (weights[:, :, None, :, None] * weights[:, None, :, None, :]).ravel()
    row = np.broadcast_to(nodes[:, :, None, :, None], shape).ravel()
    column = np.broadcast_to(nodes[:, None, :, None, :], shape).ravel()
    source = np.repeat(places, nodes.shape[2] ** 2)
    real = weight != 0.0
    at = pattern_places(plain, row[real], column[real])
    matrix = csr_array((weight[real], (at, source[real])), shape=(count, len(places)))
    return BlockPattern(plain.starts, plain.columns, targets, matrix)


def _followed(aggregation: Aggregation, cells: _Ints) -> tuple[_Ints, _Floats]:
    """Dof nodes (q, c, m) and weights of the corners of some pieces, padded with weight 0."""
    starts = aggregation.extension.indptr
    count = np.diff(starts)[cells]
    most = count.max(initial=1)
    within = np.minimum(np.arange(most), count[:, :, None] - 1)
    at = starts[cells][:, :, None] + within
    nodes = aggregation.extension.indices[at].astype(np.int64)
    weights = np.where(np.arange(most) < count[:, :, None], aggregation.extension.data[at], 0.0)
    return nodes, weights


def _pairs(nodes: _Ints, count: int) -> _Ints:
    """All pairs (k, 2) of different nodes in a row of `nodes` (q, m), each once."""
    first, second = np.triu_indices(nodes.shape[1], 1)
    pairs = np.sort(np.stack([nodes[:, first].ravel(), nodes[:, second].ravel()]), axis=0)
    key = np.unique(pairs[0] * count + pairs[1])
    pairs = np.stack([key // count, key % count], axis=1)
    return pairs[pairs[:, 0] != pairs[:, 1]]


def _with_pairs(cells: _Ints, pairs: _Ints) -> _Ints:
    if len(pairs) == 0:
        return cells
    return np.concatenate([cells, pairs[:, [0] + [1] * (cells.shape[1] - 1)]])


def pattern_places(pattern: BlockPattern, rows: _Ints, columns: _Ints) -> _Ints:
    """Blocks at the given rows and columns.

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


def find_places(
    pattern: BlockPattern, rows: _Ints, columns: _Ints
) -> tuple[_Ints, NDArray[np.bool_]]:
    """Blocks at the given rows and columns, and whether the pattern has them."""
    of_row = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    keys = of_row * pattern.node_count + pattern.columns
    wanted = rows * pattern.node_count + columns
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    return at, keys[at] == wanted


def add_mass(blocks: _Floats, places: _Ints, values: _Floats, scale: float) -> None:
    """Add `scale` times the mass to the diagonals of its nodal blocks."""
    for component in range(blocks.shape[1]):
        blocks[places, component, component] += scale * values


def held_entries(pattern: BlockPattern, fixed: NDArray[np.bool_]) -> _Ints:
    """Entries of the blocks, flat, in rows and columns of fixed components, but the diagonal's."""
    rows = np.repeat(np.arange(len(fixed)), np.diff(pattern.starts))
    some = fixed.any(axis=1)
    at = np.flatnonzero(some[rows] | some[pattern.columns])
    held = fixed[rows[at]][:, :, None] | fixed[pattern.columns[at]][:, None, :]
    held[rows[at] == pattern.columns[at]] &= ~np.eye(fixed.shape[1], dtype=bool)
    block, entry = np.nonzero(held.reshape(len(at), fixed.shape[1] ** 2))
    return at[block] * fixed.shape[1] ** 2 + entry


def constrain(
    pattern: BlockPattern, fixed: NDArray[np.bool_], blocks: _Floats, held: _Ints | None = None
) -> None:
    """Decouple the fixed components: zero their rows and columns but for the diagonal.

    Parameters
    ----------
    pattern : BlockPattern
    fixed : (N, d) bool array
    blocks : (B, d, d) float array
        Changed in place; the diagonal entries stay, so that scaling stays meaningful, but for
        those that are not positive (zero or its round-off across a flat membrane, less than that
        across a compressed one), which become one.
    held : (k,) int array, optional
        From `held_entries`, if that is known.
    """
    blocks.reshape(-1)[held_entries(pattern, fixed) if held is None else held] = 0.0
    nodes, axes = np.nonzero(fixed)
    own = np.einsum("nkk->nk", blocks[pattern.diagonal[nodes]])
    least = _ROUND_OFF * own.max(axis=1, initial=0.0)
    none = own[np.arange(len(nodes)), axes] <= least
    blocks[pattern.diagonal[nodes[none]], axes[none], axes[none]] = 1.0
