"""Quadrature on simplices of any dimension: Gauss points in collapsed coordinates."""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi


@cache
def simplex_rule(dim: int, degree: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points and weights exact for polynomials up to a degree.

    Parameters
    ----------
    dim : int
        Dimension of the simplex, 1 to 3.
    degree : int

    Returns
    -------
    barycentric : (q, dim + 1) float array
    weights : (q,) float array
        Their sum is 1: they multiply the volume.
    """
    count = degree // 2 + 1
    barycentric = np.ones((1, 1))
    weights = np.ones(1)
    for axis in range(dim):
        # the Jacobi weight (1 − t)^axis is the Jacobian of the collapse onto the new corner
        t, w = roots_jacobi(count, axis, 0.0)
        share, w = 0.5 * (1.0 + t), w / w.sum()
        old = (1.0 - share)[:, None, None] * barycentric
        new = np.broadcast_to(share[:, None, None], (count, len(weights), 1))
        barycentric = np.concatenate([old, new], axis=2).reshape(-1, axis + 2)
        weights = (w[:, None] * weights).ravel()
    return barycentric, weights
