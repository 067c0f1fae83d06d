"""Compiled loops of the preconditioned conjugate gradients: no allocation inside."""

import numpy as np
from numba import njit

__all__ = ["conjugate_gradients", "invert_blocks", "multiply"]


# Fused multiply-add everywhere; sums in any order only over long flat vectors, where it lets the
# compiler use the vector unit. On products of small blocks it makes it shuffle: four times slower.
_FUSED = {"contract"}
_SUMS = {"reassoc", "contract", "nsz"}


@njit(cache=True, fastmath=_FUSED)
def multiply(starts, columns, blocks, x, out):
    """Product of nodal blocks (B, d, d) and a vector (N, d) into `out`; returns x·out.

    Written out for d = 2 and 3, where traffic, not arithmetic, is to be the limit.
    """
    if blocks.shape[1] == 3:
        return _multiply_3(starts, columns, blocks, x, out)
    if blocks.shape[1] == 2:
        return _multiply_2(starts, columns, blocks, x, out)
    total = 0.0
    for row in range(len(starts) - 1):
        out[row] = 0.0
        for at in range(starts[row], starts[row + 1]):
            for k in range(blocks.shape[1]):
                for l in range(blocks.shape[1]):
                    out[row, k] += blocks[at, k, l] * x[columns[at], l]
        for k in range(blocks.shape[1]):
            total += out[row, k] * x[row, k]
    return total


@njit(cache=True, fastmath=_FUSED)
def _multiply_2(starts, columns, blocks, x, out):
    total = 0.0
    for row in range(len(starts) - 1):
        a = 0.0
        b = 0.0
        for at in range(starts[row], starts[row + 1]):
            column = columns[at]
            u, v = x[column, 0], x[column, 1]
            a += blocks[at, 0, 0] * u + blocks[at, 0, 1] * v
            b += blocks[at, 1, 0] * u + blocks[at, 1, 1] * v
        out[row, 0], out[row, 1] = a, b
        total += a * x[row, 0] + b * x[row, 1]
    return total


@njit(cache=True, fastmath=_FUSED)
def _multiply_3(starts, columns, blocks, x, out):
    total = 0.0
    for row in range(len(starts) - 1):
        a = 0.0
        b = 0.0
        c = 0.0
        for at in range(starts[row], starts[row + 1]):
            column = columns[at]
            u, v, w = x[column, 0], x[column, 1], x[column, 2]
            a += blocks[at, 0, 0] * u + blocks[at, 0, 1] * v + blocks[at, 0, 2] * w
            b += blocks[at, 1, 0] * u + blocks[at, 1, 1] * v + blocks[at, 1, 2] * w
            c += blocks[at, 2, 0] * u + blocks[at, 2, 1] * v + blocks[at, 2, 2] * w
        out[row, 0], out[row, 1], out[row, 2] = a, b, c
        total += a * x[row, 0] + b * x[row, 1] + c * x[row, 2]
    return total


@njit(cache=True, fastmath=_FUSED)
def _precondition(inverse, r, z):
    """Inverse blocks times r into z; returns r·z."""
    total = 0.0
    if inverse.shape[1] == 3:
        for i in range(len(r)):
            u, v, w = r[i, 0], r[i, 1], r[i, 2]
            z[i, 0] = inverse[i, 0, 0] * u + inverse[i, 0, 1] * v + inverse[i, 0, 2] * w
            z[i, 1] = inverse[i, 1, 0] * u + inverse[i, 1, 1] * v + inverse[i, 1, 2] * w
            z[i, 2] = inverse[i, 2, 0] * u + inverse[i, 2, 1] * v + inverse[i, 2, 2] * w
            total += z[i, 0] * u + z[i, 1] * v + z[i, 2] * w
    elif inverse.shape[1] == 2:
        for i in range(len(r)):
            u, v = r[i, 0], r[i, 1]
            z[i, 0] = inverse[i, 0, 0] * u + inverse[i, 0, 1] * v
            z[i, 1] = inverse[i, 1, 0] * u + inverse[i, 1, 1] * v
            total += z[i, 0] * u + z[i, 1] * v
    else:
        for i in range(len(r)):
            z[i] = 0.0
            for k in range(inverse.shape[1]):
                for l in range(inverse.shape[1]):
                    z[i, k] += inverse[i, k, l] * r[i, l]
                total += z[i, k] * r[i, k]
    return total


@njit(cache=True, fastmath=_SUMS)
def _advance(alpha, p, q, x, r):
    """Take the step x += αp, r −= αq, all flat; returns r·r."""
    total = 0.0
    for i in range(len(r)):
        x[i] += alpha * p[i]
        r[i] -= alpha * q[i]
        total += r[i] * r[i]
    return total


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
    """Improve the contiguous x (N, d) in place until ‖b − Kx‖ ≤ tolerance·‖b‖, in the 2-norm.

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
    r, z, p, q = work[0], work[1], work[2], work[3]
    multiply(starts, columns, blocks, x, q)
    size = 0.0
    norm = 0.0
    for i in range(load.shape[0]):
        for k in range(load.shape[1]):
            r[i, k] = load[i, k] - q[i, k]
            size += load[i, k] ** 2
            norm += r[i, k] ** 2
    if size == 0.0:
        x[:] = 0.0
        return 0, 0.0
    target = tolerance**2 * size
    flat_x, flat_r = x.reshape(-1), r.reshape(-1)
    flat_z, flat_p, flat_q = z.reshape(-1), p.reshape(-1), q.reshape(-1)
    flat_p[:] = 0.0
    rho = 1.0
    for iteration in range(limit + 1):
        if norm <= target or iteration == limit:
            return iteration, np.sqrt(norm / size)
        old = rho
        rho = _precondition(inverse, r, z)
        beta = rho / old if iteration > 0 else 0.0
        for i in range(len(flat_p)):
            flat_p[i] = flat_z[i] + beta * flat_p[i]
        curvature = multiply(starts, columns, blocks, p, q)
        if not curvature > 0.0:
            return -1, np.sqrt(norm / size)
        norm = _advance(rho / curvature, flat_p, flat_q, flat_x, flat_r)
    return limit, np.sqrt(norm / size)
