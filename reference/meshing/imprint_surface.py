"""Imprinting plane polygons on triangles in space, so that their edges run along the cuts."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import split_edges
from reference.meshing.imprint_solid import Mesh, interior_facets, trace_polygon
from reference.meshing.opening import doubled_nodes
from verify.errors import InputError

Array = NDArray[np.float64]
Cells = NDArray[np.int64]


def imprint_surface(points: Array, cells: Cells, polygons: list[Array]) -> Mesh:
    """Split the triangles of a surface where polygons cut it; all others stay as they are.

    Parameters
    ----------
    points : (n, 3) array
    cells : (m, 3) array
    polygons : list of (k, 3) array
        Plane and simple.

    Returns
    -------
    points : (…, 3) array
    cells : (…, 3) array
    facets : (f, 2) array
        Nodes of the *interior* edges along the polygons.

    Raises
    ------
    InputError
        If no polygon crosses the surface.
    """
    mesh: Mesh = (points, cells, np.zeros((0, 2), dtype=np.int64))
    for corners in polygons:
        mesh = trace_polygon(mesh, corners, insert=False)
    points, cells, facets = mesh
    kept = interior_facets(cells, facets)
    if polygons and not len(kept):
        raise InputError("cuts: none of them crosses the membrane")
    return _loosened(points, cells, kept)


def _loosened(points: Array, cells: Cells, facets: Cells) -> Mesh:
    """Halve each edge of a cut whose two ends are tips: it could not open."""
    if not len(facets):
        return points, cells, facets
    opened = np.zeros(len(points), dtype=bool)
    opened[doubled_nodes(cells, facets)] = True
    tied = facets[~opened[facets].any(axis=1)]
    return split_edges(points, cells, facets, tied, points[tied].mean(axis=1))
