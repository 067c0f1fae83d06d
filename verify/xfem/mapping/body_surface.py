"""The surface of the material itself: the mesh's own boundary, split, and the faces of the cuts.

Each piece's share of it closes around the material: facets on the boundary of the mesh, and inner
facets from the polygons in which cuts cross elements (thesis 3.2.4), oriented outwards, with
vertices doubled where, and only where, the material is separate.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cutting.distinct import ranges
from verify.xfem.cutting.growing_body import GrowingBody, Increment
from verify.xfem.errors import XfemError
from verify.xfem.mapping.edge_points import EdgePoints
from verify.xfem.mapping.exposed_kernels import exposed_facets
from verify.xfem.mapping.moving_surface import MovingSurface

__all__ = ["BodySurface"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class BodySurface:
    """Outer and inner surface of a growing body; every update costs what the cut touched.

    Parameters
    ----------
    body : GrowingBody
        Of triangles in the plane or tetrahedra.

    Raises
    ------
    XfemError
        If the body is a membrane.

    Attributes
    ----------
    surface : MovingSurface
    """

    def __init__(self, body: GrowingBody) -> None:
        mesh = body.mesh
        if mesh.dim != mesh.space:
            raise XfemError("a membrane has no surface that encloses it")
        self._body = body
        self.surface = MovingSurface(mesh.dim + 1, mesh.space, mesh.dim)
        self._edges = EdgePoints(mesh.points, body.points)
        self._orientation = np.sign(np.linalg.det(mesh.edge_vectors)).astype(np.int8)
        self._facet_range = np.zeros((len(mesh.cells), 2), dtype=np.int64)
        boundary = np.unique(mesh.boundary_facets[:, 0])
        split = np.flatnonzero(body.split_cells)
        self._cover(np.union1d(boundary, split), split)

    def update(self, increment: Increment | None) -> None:
        """Follow a cut."""
        if increment is not None:
            self._cover(increment.touched, increment.cells)

    def _cover(self, cells: _Ints, split: _Ints) -> None:
        """Make the facets of some cells anew; `split` are those with new sub-simplices."""
        body, mesh = self._body, self._body.mesh
        self._edges.add(body.sub_points.rows[ranges(body.sub_range[split])].ravel())
        self.surface.retire(ranges(self._facet_range[cells]))
        self._facet_range[cells] = 0
        ids, at, piece, cell, inner = exposed_facets(
            cells,
            body.split_cells,
            mesh.cells,
            mesh.neighbours,
            body.piece_cells.rows,
            body.first_piece,
            body.next_piece.rows,
            body.sub_range,
            body.sub_piece.rows,
            body.sub_points.rows,
            body.sub_barycentric.rows,
            body.sub_sign.rows,
            self._orientation,
        )
        ids, source, share = self._edges.bisect(ids)
        at = share @ at[source]
        piece, cell = piece[source], cell[source]
        corners = ids.shape[1]
        row = np.repeat(np.arange(len(ids)), corners)
        weights = at.reshape(len(row), -1)
        material = np.einsum("qc,qcs->qs", weights, mesh.points[mesh.cells[cell[row]]])
        vertex = self.surface.weld(
            ids.ravel(), material, body.piece_cells.rows[piece[row]], weights
        )
        numbers = self.surface.add(vertex.reshape(ids.shape), piece, inner[source])
        # facets come cell by cell
        starts = np.flatnonzero(np.diff(cell, prepend=-1))
        self._facet_range[cell[starts], 0] = numbers[starts]
        self._facet_range[cell[starts], 1] = np.append(numbers[starts[1:]], numbers[-1:] + 1)
