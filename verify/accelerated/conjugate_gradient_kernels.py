"""Compiled loops of the preconditioned conjugate gradients: no allocation inside."""

import numpy as np
from numba import njit

from verify.accelerated.symmetric_sweep_kernels import add_lower_product, solve_lower, solve_upper

# sums in any order, over long flat vectors, where it lets the compiler use the vector unit
_SUMS = {"reassoc", "contract", "nsz"}


@njit(cache=True, fastmath=_SUMS)
def _curvature(p, t, s, q, u, g):
    """Take q = t + s and u += g, all flat; returns p·q."""
    total = 0.0
    for i in range(len(p)):
        q[i] = t[i] + s[i]
        u[i] += g[i]
        total += p[i] * q[i]
    return total


@njit(cache=True, fastmath=_SUMS)
def _advance(alpha, t, q, u, x, r, z):
    """Take the step x += αt, r −= αq, z −= αu, all flat; returns r·z."""
    total = 0.0
    for i in range(len(x)):
        x[i] += alpha * t[i]
        r[i] -= alpha * q[i]
        z[i] -= alpha * u[i]
        total += r[i] * z[i]
    return total


@njit(cache=True, fastmath=_SUMS)
def _square(a):
    total = 0.0
    for i in range(len(a)):
        total += a[i] * a[i]
    return total


@njit(cache=True)
def symmetric_product(starts, columns, diagonal, blocks, vector, out):
    """Write K v (N, d) to `out`; blocks (B, d, d) below the diagonal are not read."""
    space = vector.shape[1]
    out[:] = 0.0
    for row in range(len(diagonal)):
        for k in range(diagonal[row], starts[row + 1]):
            column = columns[k]
            for a in range(space):
                for b in range(space):
                    out[row, a] += blocks[k, a, b] * vector[column, b]
                    if column != row:
                        out[column, b] += blocks[k, a, b] * vector[row, a]


@njit(cache=True)
def invert_blocks(blocks, diagonal, out):
    """Inverses (N, d, d) of the diagonal blocks; the first row that is not definite, or -1.

    Cholesky's factorisation of each (L D Lᵀ, written out, of blocks of three), so that a
    sliver's tiny block keeps all its digits.
    """
    dim = blocks.shape[1]
    if dim == 3:
        return _invert_blocks_3(blocks, diagonal, out)
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


@njit(cache=True, error_model="numpy")
def _invert_blocks_3(blocks, diagonal, out):
    for row in range(len(diagonal)):
        at = diagonal[row]
        b10, b20, b21 = blocks[at, 1, 0], blocks[at, 2, 0], blocks[at, 2, 1]
        d0 = blocks[at, 0, 0]
        i0 = 1.0 / d0
        l10, l20 = b10 * i0, b20 * i0
        d1 = blocks[at, 1, 1] - l10 * b10
        i1 = 1.0 / d1
        e21 = b21 - l20 * b10
        l21 = e21 * i1
        d2 = blocks[at, 2, 2] - l20 * b20 - l21 * e21
        if not (d0 > 0.0 and d1 > 0.0 and d2 > 0.0):
            return row
        i2 = 1.0 / d2
        m20 = l10 * l21 - l20  # of the inverse of L
        out[row, 0, 0] = i0 + l10 * l10 * i1 + m20 * m20 * i2
        out[row, 1, 1] = i1 + l21 * l21 * i2
        out[row, 2, 2] = i2
        out[row, 0, 1] = out[row, 1, 0] = -l10 * i1 - l21 * m20 * i2
        out[row, 0, 2] = out[row, 2, 0] = m20 * i2
        out[row, 1, 2] = out[row, 2, 1] = -l21 * i2
    return -1


