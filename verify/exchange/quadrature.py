"""Quadrature on simplices of any dimension, for loads that vary."""

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

__all__ = ["simplex_rule"]


def simplex_rule(dimension: int, count: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Conical product rule (Stroud), exact for polynomials of degree 2·count − 1.

    Parameters
    ----------
    dimension : int
        Of the simplex: 1, 2 or 3.
    count : int
        Points per direction.

    Returns
    -------
    barycentric : (count**dimension, dimension + 1) array
    weights : (count**dimension,) array
        They sum to 1: multiply by the measure of the simplex.
    """
    axes = [roots_jacobi(count, dimension - 1 - k, 0) for k in range(dimension)]
    barycentric, weights = [], []
    for index in product(range(count), repeat=dimension):
        rest, weight, coordinates = 1.0, 1.0, []
        for k, i in enumerate(index):
            s = 0.5 * (1.0 + axes[k][0][i])
            coordinates.append(rest * s)
            rest *= 1.0 - s
            weight *= axes[k][1][i]
        barycentric.append([*coordinates, rest])
        weights.append(weight)
    total = np.array(weights)
    return np.array(barycentric), total / total.sum()
