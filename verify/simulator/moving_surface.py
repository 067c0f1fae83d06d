"""Surfaces that move with a cut body, x = X + W u; the surface of the material itself.

Every vertex belongs to one piece: its weights are its barycentric coordinates in the parent
element, its nodes the dof nodes of the piece (barycentric mapping, thesis 3.2.2). Forces go back by
the transpose, so that their virtual work on the surface and in the solver is the same.

The surface of the material itself is the mesh's own boundary, split, and the faces of the cuts.
Each piece's share of it closes around the material. It has facets on the boundary of the mesh, and
inner facets from the polygons in which cuts cross elements (thesis 3.2.4). They are oriented
outwards. Vertices are doubled where, and only where, the material is separate. A membrane is its
own surface, with two new rims along a cut instead of inner facets.
"""

from collections.abc import Callable
from copy import copy

import numpy as np
from numba import njit

from verify.simulator.exposed_kernels import cut_elements, exposed_facets, sub_simplices
from verify.simulator.growing_body import GrowingBody, Increment
from verify.simulator.point_numbers import EdgePoints, GrowingArray, RowNumbers, ranges
from verify.xfem.arrays import Bools, Floats, Ints, XfemError


class MovingSurface:
    """Facets (segments in 2D, triangles in 3D) that come and go, and vertices that only come.

    Parameters
    ----------
    corners : int
        Corners of an element: the length of a vertex's row of weights.
    space : int
        Dimension of the points.

    Attributes
    ----------
    material : GrowingArray
        (v, s) positions X of the vertices in the material frame, in metres.
    nodes, weights : GrowingArray
        (v, corners) dof nodes and weights of each vertex: the rows of W.
    facets : GrowingArray
        (f, k) vertices; the first is -1 where a facet is no longer in use.
    facet_piece : GrowingArray
        (f,) piece on whose surface it lies.
    inner : GrowingArray
        (f,) whether it lies on a cut.
    owner : GrowingArray
        (f,) to what it belongs: an element, or a facet of a surface that is given.
    """

    def __init__(self, corners: int, space: int, facet_corners: int) -> None:
        self.material = GrowingArray(np.empty((0, space)))
        self.nodes = GrowingArray(np.empty((0, corners), dtype=np.int64))
        self.weights = GrowingArray(np.empty((0, corners)))
        self.facets = GrowingArray(np.empty((0, facet_corners), dtype=np.int64))
        self.facet_piece = GrowingArray(np.empty(0, dtype=np.int64))
        self.inner = GrowingArray(np.empty(0, dtype=bool))
        self.owner = GrowingArray(np.empty(0, dtype=np.int64))
        self._owners: tuple[int, int] | None = None
        self._keys = RowNumbers()

    def add(
        self,
        point: Ints,
        material: Floats,
        weights: Floats,
        counts: Callable[[Ints], Bools],
        piece: Ints,
        inner: Bools,
        piece_cells: Ints,
        owner: Ints,
        bounds: Ints,
    ) -> None:
        """Append facets, and a vertex for each point and set of unknowns from which it moves.

        Parameters
        ----------
        point : (q, k) int array
            Number of the material point of each corner.
        material : (q, k, s) float array
            Where it is, in metres.
        weights : (q, k, c) float array
            Of the dof nodes of its piece.
        counts : callable
            Whether corners (n,), counted through all facets, move with each node (n, c): where not,
            the weight is zero; where so, the weight may still round to zero.
        piece : (q, k) int array
            Piece of each corner; the first corner's is the facet's.
        inner : (q,) bool array
        piece_cells : (p, c) int array
            Dof nodes of each piece.
        owner : (q,) int array
            To what each facet belongs; facets of one owner come one after the other.
        bounds : (o, 2) int array
            First facet of each owner and one past the last; written.
        """
        if len(point) == 0:
            return
        # one vertex for a point and the nodes from which it moves
        pairs = point.ravel() << 32 | piece.ravel()
        distinct_pairs, pair = np.unique(pairs, return_inverse=True)
        first = np.empty(len(distinct_pairs), dtype=np.int64)
        first[pair[::-1]] = np.arange(len(pairs))[::-1]
        nodes = piece_cells[piece.ravel()[first]]
        moved = np.sort(np.where(counts(first), nodes, -1))
        vertex, new = self._keys.number(np.column_stack([point.ravel()[first], moved]))
        corner = first[new]
        begin = len(self.facets)
        self.material.append(material.reshape(point.size, -1)[corner])
        self.nodes.append(nodes[new])
        self.weights.append(weights.reshape(point.size, -1)[corner])
        self.facets.append(vertex[pair].reshape(point.shape))
        self.facet_piece.append(piece[:, 0])
        self.inner.append(inner)
        self.owner.append(owner)
        change = np.flatnonzero(np.append(True, owner[1:] != owner[:-1]))
        bounds[owner[change], 0] = begin + change
        bounds[owner[change], 1] = begin + np.append(change[1:], len(owner))

    def retire(self, facets: Ints) -> None:
        """Take facets out of use."""
        self.facets.rows[facets, 0] = -1

    @property
    def used(self) -> Ints:
        """Numbers of the facets in use."""
        is_used = self.facets.rows[:, 0] >= 0
        if self._owners is not None:
            begin, end = self._owners
            is_used &= (self.owner.rows >= begin) & (self.owner.rows < end)
        return np.flatnonzero(is_used)

    def of_owners(self, begin: int, end: int) -> "MovingSurface":
        """Return the same surface with only the facets of these owners in use, kept up to date."""
        part = copy(self)
        part._owners = begin, end
        return part

    def positions(self, displacement: Floats) -> Floats:
        """Compute the positions (v, s) of the vertices for a displacement (N, s), in metres.

        Raises
        ------
        XfemError
            If `displacement` has fewer rows than there are dof nodes, or another shape or type.
        """
        self._check(displacement)
        found = self.material.rows.copy()
        _add_moved(self.nodes.rows, self.weights.rows, displacement, found)
        return found

    def add_forces(self, facets: Ints, at: Floats, forces: Floats, out: Floats) -> None:
        """Add forces at points of facets to the forces on the dof nodes: Wᵀf.

        Parameters
        ----------
        facets : (q,) int array
        at : (q, k) float array
            Barycentric coordinates of each point in its facet.
        forces : (q, s) float array
            In newtons.
        out : (N, s) float array

        Raises
        ------
        XfemError
            If a facet is not in use, or a shape is wrong.
        """
        self._check(out)
        if not np.isin(facets, self.used).all():
            raise XfemError(f"facets {facets}; expected facets of the surface that are in use")
        vertices = self.facets.rows[facets]
        if at.shape != vertices.shape or forces.shape != (len(facets), out.shape[1]):
            raise XfemError(
                f"forces of shape {forces.shape} at places of shape {at.shape}; expected "
                f"{(len(facets), out.shape[1])} and {vertices.shape}"
            )
        shares = at[:, :, None] * self.weights.rows[vertices]
        np.add.at(out, self.nodes.rows[vertices], shares[..., None] * forces[:, None, None])

    def _check(self, nodal: Floats) -> None:
        space, unknowns = self.material.rows.shape[1], int(self.nodes.rows.max(initial=-1)) + 1
        fits = nodal.ndim == 2 and nodal.shape[1] == space
        if not fits or nodal.dtype != np.float64 or len(nodal) < unknowns:
            raise XfemError(
                f"nodal values {nodal.shape}, {nodal.dtype}; expected (N ≥ {unknowns}, {space}), "
                "float64"
            )


