"""Unfitted background meshes, for solvers that cut through their elements."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.session import add_polygon, gmsh_session, set_sizes, simplices


def background_mesh(
    outline: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Uniform unstructured triangles of a polygon, ignorant of any cut.

    Parameters
    ----------
    outline : (k, 2) array
        Corners in order, m.
    size : float
        Element size, m.

    Returns
    -------
    points : (n, 2) array
    cells : (m, 3) array
    """
    origin, scale = outline.min(axis=0), float(np.ptp(outline, axis=0).max())
    with gmsh_session() as gmsh:
        add_polygon(gmsh.model.occ, (outline - origin) / scale)
        gmsh.model.occ.synchronize()
        set_sizes(gmsh, [], size / scale, size / scale)
        gmsh.model.mesh.generate(2)
        points, cells, _ = simplices(gmsh, 2)
    return points * scale + origin, cells
