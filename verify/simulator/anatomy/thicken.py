"""A surface given a thickness: layers of prisms below it, each split into three tetrahedra.

A prism is split along the diagonals that start at the point with the smallest number, so that
neighbours agree on the diagonal of the face between them (Dompierre et al. 1999).
"""

import numpy as np

from verify.errors import InputError
from verify.xfem.arrays import Floats, Ints

_SIGNS = (-1.0, 1.0, -1.0)  # orientation of the three tetrahedra of a prism that lies below


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """(n, 3) unit normals at the points, weighted by the area of the triangles around."""
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    np.add.at(normals, triangles, area[:, None, :])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def thicken(
    points: Floats, triangles: Ints, thickness: float, layers: int = 1
) -> tuple[Floats, Ints]:
    """Tetrahedra between a surface and its copy at a distance below it.

    Parameters
    ----------
    points : (n, 3) float array
        m; they become the first n points of the result.
    triangles : (m, 3) int array
        Anticlockwise seen from outside.
    thickness : float
        m, along the normals.
    layers : int

    Returns
    -------
    points : (n (layers + 1), 3) float array
    tetrahedra : (3 m layers, 4) int array
        Of positive volume.

    Raises
    ------
    InputError
        If the surface is too curved for that thickness.
    """
    count = len(points)
    inwards = -thickness * vertex_normals(points, triangles)
    steps = np.linspace(0.0, 1.0, layers + 1)
    solid = np.concatenate([points + step * inwards for step in steps])
    upper = np.sort(triangles, axis=1)
    a, b, c = upper.T
    first = np.concatenate(
        [
            np.column_stack([a, b, c, c + count]),
            np.column_stack([a, b, b + count, c + count]),
            np.column_stack([a, a + count, b + count, c + count]),
        ]
    )
    tetrahedra = np.concatenate([first + layer * count for layer in range(layers)])
    # sorting has turned a triangle over where it was an odd permutation
    even = np.linalg.det(np.eye(3)[np.argsort(triangles, axis=1)])
    turned = np.tile(np.concatenate([sign * even for sign in _SIGNS]), layers)
    swap = turned < 0.0
    tetrahedra[swap, 0], tetrahedra[swap, 1] = tetrahedra[swap, 1], tetrahedra[swap, 0].copy()
    volume = np.linalg.det(solid[tetrahedra[:, 1:]] - solid[tetrahedra[:, :1]])
    if (volume <= 0.0).any():
        raise InputError(
            f"the surface is too curved to be {thickness:g} m thick: {int((volume <= 0.0).sum())} "
            f"of {len(tetrahedra)} elements turn inside out"
        )
    return solid, tetrahedra


def closed_shell(points: Floats, triangles: Ints, thickness: float) -> tuple[Floats, Ints]:
    """Close the surface (p, 3), (f, 3) of the solid that `thicken` makes, facing outwards."""
    count = len(points)
    shell = np.concatenate([points, points - thickness * vertex_normals(points, triangles)])
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    key = np.sort(edges, axis=1)
    _, place, uses = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    start, end = edges[uses[place.ravel()] == 1].T
    sides = [np.column_stack([start, start + count, end]),
             np.column_stack([end, start + count, end + count])]  # fmt: skip
    return shell, np.concatenate([triangles, triangles[:, ::-1] + count, *sides])
