"""Displacement gradients of a plane finite element field at quadrature points."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.solution import Solution

__all__ = ["CellGradients", "cell_gradients"]

Array = NDArray[np.float64]
_ORDER = 6  # Gauss points per direction of the collapsed square: exact to degree 10


class CellGradients(NamedTuple):
    """Values at the q quadrature points of m cells.

    Attributes
    ----------
    points : (m, q, 2) array
        m.
    weights : (m, q) array
        m².
    gradient : (m, q, 2, 2) array
        ∂u_i/∂x_j.
    hats : (m, q, 3, 2) array
        Gradients of the linear hat functions of the three corners, 1/m.
    """

    points: Array
    weights: Array
    gradient: Array
    hats: Array


def cell_gradients(solution: Solution, cells: NDArray[np.int64], step: int = -1) -> CellGradients:
    """Evaluate the gradient in some cells of a plane solution, isoparametric if it is quadratic.

    Parameters
    ----------
    solution : Solution
    cells : (m,) int array
        Which cells.
    step : int
        Which output time; default the last.
    """
    nodes = solution.cells[cells]
    x, u = solution.points[nodes], solution.displacement[step][nodes]
    xi, weight = _triangle_rule(_ORDER)
    shape, slope = _linear(xi) if solution.order == 1 else _quadratic(xi)
    jacobian = np.einsum("qka,mki->mqia", slope, x)  # ∂x_i/∂ξ_a
    inverse = np.linalg.inv(jacobian)
    gradient = np.einsum("qka,mki,mqaj->mqij", slope, u, inverse)
    hats = np.einsum("qka,mqaj->mqkj", _linear(xi)[1], inverse)
    return CellGradients(
        np.einsum("qk,mki->mqi", shape, x),
        np.abs(np.linalg.det(jacobian)) * weight,
        gradient,
        hats,
    )


def _triangle_rule(order: int) -> tuple[Array, Array]:
    """Gauss points of the square collapsed onto the triangle (0,0), (1,0), (0,1)."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    s, w = 0.5 * (nodes + 1), 0.5 * weights
    a, b = np.repeat(s, order), np.tile(s, order)
    return np.column_stack([a, (1 - a) * b]), np.repeat(w * (1 - s), order) * np.tile(w, order)


def _linear(xi: Array) -> tuple[Array, Array]:
    slope = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    shape = np.column_stack([1 - xi.sum(axis=1), xi])
    return shape, np.broadcast_to(slope, (len(xi), 3, 2))


def _quadratic(xi: Array) -> tuple[Array, Array]:
    """VTK's order: corners, then the mid-nodes of edges 01, 12, 20."""
    corner, slope = _linear(xi)
    ends = [(0, 1), (1, 2), (2, 0)]
    shape = [corner[:, k] * (2 * corner[:, k] - 1) for k in range(3)]
    shape += [4 * corner[:, i] * corner[:, j] for i, j in ends]
    slopes = [(4 * corner[:, k] - 1)[:, None] * slope[:, k] for k in range(3)]
    slopes += [
        4 * (corner[:, i, None] * slope[:, j] + corner[:, j, None] * slope[:, i]) for i, j in ends
    ]
    return np.stack(shape, axis=1), np.stack(slopes, axis=1)
