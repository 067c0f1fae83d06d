"""Unfitted background meshes, for solvers that cut through their elements."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.session import gmsh_session, simplices


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
        occ = gmsh.model.occ
        corners = [occ.addPoint(x, y, 0.0) for x, y in (outline - origin) / scale]
        edges = [
            occ.addLine(corners[i], corners[(i + 1) % len(corners)]) for i in range(len(corners))
        ]
        occ.addPlaneSurface([occ.addCurveLoop(edges)])
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMin", size / scale)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size / scale)
        gmsh.model.mesh.generate(2)
        points, cells, _ = simplices(gmsh, 2)
    return points * scale + origin, cells
