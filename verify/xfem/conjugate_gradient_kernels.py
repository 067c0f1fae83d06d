"""Compiled loops of the preconditioned conjugate gradients: no allocation inside."""

import numpy as np
from numba import njit

__all__ = ["conjugate_gradients", "invert_blocks", "multiply"]


@njit(cache=True)
def multiply(starts, columns, blocks, x, out):
    """Product of nodal blocks (B, d, d) and a vector (N, d) into `out`."""
    dim = blocks.shape[1]
    for row in range(len(starts) - 1):
        for k in range(dim):
            out[row, k] = 0.0
        for at in range(starts[row], starts[row + 1]):
            column = columns[at]
            for k in range(dim):
                total = 0.0
                for l in range(dim):
                    total += blocks[at, k, l] * x[column, l]
                out[row, k] += total


@njit(cache=True)
def invert_blocks(blocks, diagonal, out):
    """Inverses (N, d, d) of the diagonal blocks; the first row that is not definite, or -1.

    Cholesky's factorisation of each, so that a sliver's tiny block keeps all its digits.
    """
    dim = blocks.shape[1]
    lower = np.zeros((dim, dim))
    for row in range(len(diagonal)):
        block = blocks[diagonal[row]]
        for j in range(dim):
            pivot = block[j, j]
            for k in range(j):
                pivot -= lower[j, k] ** 2
            if not pivot > 0.0:
                return row
            lower[j, j] = np.sqrt(pivot)
            for i in range(j + 1, dim):
                value = block[i, j]
                for k in range(j):
                    value -= lower[i, k] * lower[j, k]
                lower[i, j] = value / lower[j, j]
        inverse = out[row]
        for column in range(dim):
            for i in range(dim):
                value = 1.0 if i == column else 0.0
                for k in range(i):
                    value -= lower[i, k] * inverse[k, column]
                inverse[i, column] = value / lower[i, i]
            for i in range(dim - 1, -1, -1):
                value = inverse[i, column]
                for k in range(i + 1, dim):
                    value -= lower[k, i] * inverse[k, column]
                inverse[i, column] = value / lower[i, i]
    return -1


@njit(cache=True)
def conjugate_gradients(starts, columns, blocks, inverse, load, x, work, tolerance, limit):
    """Improve x (N, d) in place until ‖b − Kx‖ ≤ tolerance·‖b‖, in the 2-norm.

    Parameters
    ----------
    work : (4, N, d) float array
        Residual, preconditioned residual, direction and its product.

    Returns
    -------
    iterations : int
    residual : float
        ‖b − Kx‖/‖b‖ by the recurrence.
    """
    count, dim = load.shape
    r, z, p, q = work[0], work[1], work[2], work[3]
    multiply(starts, columns, blocks, x, q)
    size = 0.0
    norm = 0.0
    for i in range(count):
        for k in range(dim):
            r[i, k] = load[i, k] - q[i, k]
            size += load[i, k] ** 2
            norm += r[i, k] ** 2
    if size == 0.0:
        x[:] = 0.0
        return 0, 0.0
    target = tolerance**2 * size
    rho = 0.0
    for iteration in range(limit + 1):
        if norm <= target or iteration == limit:
            return iteration, np.sqrt(norm / size)
        old = rho
        rho = 0.0
        for i in range(count):
            for k in range(dim):
                total = 0.0
                for l in range(dim):
                    total += inverse[i, k, l] * r[i, l]
                z[i, k] = total
                rho += total * r[i, k]
        beta = rho / old if iteration > 0 else 0.0
        for i in range(count):
            for k in range(dim):
                p[i, k] = z[i, k] + (beta * p[i, k] if iteration > 0 else 0.0)
        multiply(starts, columns, blocks, p, q)
        curvature = 0.0
        for i in range(count):
            for k in range(dim):
                curvature += p[i, k] * q[i, k]
        if not curvature > 0.0:
            return -1, np.sqrt(norm / size)
        alpha = rho / curvature
        norm = 0.0
        for i in range(count):
            for k in range(dim):
                x[i, k] += alpha * p[i, k]
                r[i, k] -= alpha * q[i, k]
                norm += r[i, k] ** 2
    return limit, np.sqrt(norm / size)
