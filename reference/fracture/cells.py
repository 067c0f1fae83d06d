"""Displacement gradients of a finite element field at quadrature points."""

from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.solution import Solution

Array = NDArray[np.float64]
# Gauss points per direction of the collapsed square or cube: exact to degree 10 in the plane and
# 4 in space, where a tube has a hundred times the cells of a ring
_ORDER = {2: 6, 3: 3}
_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]  # of VTK; the first three in the plane


class CellGradients(NamedTuple):
    """Values at the q quadrature points of m cells.

    Attributes
    ----------
    points : (m, q, d) array
        m.
    weights : (m, q) array
        Areas or volumes, m^d.
    gradient : (m, q, d, d) array
        ∂u_i/∂x_j.
    hats : (m, q, d + 1, d) array
        Gradients of the linear hat functions of the corners, 1/m.
    corner_shares : (q, d + 1) array
        Values of the hat functions.
    shape : (q, k) array
        Values of the shape functions of all nodes.
    """

    points: Array
    weights: Array
    gradient: Array
    hats: Array
    corner_shares: Array
    shape: Array


def cell_gradients(solution: Solution, cells: NDArray[np.int64], step: int = -1) -> CellGradients:
    """Evaluate the gradient in some cells of a solution, isoparametric if it is quadratic.

    Parameters
    ----------
    solution : Solution
    cells : (m,) int array
        Which cells.
    step : int
        Which output time; default the last.
    """
    d = solution.dimension
    nodes = solution.cells[cells]
    x, u = solution.points[nodes], solution.displacement[step][nodes]
    xi, weight = _rule(d, _ORDER[d])
    corner, corner_slope = _linear(xi)
    shape, slope = (corner, corner_slope) if solution.order == 1 else _quadratic(xi)
    jacobian = np.einsum("qka,mki->mqia", slope, x)  # ∂x_i/∂ξ_a
    inverse = np.linalg.inv(jacobian)
    gradient = np.einsum("mqib,mqbj->mqij", np.einsum("qka,mki->mqia", slope, u), inverse)
    hats = np.einsum("qka,mqaj->mqkj", corner_slope, inverse)
    return CellGradients(
        np.einsum("qk,mki->mqi", shape, x),
        np.abs(np.linalg.det(jacobian)) * weight,
        gradient,
        hats,
        corner,
        shape,
    )


def _rule(dimension: int, order: int) -> tuple[Array, Array]:
    """Gauss points of the square or cube collapsed onto the unit simplex."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    s, w = 0.5 * (nodes + 1), 0.5 * weights
    grids = np.meshgrid(*[s] * dimension, indexing="ij")
    total = np.ones_like(grids[0])
    for k, factor in enumerate(np.meshgrid(*[w] * dimension, indexing="ij")):
        total = total * factor * (1 - grids[k]) ** (dimension - 1 - k)
    left, columns = np.ones_like(grids[0]), []
    for grid in grids:
        columns.append((left * grid).ravel())
        left = left * (1 - grid)
    return np.column_stack(columns), total.ravel()


def _linear(xi: Array) -> tuple[Array, Array]:
    n, d = xi.shape
    slope = np.vstack([-np.ones(d), np.eye(d)])
    shape = np.column_stack([1 - xi.sum(axis=1), xi])
    return shape, np.broadcast_to(slope, (n, d + 1, d))


def _quadratic(xi: Array) -> tuple[Array, Array]:
    """VTK's order: corners, then the mid-nodes of the edges."""
    corner, slope = _linear(xi)
    d = xi.shape[1]
    ends = _EDGES[: len(list(combinations(range(d + 1), 2)))]
    shape = [corner[:, k] * (2 * corner[:, k] - 1) for k in range(d + 1)]
    shape += [4 * corner[:, i] * corner[:, j] for i, j in ends]
    slopes = [(4 * corner[:, k] - 1)[:, None] * slope[:, k] for k in range(d + 1)]
    slopes += [
        4 * (corner[:, i, None] * slope[:, j] + corner[:, j, None] * slope[:, i]) for i, j in ends
    ]
    return np.stack(shape, axis=1), np.stack(slopes, axis=1)
