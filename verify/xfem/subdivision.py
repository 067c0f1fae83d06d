"""The cut body as a conforming mesh, for programs that know no enrichment.

Whole cells, and the sub-simplices of split ones; nodes are doubled where the displacement jumps,
and only there. Cells beside the end of a cut are bisected at the points where the cut meets their
edges, so that no hanging node is left. The piecewise linear field on this mesh is the XFEM
field itself, not an interpolation of it.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from verify.xfem.arrays import Floats, Ints
from verify.xfem.clip import Simplices, bisected
from verify.xfem.mesh import equal_rows, facets_of
from verify.xfem.phantom import PhantomMesh


@dataclass(frozen=True)
class Subdivision:
    """A conforming mesh of the cut body and the map of displacements onto it.

    Attributes
    ----------
    points : (k, d) float array
        Material positions, doubled on the cut, in metres.
    cells : (c, d + 1) int array
        Simplices; positively oriented where they fill the space.
    cell_piece : (c,) int array
        Piece (cut-cell part) that holds each.
    cell_parent : (c,) int array
        Cell of the uncut mesh that holds each.
    interpolation : (k, N) sparse array
        Displacement at the points = interpolation @ displacement of the dof nodes.
    cut_facets : (f, d, d) float array
        The cut as realised: segments or triangles by their corners (second axis), in metres.
    """

    points: Floats
    cells: Ints
    cell_piece: Ints
    cell_parent: Ints
    interpolation: csr_array
    cut_facets: Floats


def subdivide(phantom: PhantomMesh) -> Subdivision:
    """Make the conforming sub-division of a cut mesh.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> body = xfem.subdivide(phantom)
    >>> len(body.cells), len(body.cut_facets)
    (48, 8)
    """
    if phantom.aggregation is not None:
        divided = subdivide(phantom.corners)
        interpolation = csr_array(divided.interpolation @ phantom.aggregation.extension)
        return replace(divided, interpolation=interpolation)
    mesh, zero = phantom.mesh, phantom.sub_cells.zero_points
    simplices = _conforming(phantom)
    piece, ids, barycentric = simplices.piece, simplices.points, simplices.barycentric

    # u(z) = Σ_i λ_i(z) u_i: a mesh node moves with one unknown, a point of the cut with the
    # unknowns of its edge
    unknowns = phantom.cells[piece]
    row, corner = np.nonzero(ids >= len(mesh.points))
    node = np.take_along_axis(unknowns, barycentric.argmax(axis=2), axis=1)
    weights, columns = barycentric[row, corner], unknowns[row]
    support = np.sort(np.where(weights != 0.0, columns, -1), axis=1)
    keys = np.concatenate([ids[row, corner][:, None], support], axis=1)
    _, first, number = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    node[row, corner] = phantom.node_count + number.ravel()
    used, cells = np.unique(node, return_inverse=True)
    cells = cells.reshape(node.shape)
    nodes = used[used < phantom.node_count]

    corners = ids.shape[1]
    starts = np.concatenate(
        [np.arange(len(nodes)), len(nodes) + corners * np.arange(len(first) + 1)]
    )
    interpolation = csr_array(
        (
            np.concatenate([np.ones(len(nodes)), weights[first].ravel()]),
            np.concatenate([nodes, columns[first].ravel()]),
            starts,
        ),
        shape=(len(used), phantom.node_count),
    )
    interpolation.eliminate_zeros()
    cut_points = zero.positions[ids[row, corner][first]]
    points = np.concatenate([phantom.node_points[nodes], cut_points])
    return Subdivision(
        points=points,
        cells=_oriented(points, cells),
        cell_piece=piece,
        cell_parent=phantom.parent[piece],
        interpolation=interpolation,
        cut_facets=points[torn_facets(cells, ids)[0][:, 1]],
    )


def extrapolation(phantom: PhantomMesh, body: Subdivision) -> csr_array:
    """Make the sparse map (N, k) of a displacement at the points back to the dof nodes.

    It is exact for fields that `body.interpolation` has put on the points. A dof node that is no
    point, because it lies beyond the cut, follows from the largest cell of one of its pieces.
    """
    interpolation = csr_array(body.interpolation)
    alone = np.flatnonzero(np.diff(interpolation.indptr) == 1)
    alone = alone[interpolation.data[interpolation.indptr[alone]] == 1.0]
    known, first = np.unique(interpolation.indices[interpolation.indptr[alone]], return_index=True)
    point = alone[first]
    unknown = np.ones(phantom.node_count, dtype=bool)
    unknown[known] = False

    own = phantom.cells[body.cell_piece]
    beyond = np.flatnonzero(unknown[own].any(axis=1))
    nodes, dofs = body.cells[beyond], own[beyond]
    shape = (*dofs.shape, dofs.shape[1])
    rows = np.broadcast_to(nodes[:, :, None], shape).ravel()
    columns = np.broadcast_to(dofs[:, None, :], shape).ravel()
    shares = np.zeros(shape)
    if len(beyond):  # of no entries SciPy returns a matrix
        shares[:] = interpolation[rows, columns].reshape(shape)
    # in each cell u(z_k) = Σ_i λ_i(z_k) u_i, hence u_i = Σ_k (Λ⁻¹)_ik u(z_k)
    cell, local = np.nonzero(unknown[dofs])
    order = np.argsort(np.abs(np.linalg.det(shares))[cell], kind="stable")
    largest = np.full(phantom.node_count, -1)
    largest[dofs[cell, local][order]] = order  # of several the last: the largest cell
    chosen = largest[largest >= 0]
    cell, local = cell[chosen], local[chosen]
    back = np.linalg.inv(shares[cell])[np.arange(len(cell)), local]
    entries = np.concatenate([np.ones(len(known)), back.ravel()])
    rows = np.concatenate([known, np.repeat(dofs[cell, local], shape[1])])
    columns = np.concatenate([point, nodes[cell].ravel()])
    return csr_array((entries, (rows, columns)), shape=interpolation.shape[::-1])


def _conforming(phantom: PhantomMesh) -> Simplices:
    """Bisect solid simplices where a neighbour has a point that they do not have."""
    sub, mesh = phantom.sub_cells, phantom.mesh
    whole = np.flatnonzero(~phantom.split)
    sign = np.ones(len(sub.piece), dtype=np.int8)  # not read: `_oriented` has positions
    simplices = Simplices.of_cells(whole, mesh.cells[phantom.parent[whole]])
    simplices += Simplices(sub.piece, sub.points, sub.barycentric, sub.fraction, sign)
    used = np.unique(sub.points)
    hanging = used[used >= len(mesh.points)] - len(mesh.points)
    return bisected(simplices, sub.zero_points, hanging)


def _oriented(points: Floats, cells: Ints) -> Ints:
    """Orient cells positively, where points and simplices have the same dimension."""
    if points.shape[1] != cells.shape[1] - 1:
        return cells
    corners = points[cells]
    flipped = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0.0
    turned = cells.copy()
    turned[flipped, 0], turned[flipped, 1] = cells[flipped, 1], cells[flipped, 0]
    return turned


def torn_facets(cells: Ints, places: Ints) -> tuple[Ints, Ints]:
    """Find facets where two simplices meet in space but do not share their nodes.

    Parameters
    ----------
    cells : (c, d + 1) int array
        Nodes of the simplices.
    places : (c, d + 1) int array
        Equal numbers for nodes at the same place.

    Returns
    -------
    nodes : (f, 2, d) int array
        Of each facet as its two simplices have them; nodes at the same place are in the same
        column.
    beside : (f, 2) int array
        The two simplices.
    """
    # a point is doubled when it has several nodes: its first one is not the only one
    some = np.zeros(places.max() + 1, dtype=np.int64)
    some[places] = cells
    doubled = np.zeros(len(some), dtype=bool)
    doubled[places[some[places] != cells]] = True
    rows = np.flatnonzero(doubled[places].any(axis=1))
    facets, nodes = facets_of(places[rows]), facets_of(cells[rows])
    order = np.argsort(facets, axis=1)
    facets = np.take_along_axis(facets, order, axis=1)
    nodes = np.take_along_axis(nodes, order, axis=1)
    pairs = np.stack(equal_rows(facets), axis=1)
    pairs = pairs[(nodes[pairs[:, 0]] != nodes[pairs[:, 1]]).any(axis=1)]
    return nodes[pairs], rows[pairs // cells.shape[1]]