@njit(cache=True)
def conjugate_gradients(
    starts, columns, diagonal, blocks, upper_starts, upper_columns, upper, inverse, load, x,
    is_zero, work, flat, tolerance, limit,
):  # fmt: skip
    """Improve x (N, d) in place until ‖b − Kx‖ ≤ tolerance·‖b‖, in the 2-norm.

    With K = L + D + Lᵀ, of the system (D + L)⁻¹ K (D + Lᵀ)⁻¹ x̂ = (D + L)⁻¹ b, preconditioned by D,
    which is K preconditioned by (D + L) D⁻¹ (D + Lᵀ), block Gauß–Seidel there and back. Its
    product needs no K: K = (D + L) + (D + Lᵀ) − D, so with t = (D + Lᵀ)⁻¹ p it is
    t + (D + L)⁻¹ (p − D t) (Eisenstat, SIAM J. Sci. Stat. Comput. 2, 1981): an iteration reads the
    matrix as often as one without preconditioning. The residual is known in the norm of the
    preconditioner; in the 2-norm it is taken where that promises the end.

    Parameters
    ----------
    starts, columns, diagonal, blocks
        The matrix; what is below its diagonal is not read.
    upper_starts, upper_columns, upper
        What is above it, as the sweeps take it.
    inverse : (N, d, d) float array
        Of the diagonal blocks.
    load, x : (N, d) float array
    is_zero : bool
        Whether x is, so that the first residual is the load.
    work : (8, N, d) float array
    flat : (8, N·d) float array
        The same memory.

    Returns
    -------
    iterations : int
    residual : float
        ‖b − Kx‖/‖b‖ by the recurrence.
    """
    r, z, p, t, q, u, g = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    y = work[7]  # the solution
    flat_r, flat_z, flat_p, flat_t = flat[0], flat[1], flat[2], flat[3]
    flat_q, flat_u, flat_g, flat_y = flat[4], flat[5], flat[6], flat[7]
    size = 0.0
    for row in range(load.shape[0]):
        for k in range(load.shape[1]):
            y[row, k] = x[row, k]
            size += load[row, k] * load[row, k]
    if size == 0.0:
        for row in range(load.shape[0]):
            for k in range(load.shape[1]):
                x[row, k] = 0.0
        return 0, 0.0
    if is_zero:
        flat_z[:] = 0.0
    else:
        symmetric_product(starts, columns, diagonal, blocks, y, z)
    for row in range(load.shape[0]):
        for k in range(load.shape[1]):
            z[row, k] = load[row, k] - z[row, k]
    target, norm = tolerance**2 * size, _square(flat_z)
    if norm <= target or limit == 0:
        return 0, np.sqrt(norm / size)
    solve_lower(upper_starts, upper_columns, upper, inverse, z, r)  # z becomes D r
    rho = 0.0
    for i in range(len(flat_z)):
        flat_p[i] = flat_z[i]
        rho += flat_r[i] * flat_z[i]
    promise = rho * target / norm
    for iteration in range(1, limit + 1):
        solve_upper(upper_starts, upper_columns, upper, inverse, p, t, g, u)
        solve_lower(upper_starts, upper_columns, upper, inverse, g, q)
        curvature = _curvature(flat_p, flat_t, flat_q, flat_q, flat_u, flat_g)
        if not curvature > 0.0:
            return -1, np.sqrt(norm / size)
        old = rho
        rho = _advance(rho / curvature, flat_t, flat_q, flat_u, flat_y, flat_r, flat_z)
        # round-off may leave a rho that is no square: the iteration has broken down
        broken = not rho > 0.0
        if rho <= promise or iteration == limit or broken:
            for i in range(len(flat_z)):  # not a slice: numba would compile its words for a misfit
                flat_t[i] = flat_z[i]
            add_lower_product(upper_starts, upper_columns, upper, r, t)
            norm = _square(flat_t)
            if norm <= target or iteration == limit or broken:
                for row in range(x.shape[0]):
                    for k in range(x.shape[1]):
                        x[row, k] = y[row, k]
                return iteration, np.sqrt(norm / size)
            promise = rho * target / norm
        beta = rho / old
        for i in range(len(flat_p)):
            flat_p[i] = flat_z[i] + beta * flat_p[i]
    return limit, np.sqrt(norm / size)
