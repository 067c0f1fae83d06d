"""The surface of the material itself: the mesh's own boundary, split, and the faces of the cuts.

Each piece's share of it closes around the material: facets on the boundary of the mesh, and inner
facets from the polygons in which cuts cross elements (thesis 3.2.4), oriented outwards, with
vertices doubled where, and only where, the material is separate. A membrane is its own surface,
with two new rims along a cut instead of inner facets.
"""

import numpy as np

from verify.simulator.arrays.distinct import ranges
from verify.simulator.cutting.growing_body import GrowingBody, Increment
from verify.simulator.mapping.cut_elements import cut_elements, sub_simplices
from verify.simulator.mapping.edge_points import EdgePoints
from verify.simulator.mapping.exposed_kernels import exposed_facets
from verify.simulator.mapping.membrane_facets import membrane_facets, rim_edges
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
        self._body, self._membrane = body, mesh.dim < mesh.space
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

    @property
    def rims(self) -> Ints:
        """(k, 2) edges of the surface that cuts have made; of a solid there are none.

        They run along the direction of their facets, the material on their left seen from above.
        """
        if not self._membrane:
            return np.empty((0, 2), dtype=np.int64)
        return rim_edges(self._body, self.surface)

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
            return membrane_facets(body, cells)
        return exposed_facets(
            cells, body.split_cells, cut_elements(body), sub_simplices(body), self._orientation
        )
