"""Sweeps over the upper half of a symmetric matrix in nodal blocks, K = L + D + Lᵀ.

Only blocks above the diagonal are read, those of a row as they lie, forwards and backwards: where
the cache holds most of them, the sweep back finds what the sweep there has left. The loops for
blocks of three are written out; others take general ones.
"""

import numpy as np
from numba import njit

__all__ = ["add_lower_product", "solve_lower", "solve_upper", "symmetric_product"]

_FUSED = {"contract"}


@njit(cache=True, fastmath=_FUSED, inline="always")
def _add_product(blocks, at, x, column, a, b, c):
    """Add block `at`, of three, times the vector at a column to (a, b, c)."""
    u, v, w = x[column, 0], x[column, 1], x[column, 2]
    return (
        a + blocks[at, 0, 0] * u + blocks[at, 0, 1] * v + blocks[at, 0, 2] * w,
        b + blocks[at, 1, 0] * u + blocks[at, 1, 1] * v + blocks[at, 1, 2] * w,
        c + blocks[at, 2, 0] * u + blocks[at, 2, 1] * v + blocks[at, 2, 2] * w,
    )


@njit(cache=True, fastmath=_FUSED)
def solve_upper(starts, columns, diagonal, blocks, inverse, p, t, e, u):
    """Find t = (D + Lᵀ)⁻¹ p, with e = Lᵀ t and u = D t = p − e.

    Parameters
    ----------
    starts, columns, diagonal : int arrays
        Pattern.
    blocks : (B, d, d) float array
    inverse : (N, d, d) float array
        Of the diagonal blocks.
    p : (N, d) float array
    t, e, u : (N, d) float array
        Overwritten.
    """
    if blocks.shape[1] != 3:
        _solve_upper(starts, columns, diagonal, blocks, inverse, p, t, e, u)
        return
    for row in range(len(diagonal) - 1, -1, -1):
        a = b = c = 0.0
        # backwards: the neighbour whose value is the last to be known comes last
        for back in range(starts[row + 1] - 1 - diagonal[row]):
            at = np.uint64(starts[row + 1] - 1 - back)
            column = np.uint64(columns[at])
            a, b, c = _add_product(blocks, at, t, column, a, b, c)
        e[row, 0], e[row, 1], e[row, 2] = a, b, c
        x, y, z = p[row, 0] - a, p[row, 1] - b, p[row, 2] - c
        u[row, 0], u[row, 1], u[row, 2] = x, y, z
        t[row, 0] = inverse[row, 0, 0] * x + inverse[row, 0, 1] * y + inverse[row, 0, 2] * z
        t[row, 1] = inverse[row, 1, 0] * x + inverse[row, 1, 1] * y + inverse[row, 1, 2] * z
        t[row, 2] = inverse[row, 2, 0] * x + inverse[row, 2, 1] * y + inverse[row, 2, 2] * z


@njit(cache=True)
def _solve_upper(starts, columns, diagonal, blocks, inverse, p, t, e, u):
    size = blocks.shape[1]
    for row in range(len(diagonal) - 1, -1, -1):
        for k in range(size):
            e[row, k] = 0.0
            for at in range(diagonal[row] + 1, starts[row + 1]):
                for l in range(size):
                    e[row, k] += blocks[at, k, l] * t[columns[at], l]
            u[row, k] = p[row, k] - e[row, k]
        for k in range(size):
            t[row, k] = 0.0
            for l in range(size):
                t[row, k] += inverse[row, k, l] * u[row, l]


@njit(cache=True, fastmath=_FUSED)
def solve_lower(starts, columns, diagonal, blocks, inverse, g, s):
    """Find s = (D + L)⁻¹ g; of g only D s is left.

    Parameters
    ----------
    starts, columns, diagonal, blocks, inverse
        As for `solve_upper`.
    g : (N, d) float array
        Right-hand side.
    s : (N, d) float array
        Overwritten.
    """
    if blocks.shape[1] != 3:
        _solve_lower(starts, columns, diagonal, blocks, inverse, g, s)
        return
    for row in range(len(diagonal)):
        a, b, c = g[row, 0], g[row, 1], g[row, 2]
        x = inverse[row, 0, 0] * a + inverse[row, 0, 1] * b + inverse[row, 0, 2] * c
        y = inverse[row, 1, 0] * a + inverse[row, 1, 1] * b + inverse[row, 1, 2] * c
        z = inverse[row, 2, 0] * a + inverse[row, 2, 1] * b + inverse[row, 2, 2] * c
        s[row, 0], s[row, 1], s[row, 2] = x, y, z
        for at in range(np.uint64(diagonal[row] + 1), np.uint64(starts[row + 1])):
            j = np.uint64(columns[at])
            g[j, 0] -= blocks[at, 0, 0] * x + blocks[at, 1, 0] * y + blocks[at, 2, 0] * z
            g[j, 1] -= blocks[at, 0, 1] * x + blocks[at, 1, 1] * y + blocks[at, 2, 1] * z
            g[j, 2] -= blocks[at, 0, 2] * x + blocks[at, 1, 2] * y + blocks[at, 2, 2] * z


@njit(cache=True)
def _solve_lower(starts, columns, diagonal, blocks, inverse, g, s):
    size = blocks.shape[1]
    for row in range(len(diagonal)):
        for k in range(size):
            s[row, k] = 0.0
            for l in range(size):
                s[row, k] += inverse[row, k, l] * g[row, l]
        for at in range(diagonal[row] + 1, starts[row + 1]):
            for k in range(size):
                for l in range(size):
                    g[columns[at], l] -= blocks[at, k, l] * s[row, k]


@njit(cache=True, fastmath=_FUSED)
def add_lower_product(starts, columns, diagonal, blocks, s, out):
    """Add L s (N, d) to `out`."""
    size = blocks.shape[1]
    for row in range(len(diagonal)):
        for at in range(np.uint64(diagonal[row] + 1), np.uint64(starts[row + 1])):
            j = np.uint64(columns[at])
            if size == 3:
                x, y, z = s[row, 0], s[row, 1], s[row, 2]
                out[j, 0] += blocks[at, 0, 0] * x + blocks[at, 1, 0] * y + blocks[at, 2, 0] * z
                out[j, 1] += blocks[at, 0, 1] * x + blocks[at, 1, 1] * y + blocks[at, 2, 1] * z
                out[j, 2] += blocks[at, 0, 2] * x + blocks[at, 1, 2] * y + blocks[at, 2, 2] * z
            else:
                for k in range(size):
                    for l in range(size):
                        out[j, l] += blocks[at, k, l] * s[row, k]


@njit(cache=True, fastmath=_FUSED)
def symmetric_product(starts, columns, diagonal, blocks, x, out):
    """Write K x (N, d) to `out`."""
    size = blocks.shape[1]
    for row in range(len(diagonal)):
        if size == 3:
            a = b = c = 0.0
            for at in range(np.uint64(diagonal[row]), np.uint64(starts[row + 1])):
                a, b, c = _add_product(blocks, at, x, np.uint64(columns[at]), a, b, c)
            out[row, 0], out[row, 1], out[row, 2] = a, b, c
            continue
        for k in range(size):
            out[row, k] = 0.0
            for at in range(diagonal[row], starts[row + 1]):
                for l in range(size):
                    out[row, k] += blocks[at, k, l] * x[columns[at], l]
    add_lower_product(starts, columns, diagonal, blocks, x, out)
