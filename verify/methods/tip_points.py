"""Ends of polylines inside a mesh of triangles become nodes, so that a split can end there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts import Cut, Polyline
from verify.xfem.mesh import SimplexMesh

_Ints = NDArray[np.int64]

_NEAR = 1e-6  # barycentric: an end as near as that to an edge or node lies on it


def add_tip_points(mesh: SimplexMesh, cuts: Sequence[Cut]) -> tuple[SimplexMesh, _Ints]:
    """Divide each triangle in which an open polyline ends into three.

    Ends on an edge, at a node or outside the body need nothing, as a split ends there anyway.

    Returns
    -------
    mesh : SimplexMesh
        The same one if there is nothing to do.
    origin : (m,) int array
        Cell of the given mesh in which each cell lies.
    """
    origin = np.arange(len(mesh.cells))
    if mesh.dim != 2 or mesh.space != 2:
        return mesh, origin
    ends = [cut.vertices[[0, -1]] for cut in cuts if isinstance(cut, Polyline) and not cut.closed]
    for point in np.concatenate(ends) if ends else []:
        weights = np.einsum("eik,ek->ei", mesh.gradients, point - mesh.points[mesh.cells[:, 0]])
        weights[:, 0] += 1.0
        cell = int(weights.min(axis=1).argmax())
        if weights[cell].min() <= _NEAR:
            continue
        node, corners = len(mesh.points), mesh.cells[cell]
        parts = np.repeat(corners[None], 3, axis=0)
        np.fill_diagonal(parts, node)
        cells = np.concatenate([np.delete(mesh.cells, cell, axis=0), parts])
        origin = np.concatenate([np.delete(origin, cell), np.repeat(origin[cell], 3)])
        mesh = SimplexMesh(np.concatenate([mesh.points, point[None]]), cells)
    return mesh, origin