@njit(cache=True)
def _add_moved(nodes, weights, displacement, out):
    """Add to places (v, s) what nodes (v, c) have moved, by their weights: W u."""
    for v in range(len(nodes)):
        for i in range(out.shape[1]):
            moved = 0.0
            for k in range(nodes.shape[1]):
                moved += weights[v, k] * displacement[nodes[v, k], i]
            out[v, i] += moved


class BodySurface:
    """Outer and inner surface of a growing body; every update costs what the cut touched.

    Parameters
    ----------
    body : GrowingBody
        Of triangles in the plane, tetrahedra, or triangles in space (a membrane).

    Attributes
    ----------
    surface : MovingSurface
    """

    def __init__(self, body: GrowingBody) -> None:
        mesh = body.mesh
        self._body, self._membrane = body, mesh.is_membrane
        self.surface = MovingSurface(mesh.dim + 1, mesh.space, mesh.space)
        self._edges = EdgePoints(mesh.points, body.points)
        self._facet_range = np.zeros((len(mesh.cells), 2), dtype=np.int64)
        split = np.flatnonzero(body.split_cells)
        if self._membrane:
            self._cover(np.arange(len(mesh.cells)), split)
            return
        self._orientation = np.sign(np.linalg.det(mesh.edge_vectors)).astype(np.int8)
        boundary = np.unique(mesh.boundary_facets[:, 0])
        beside = mesh.neighbours[split]
        self._cover(np.unique(np.concatenate([boundary, split, beside[beside >= 0]])), split)

    def update(self, increment: Increment | None) -> None:
        """Follow a cut."""
        if increment is not None:
            self._cover(increment.touched, increment.cells)

    def _cover(self, cells: Ints, split: Ints) -> None:
        """Make the facets of some cells anew; `split` are those with new sub-simplices."""
        body, mesh = self._body, self._body.mesh
        self._edges.add(body.sub_points.rows[ranges(body.sub_range[split])].ravel())
        ids, at, piece, cell, inner = self._facets_of(cells)
        ids, at, source = self._edges.bisect(ids, at)
        cell = cell[source]
        nodes, corners = mesh.cells[cell], ids.shape[1]
        pieces = np.repeat(piece[source, None], corners, axis=1)
        self.surface.retire(ranges(self._facet_range[cells]))
        self._facet_range[cells] = 0
        self.surface.add(
            ids, at @ mesh.points[nodes], at,
            lambda rows: body.points.spans(nodes[rows // corners], ids.ravel()[rows]), pieces,
            inner[source], body.piece_cells.rows, cell, self._facet_range,
        )  # fmt: skip

    def _facets_of(self, cells: Ints) -> tuple[Ints, Floats, Ints, Ints, Bools]:
        """Point numbers, barycentric corners, piece, cell, whether on a cut, of their facets."""
        body = self._body
        if self._membrane:
            return _membrane_facets(body, cells)
        return exposed_facets(
            cells, body.split_cells, cut_elements(body), sub_simplices(body), self._orientation
        )


def _membrane_facets(body: GrowingBody, cells: Ints) -> tuple[Ints, Floats, Ints, Ints, Bools]:
    """Find triangles of these elements: whole, or as the cuts have divided them.

    Returns for each, cell by cell: point numbers (q, 3), barycentric corners (q, 3, 3), piece,
    cell, and that it lies on no cut. They keep the direction of their element.
    """
    split = body.split_cells[cells]
    whole, divided = cells[~split], cells[split]
    of_cells = body.sub_range[divided]
    sub = ranges(of_cells)
    ids = np.concatenate([body.mesh.cells[whole], body.sub_points.rows[sub]])
    eye = np.broadcast_to(np.eye(3), (len(whole), 3, 3))
    at = np.concatenate([eye, body.sub_barycentric.rows[sub]])
    piece = np.concatenate([body.first_piece[whole], body.sub_piece.rows[sub]])
    cell = np.concatenate([whole, np.repeat(divided, of_cells[:, 1] - of_cells[:, 0])])
    turned = np.concatenate([np.zeros(len(whole), dtype=bool), body.sub_sign.rows[sub] < 0])
    ids[turned, :2] = ids[turned, 1::-1]
    at[turned, :2] = at[turned, 1::-1]
    order = np.argsort(cell, kind="stable")
    inner = np.zeros(len(cell), dtype=bool)
    return ids[order], at[order], piece[order], cell[order], inner
