"""Cell aggregation: nodes that only slivers use follow the linear field of a root cell.

Badia, Verdugo & Martín, *The aggregated unfitted finite element method for elliptic problems*,
Comput. Methods Appl. Mech. Engrg. 336 (2018), for the pieces of a body: a piece that is small
reaches a root, a piece that is not, through the faces that it shares with its neighbours on its
own side of all cuts. The field stays continuous on each side and every affine field stays in
the space, so that patch tests hold and rigid motion costs nothing. Differences: there a node
follows the root of the one cell that owns it; here, of the roots of all small pieces around it,
the one that continues its field over the shortest way. And a small piece that reaches no root keeps
its unknowns.

How far a field is continued to a point is measured by its *reach*, Σ|λ_i| of the barycentric
coordinates λ of the point in the root: one inside, the larger the farther away, and the norm of the
extrapolation.
"""

from dataclasses import replace

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.contacts import extension_of, face_contacts, renumber
from verify.xfem.phantom import Aggregation, PhantomMesh

_ROUND_OFF = 1e-12  # of a barycentric coordinate; of positions, over the size of the cell
_DIGITS = 9  # to which extrapolations are compared: symmetric meshes have many that are equal


def aggregate(phantom: PhantomMesh, small: Bools, held: Bools) -> tuple[PhantomMesh, Bools, Bools]:
    """Let nodes that only small pieces use follow root cells.

    Parameters
    ----------
    phantom : PhantomMesh
        Without aggregation.
    small : (p,) bool array
    held : (N,) bool array
        Dof nodes that keep their unknown, such as those that a support holds.

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
    alone &= ~held
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
    """Pairs (k,), (k,) of small pieces and a root each, layer by layer away from the roots.

    A piece takes the root from which its own corners are continued over the shortest way, among
    those of its neighbours one layer closer.
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
    """Row of the best root for each key: least reach, then largest, then by place."""
    place = phantom.piece_centroids[root]
    place = np.round(place / phantom.mesh.extent, _DIGITS)
    size = np.round(phantom.fraction[root], _DIGITS)
    order = np.lexsort([*place.T, -size, np.round(reach, _DIGITS), key])
    return order[np.diff(key[order], prepend=-1) != 0]


def _coordinates(phantom: PhantomMesh, points: Floats, root: Ints) -> Floats:
    """(q, k, d + 1) barycentric coordinates of points (q, k, space) in the cells of the roots."""
    mesh, cell = phantom.mesh, phantom.parent[root]
    origin = mesh.points[mesh.cells[cell, 0]]
    at = np.einsum("qks,qis->qki", points - origin[:, None], mesh.gradients[cell])
    at[:, :, 0] += 1.0
    return at


def _continued(
    phantom: PhantomMesh, alone: Bools, sliver: Ints, root: Ints
) -> tuple[Ints, Floats, Ints]:
    """Nodes (k,) that follow a root, weights (k, d + 1) of its corners, and the root (k,).

    Off the plane of the root triangle of a membrane there is no such field: nodes there are left
    alone.
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
    if mesh.dim < mesh.space:
        corners = mesh.points[mesh.cells[phantom.parent[root]]]
        off = np.linalg.norm(np.einsum("qi,qis->qs", weights, corners) - points[:, 0], axis=1)
        flat = off <= _ROUND_OFF * mesh.extent
        node, root, weights = node[flat], root[flat], weights[flat]
    best = _best(phantom, node, root, np.abs(weights).sum(axis=1))
    return node[best], weights[best], root[best]


def _aggregated(phantom: PhantomMesh, followed: Ints, weights: Floats, root: Ints) -> PhantomMesh:
    """Return the mesh without the unknowns of nodes that follow others."""
    own = followed < 0
    node_parent, node, old_of_new = renumber(phantom, own)
    gone = np.flatnonzero(~own)
    at = followed[gone]
    extension = extension_of(node, gone, node[phantom.cells[root[at]]], weights[at])
    return replace(
        phantom,
        node_parent=node_parent,
        node_side=phantom.node_side[old_of_new],
        aggregation=Aggregation(phantom, extension, node),
    )
