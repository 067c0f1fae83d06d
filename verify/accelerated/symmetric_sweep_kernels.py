"""Gauß–Seidel sweeps over a symmetric matrix in nodal blocks, K = L + D + Lᵀ.

They read the blocks above the diagonal, which lie one after the other in a memory of their own:
read forwards and backwards without gaps, they arrive before they are asked for. Blocks of three are
written out, so that sums stay in registers.
"""

import numpy as np
from numba import njit

_FUSED = {"contract"}  # multiply and add in one, rounded once


def upper_pattern(starts, columns, diagonal):
    """First block and columns of each row above the diagonal; unsigned, no index is negative."""
    above = columns > np.repeat(np.arange(len(diagonal)), np.diff(starts))
    count = starts[1:] - diagonal - 1
    return np.concatenate([[0], np.cumsum(count)]), columns[above].astype(np.uint32)


@njit(cache=True)
def take_upper(starts, diagonal, blocks, upper):
    """Copy the blocks (B, d, d) above the diagonal."""
    size, count = blocks.shape[1], 0
    for row in range(len(diagonal)):
        for at in range(diagonal[row] + 1, starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    upper[count, k, l] = blocks[at, k, l]
            count += 1


@njit(cache=True)
def solve_upper(starts, columns, upper, inverse, p, t, e, u):
    """Find t = (D + Lᵀ)⁻¹ p, with e = Lᵀ t and u = D t = p − e.

    Parameters
    ----------
    starts, columns : int arrays
        As of `upper_pattern`.
    upper : (B, d, d) float array
        Blocks above the diagonal.
    inverse : (N, d, d) float array
        Of the diagonal blocks.
    p : (N, d) float array
    t, e, u : (N, d) float array
        Overwritten.
    """
    size = upper.shape[1]
    if size == 3:
        _solve_upper_3(starts, columns, upper, inverse, p, t, e, u)
        return
    for row in range(len(inverse) - 1, -1, -1):
        for k in range(size):
            e[row, k] = 0.0
            for at in range(starts[row], starts[row + 1]):
                for l in range(size):
                    e[row, k] += upper[at, k, l] * t[columns[at], l]
            u[row, k] = p[row, k] - e[row, k]
        for k in range(size):
            t[row, k] = 0.0
            for l in range(size):
                t[row, k] += inverse[row, k, l] * u[row, l]


@njit(cache=True, fastmath=_FUSED)
def _solve_upper_3(starts, columns, upper, inverse, p, t, e, u):
    for row in range(len(inverse) - 1, -1, -1):
        a = b = c = 0.0
        # backwards: the neighbour whose value is the last to be known comes last
        for at in range(starts[row + 1] - 1, starts[row] - 1, -1):
            j = columns[at]
            x, y, z = t[j, 0], t[j, 1], t[j, 2]
            a += upper[at, 0, 0] * x + upper[at, 0, 1] * y + upper[at, 0, 2] * z
            b += upper[at, 1, 0] * x + upper[at, 1, 1] * y + upper[at, 1, 2] * z
            c += upper[at, 2, 0] * x + upper[at, 2, 1] * y + upper[at, 2, 2] * z
        e[row, 0], e[row, 1], e[row, 2] = a, b, c
        a, b, c = p[row, 0] - a, p[row, 1] - b, p[row, 2] - c
        u[row, 0], u[row, 1], u[row, 2] = a, b, c
        for k in range(3):
            t[row, k] = inverse[row, k, 0] * a + inverse[row, k, 1] * b + inverse[row, k, 2] * c


@njit(cache=True)
def solve_lower(starts, columns, upper, inverse, g, s):
    """Find s = (D + L)⁻¹ g; of g only D s is left.

    Parameters
    ----------
    starts, columns, upper, inverse
        As for `solve_upper`.
    g : (N, d) float array
        Right-hand side.
    s : (N, d) float array
        Overwritten.
    """
    size = upper.shape[1]
    if size == 3:
        _solve_lower_3(starts, columns, upper, inverse, g, s)
        return
    for row in range(len(inverse)):
        for k in range(size):
            s[row, k] = 0.0
            for l in range(size):
                s[row, k] += inverse[row, k, l] * g[row, l]
        for at in range(starts[row], starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    g[columns[at], l] -= upper[at, k, l] * s[row, k]


@njit(cache=True, fastmath=_FUSED)
def _solve_lower_3(starts, columns, upper, inverse, g, s):
    for row in range(len(inverse)):
        a, b, c = g[row, 0], g[row, 1], g[row, 2]
        x = inverse[row, 0, 0] * a + inverse[row, 0, 1] * b + inverse[row, 0, 2] * c
        y = inverse[row, 1, 0] * a + inverse[row, 1, 1] * b + inverse[row, 1, 2] * c
        z = inverse[row, 2, 0] * a + inverse[row, 2, 1] * b + inverse[row, 2, 2] * c
        s[row, 0], s[row, 1], s[row, 2] = x, y, z
        for at in range(starts[row], starts[row + 1]):
            j = columns[at]
            a, b, c = g[j, 0], g[j, 1], g[j, 2]
            a = a - upper[at, 0, 0] * x - upper[at, 1, 0] * y - upper[at, 2, 0] * z
            b = b - upper[at, 0, 1] * x - upper[at, 1, 1] * y - upper[at, 2, 1] * z
            c = c - upper[at, 0, 2] * x - upper[at, 1, 2] * y - upper[at, 2, 2] * z
            g[j, 0], g[j, 1], g[j, 2] = a, b, c


@njit(cache=True)
def add_lower_product(starts, columns, upper, s, out):
    """Add L s (N, d) to `out`."""
    size = upper.shape[1]
    for row in range(len(s)):
        for at in range(starts[row], starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    out[columns[at], l] += upper[at, k, l] * s[row, k]
