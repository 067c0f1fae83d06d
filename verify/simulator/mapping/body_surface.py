"""The surface of the material itself: the mesh's own boundary, split, and the faces of the cuts.

Each piece's share of it closes around the material: facets on the boundary of the mesh, and inner
facets from the polygons in which cuts cross elements (thesis 3.2.4), oriented outwards, with
vertices doubled where, and only where, the material is separate. A membrane is its own surface,
with two new rims along a cut instead of inner facets.
"""

import numpy as np

from verify.simulator.arrays import ranges
from verify.simulator.cutting.growing_body import GrowingBody, Increment
from verify.simulator.mapping.edge_points import EdgePoints
from verify.simulator.mapping.exposed_kernels import cut_elements, exposed_facets, sub_simplices
from verify.simulator.mapping.moving_surface import MovingSurface
from verify.xfem.arrays import Bools, Floats, Ints


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
        self._cover(np.union1d(boundary, split), split)

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
    """Triangles of these elements: whole, or as the cuts have divided them.

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
