"""Gauss rules on simplices: positive weights, all points inside."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from verify.compare.splitting import measures

Array = NDArray[np.float64]


@cache
def simplex_rule(k: int, order: int) -> tuple[Array, Array]:
    """Barycentric points (n, k + 1) and weights (n,) that sum to 1.

    Order 2 is the symmetric rule of k + 1 points, exact for quadratic polynomials; any other
    is Stroud's conical product of order^k points, exact to degree 2 · order − 1.
    """
    if order == 2:
        near = {1: 0.5 - 0.5 / 3**0.5, 2: 1 / 6, 3: (5 - 5**0.5) / 20}[k]
        points = np.full((k + 1, k + 1), near)
        np.fill_diagonal(points, 1 - k * near)
        return points, np.full(k + 1, 1 / (k + 1))
    points, weights = np.zeros((1, 0)), np.ones(1)
    left = np.ones(1)  # 1 − the coordinates taken so far
    for axis in range(k):
        x, w = roots_jacobi(order, k - 1 - axis, 0)
        x, w = 0.5 * (x + 1), w / w.sum()
        step = (left[:, None] * x).ravel()
        points = np.column_stack([np.repeat(points, order, axis=0), step])
        weights = np.repeat(weights, order) * np.tile(w, len(weights))
        left = np.repeat(left, order) - step
    return np.column_stack([left, points]), weights


def points_in(corners: Array, order: int) -> tuple[Array, Array]:
    """Points (n, d) and weights (n,) of the rule of an order on simplices (m, k + 1, d)."""
    place, share = simplex_rule(corners.shape[1] - 1, order)
    points = np.einsum("qk,mkd->mqd", place, corners).reshape(-1, corners.shape[2])
    return points, (measures(corners)[:, None] * share).ravel()
