"""Orientation of sub-simplices, from how they came about and not from where their corners are.

The determinant of a sub-simplex's barycentric corners is, but for its sign, a product of positive
shares (`verify.xfem.clipping`). So the sign does not change when every zero point is moved to the
middle of its edge; there the determinant is an exact sum of binary fractions, however thin the
sub-simplex itself.
"""

import numpy as np
from numba import njit

__all__ = ["simplex_signs"]


@njit(cache=True)
def _spread(point, weight, nodes, ends, corners, row):
    """Add the barycentric coordinates of a point whose zero points are all middles."""
    if point < nodes:
        for a in range(len(corners)):
            if corners[a] == point:
                row[a] += weight
        return
    for e in range(2):
        _spread(ends[point - nodes, e], 0.5 * weight, nodes, ends, corners, row)


@njit(cache=True)
def _minor(m, i, j, k):
    """Take the determinant of the last three rows of three columns."""
    a, b, c = len(m) - 3, len(m) - 2, len(m) - 1
    return (
        m[a, i] * (m[b, j] * m[c, k] - m[b, k] * m[c, j])
        - m[a, j] * (m[b, i] * m[c, k] - m[b, k] * m[c, i])
        + m[a, k] * (m[b, i] * m[c, j] - m[b, j] * m[c, i])
    )


@njit(cache=True)
def _determinant(m):
    """Take the determinant of 3 × 3 or 4 × 4 binary fractions: exact."""
    if len(m) == 3:
        return _minor(m, 0, 1, 2)
    return (
        m[0, 0] * _minor(m, 1, 2, 3)
        - m[0, 1] * _minor(m, 0, 2, 3)
        + m[0, 2] * _minor(m, 0, 1, 3)
        - m[0, 3] * _minor(m, 0, 1, 2)
    )


@njit(cache=True)
def simplex_signs(sub_points, sub_cell, cells, nodes, ends):
    """Orientation (k,) of sub-simplices in their cells: +1 or -1.

    Points up to `nodes` are those of the mesh, the ends (z, 2) of the zero points follow.
    """
    signs = np.empty(len(sub_points), dtype=np.int8)
    matrix = np.empty((sub_points.shape[1], cells.shape[1]))
    for s in range(len(sub_points)):
        matrix[:] = 0.0
        for k in range(sub_points.shape[1]):
            _spread(sub_points[s, k], 1.0, nodes, ends, cells[sub_cell[s]], matrix[k])
        signs[s] = 1 if _determinant(matrix) > 0.0 else -1
    return signs
