"""Cell aggregation: nodes that only slivers use follow the linear field of a root cell.

Badia, Verdugo & Martín, *The aggregated unfitted finite element method for elliptic problems*,
Comput. Methods Appl. Mech. Engrg. 336 (2018), applied to pieces. A *root* is a piece that is not
small. A small piece reaches its root through faces, from neighbour to neighbour on its own side of
all cuts. The field stays continuous on each side. Every affine field stays in the space, so patch
tests hold and rigid motion costs nothing. In the paper a node follows the root of the one cell that
owns it. Here it follows, among the roots of all small pieces around it, the one with the shortest
extrapolation. And a small piece that reaches no root keeps its unknowns.

The *reach* of a point is Σ|λ_i|, λ its barycentric coordinates in the root: the norm of the
extrapolation to it. It is one inside the root and grows with the distance.

Values at the corners of the pieces are u = C û, with û at the dof nodes. Elements give force f,
stiffness K and mass M at the corners. The dof nodes have f̂ = Cᵀf(C û), K̂ = CᵀKC and M̂ = CᵀMC.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.block_pattern import BlockPattern, block_pattern
from verify.xfem.contacts import extension_of, face_contacts, renumber
from verify.xfem.mass import Mass
from verify.xfem.phantom import PhantomMesh

_ROUND_OFF = 1e-12  # of a barycentric coordinate; of positions, over the size of the cell
_DIGITS = 9  # to which extrapolations are compared: symmetric meshes have many that are equal


@dataclass(frozen=True)
class Aggregation:
    """Corners of a cut mesh that have no unknown of their own, u = C û.

    Attributes
    ----------
    corners : PhantomMesh
        The same body with a dof node for each corner.
    extension : (N_corners, N) csr_array
        C; it reproduces linear fields.
    node : (N_corners,) int array
        Dof node of each corner; −1 for one that follows others.
    """

    corners: PhantomMesh
    extension: csr_array
    node: Ints

    @cached_property
    def restriction(self) -> csr_array:
        """(N, N_corners) Cᵀ."""
        return csr_array(self.extension.T)

    def mass(self, of_corners: Mass) -> "AggregatedMass":
        """Make the mass CᵀMC."""
        matrix = csr_array(self.restriction @ of_corners.matrix @ self.extension)
        matrix.sum_duplicates()
        weights = self.restriction @ of_corners.weights
        return AggregatedMass(matrix, None, weights, of_corners, self)

    def pattern(self, couplings: Ints) -> "AggregatedPattern":
        """Make the sparsity of CᵀKC, with further couplings (k, 2) of dof nodes.

        From K̂_ij = Σ C_ai C_bj K_ab, block by block. The corner block (a, b) adds to every block
        (i, j) such that corner a follows node i and corner b follows node j.
        """
        C, corners = self.extension, self.corners
        of_corners = block_pattern(corners.cells, corners.node_count)
        a = np.repeat(np.arange(corners.node_count), np.diff(of_corners.starts))
        b, followed = of_corners.columns, np.diff(C.indptr)
        terms = followed[a] * followed[b]
        source = np.repeat(np.arange(len(b)), terms)
        number = np.arange(len(source)) - np.repeat(np.cumsum(terms) - terms, terms)
        a, b = a[source], b[source]
        in_a, in_b = C.indptr[a] + number // followed[b], C.indptr[b] + number % followed[b]
        count = C.shape[1]
        pairs = C.indices[in_a] * np.int64(count) + C.indices[in_b]
        first, second = couplings.T
        more = np.concatenate([first * count + second, second * count + first])
        keys = np.unique(np.concatenate([pairs, more]))
        starts = np.searchsorted(keys, np.arange(count + 1) * count).astype(np.int32)
        folding = csr_array(
            (C.data[in_a] * C.data[in_b], (np.searchsorted(keys, pairs), source)),
            shape=(len(keys), len(of_corners.columns)),
        )
        columns = (keys % count).astype(np.int32)
        return AggregatedPattern(starts, columns, of_corners.targets, of_corners, folding)


@dataclass(frozen=True)
class AggregatedPattern(BlockPattern):
    """Sparsity of CᵀKC.

    Attributes
    ----------
    of_corners : BlockPattern
        Sparsity of K.
    folding : (B, B_corners) csr_array
        Share of each block of K in each block of CᵀKC.
    """

    of_corners: BlockPattern
    folding: csr_array

    @property
    def corners(self) -> BlockPattern:
        """Sparsity of K, to which elements add."""
        return self.of_corners

    def unfold(self, blocks: Floats) -> Floats:
        """Return zero blocks of K."""
        return np.zeros((self.folding.shape[1], *blocks.shape[1:]))

    def fold(self, added: Floats, blocks: Floats) -> None:
        """Add CᵀKC to the blocks (B, d, d), from the blocks of K."""
        blocks += (self.folding @ added.reshape(len(added), -1)).reshape(blocks.shape)


@dataclass(frozen=True)
class AggregatedMass(Mass):
    """CᵀMC: the mass of the corners on unknowns that some of them follow, u = C û.

    It couples the unknowns of root cells that others follow, and is diagonal elsewhere if M is.
    Lumping it would lose the bound of the explicit step: K ≤ ω²M implies CᵀKC ≤ ω²CᵀMC, and nothing
    for other masses.

    Attributes
    ----------
    of_corners : Mass
        M.
    aggregation : Aggregation
    """

    of_corners: Mass
    aggregation: Aggregation

    @property
    def keeps_element_steps(self) -> bool:
        """Whether the step of the smallest uncut element is stable, whatever the cuts."""
        return self.of_corners.keeps_element_steps


def aggregate(
    phantom: PhantomMesh, small: Bools, supported: Bools
) -> tuple[PhantomMesh, Bools, Bools]:
    """Let nodes that only small pieces use follow root cells.

    Parameters
    ----------
    phantom : PhantomMesh
        Without aggregation.
    small : (p,) bool array
    supported : (N,) bool array
        Dof nodes of supports, which keep their unknown.

    Returns
    -------
    aggregated : PhantomMesh
        `phantom` itself if no node follows a root.
    following : (p,) bool array
        Small pieces with a node that follows a root cell.
    rootless : (p,) bool array
        Small pieces with a node that only small pieces use, and that follows none.
    """
    alone = np.ones(phantom.node_count, dtype=bool)
    alone[phantom.cells[~small]] = False
    alone &= ~supported
    sliver, root = _reached(phantom, small)
    node, weights, cell = _continued(phantom, alone, sliver, root)
    followed = np.full(phantom.node_count, -1)
    followed[node] = np.arange(len(node))
    of_corner = followed[phantom.cells]
    has_own = (alone[phantom.cells] & (of_corner < 0)).any(axis=1)
    following, rootless = small & (of_corner >= 0).any(axis=1), small & has_own
    if len(node) == 0:
        return phantom, following, rootless
    return _aggregated(phantom, followed, weights, cell), following, rootless


def _reached(phantom: PhantomMesh, small: Bools) -> tuple[Ints, Ints]:
    """Find pairs (k,), (k,) of small pieces and a root each, layer by layer away from the roots.

    Among the roots of its neighbours one layer closer, a piece takes the one with the least reach
    to its own corners.
    """
    contacts = face_contacts(phantom, near=True)
    first, second = np.concatenate(contacts), np.concatenate(contacts[::-1])
    into = np.where(small, -1, np.arange(len(small)))
    while True:
        meets = (into[first] < 0) & (into[second] >= 0)
        one, root = first[meets], into[second[meets]]
        if len(one) == 0:
            found = np.flatnonzero(small & (into >= 0))
            return found, into[found]
        corners = phantom.mesh.points[phantom.mesh.cells[phantom.parent[one]]]
        reach = np.abs(_coordinates(phantom, corners, root)).sum(axis=2).max(axis=1)
        best = _best(phantom, one, root, reach)
        into[one[best]] = root[best]


def _best(phantom: PhantomMesh, key: Ints, root: Ints, reach: Floats) -> Ints:
    """Choose a row for each key: its root has the least reach, then the largest size."""
    place = phantom.piece_centroids[root]
    place = np.round(place / phantom.mesh.extent, _DIGITS)
    size = np.round(phantom.fraction[root], _DIGITS)
    order = np.lexsort([*place.T, -size, np.round(reach, _DIGITS), key])
    return order[np.diff(key[order], prepend=-1) != 0]


def _coordinates(phantom: PhantomMesh, points: Floats, root: Ints) -> Floats:
    """Compute barycentric coordinates (q, k, d + 1) of points (q, k, space) in the roots."""
    mesh, cell = phantom.mesh, phantom.parent[root]
    origin = mesh.points[mesh.cells[cell, 0]]
    at = np.einsum("qks,qis->qki", points - origin[:, None], mesh.gradients[cell])
    at[:, :, 0] += 1.0
    return at


def _continued(
    phantom: PhantomMesh, alone: Bools, sliver: Ints, root: Ints
) -> tuple[Ints, Floats, Ints]:
    """Find nodes (k,) that follow a root, weights (k, d + 1) of its corners, and the root (k,).

    Off the plane of the root triangle of a membrane there is no such field; nodes there follow
    none.
    """
    row, corner = np.nonzero(alone[phantom.cells[sliver]])
    node, root = phantom.cells[sliver[row], corner], root[row]
    points = phantom.node_points[node][:, None]
    weights = _coordinates(phantom, points, root)[:, 0]
    weights[np.abs(weights) < _ROUND_OFF] = 0.0
    largest = np.abs(weights).argmax(axis=1)[:, None]
    rest = weights.sum(axis=1, keepdims=True) - np.take_along_axis(weights, largest, 1)
    np.put_along_axis(weights, largest, 1.0 - rest, 1)
    mesh = phantom.mesh
    if mesh.is_membrane:
        corners = mesh.points[mesh.cells[phantom.parent[root]]]
        off = np.linalg.norm(np.einsum("qi,qis->qs", weights, corners) - points[:, 0], axis=1)
        flat = off <= _ROUND_OFF * mesh.extent
        node, root, weights = node[flat], root[flat], weights[flat]
    best = _best(phantom, node, root, np.abs(weights).sum(axis=1))
    return node[best], weights[best], root[best]


def _aggregated(phantom: PhantomMesh, followed: Ints, weights: Floats, root: Ints) -> PhantomMesh:
    """Return the mesh without the unknowns of nodes that follow others."""
    own = followed < 0
    node_parent, node = renumber(phantom, own)
    gone = np.flatnonzero(~own)
    at = followed[gone]
    extension = extension_of(node, gone, node[phantom.cells[root[at]]], weights[at])
    return replace(
        phantom,
        node_parent=node_parent,
        aggregation=Aggregation(phantom, extension, node),
    )
