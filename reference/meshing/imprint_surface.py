"""Imprinting plane polygons on triangles in space, so that their edges run along the cuts."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import split_edges
from reference.meshing.imprint_solid import (
    Mesh,
    plane_facets,
    plane_frame,
    split_by_line,
    split_by_plane,
)
from reference.meshing.opening import cell_facets, doubled_nodes
from verify.errors import InputError
from verify.scene.planar import inside_polygon

__all__ = ["imprint_surface"]

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
        origin, axes = plane_frame(corners)
        outline = (corners - origin) @ axes[:2].T
        mesh, on_plane = split_by_plane(mesh, outline, origin, axes)
        for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
            mesh, on_plane = split_by_line(mesh, on_plane, a, b, origin, axes)
        points, cells, facets = mesh
        mine = plane_facets(cells, on_plane)
        middles = (points[mine].mean(axis=1) - origin) @ axes[:2].T
        mesh = points, cells, np.concatenate([facets, mine[inside_polygon(middles, outline)]])
    points, cells, facets = mesh
    edges, times = np.unique(cell_facets(cells), axis=0, return_counts=True)
    inner = {tuple(edge) for edge in edges[times == 2].tolist()}
    kept = [e for e in np.unique(np.sort(facets, axis=1), axis=0).tolist() if tuple(e) in inner]
    if polygons and not kept:
        raise InputError("cuts: none of them crosses the membrane")
    return _loosened(points, cells, np.array(kept, dtype=np.int64).reshape(-1, 2))


def _loosened(points: Array, cells: Cells, facets: Cells) -> Mesh:
    """Halve each edge of a cut whose two ends are tips: it could not open."""
    if not len(facets):
        return points, cells, facets
    opened = np.zeros(len(points), dtype=bool)
    opened[doubled_nodes(cells, facets)] = True
    tied = facets[~opened[facets].any(axis=1)]
    return split_edges(points, cells, facets, tied, points[tied].mean(axis=1))
