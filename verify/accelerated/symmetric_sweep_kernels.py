"""Gauß–Seidel sweeps over a symmetric matrix in nodal blocks, K = L + D + Lᵀ.

They read the blocks above the diagonal, which lie one after the other in a memory of their own:
read forwards and backwards without gaps, they arrive before they are asked for. Blocks are of
three, written out, so that sums stay in registers; smaller ones are filled up with zeros.
"""

import numpy as np
from numba import njit

_FUSED = {"contract"}  # multiply and add in one, rounded once


def upper_pattern(starts, columns, diagonal):
    """First block and columns of each row above the diagonal, and the places of these blocks.

    Columns are unsigned: no index is negative.
    """
    above = np.flatnonzero(columns > np.repeat(np.arange(len(diagonal)), np.diff(starts)))
    count = starts[1:] - diagonal - 1
    return np.concatenate([[0], np.cumsum(count)]), columns[above].astype(np.uint32), above


@njit(cache=True, fastmath=_FUSED)
def solve_upper(starts, columns, upper, inverse, p, t, e, u):
    """Find t = (D + Lᵀ)⁻¹ p, with e = Lᵀ t and u = D t = p − e.

    Parameters
    ----------
    starts, columns : int arrays
        As of `upper_pattern`.
    upper : (B, 3, 3) float array
        Blocks above the diagonal.
    inverse : (N, 3, 3) float array
        Of the diagonal blocks.
    p : (N, 3) float array
    t, e, u : (N, 3) float array
        Overwritten.
    """
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


@njit(cache=True, fastmath=_FUSED)
def solve_lower(starts, columns, upper, inverse, g, s):
    """Find s = (D + L)⁻¹ g; of g only D s is left.

    Parameters
    ----------
    starts, columns, upper, inverse
        As for `solve_upper`.
    g : (N, 3) float array
        Right-hand side.
    s : (N, 3) float array
        Overwritten.
    """
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


@njit(inline="always")
def add_lower_product(starts, columns, upper, s, out):
    """Add L s (N, 3) to `out`."""
    for row in range(len(s)):
        for at in range(starts[row], starts[row + 1]):
            for k in range(3):
                for l in range(3):
                    out[columns[at], l] += upper[at, k, l] * s[row, k]


@njit(inline="always")
def subtract_product(starts, columns, upper, diagonal, x, out):
    """Subtract K x (N, 3) from `out`, with the diagonal blocks (N, 3, 3)."""
    for row in range(len(x)):
        for k in range(3):
            for l in range(3):
                out[row, k] -= diagonal[row, k, l] * x[row, l]
                for at in range(starts[row], starts[row + 1]):
                    out[row, k] -= upper[at, k, l] * x[columns[at], l]
                    out[columns[at], l] -= upper[at, k, l] * x[row, k]
