"""Compiled loops of the preconditioned conjugate gradients: no allocation inside."""

from numba import njit

from verify.accelerated.symmetric_sweep_kernels import (
    add_lower_product,
    solve_lower,
    solve_upper,
    subtract_product,
)

# sums in any order, over long flat vectors, where it lets the compiler use the vector unit
_SUMS = {"reassoc", "contract", "nsz"}


@njit(cache=True, error_model="numpy")
def invert_blocks(blocks, out):
    """Inverses of blocks (N, 3, 3); the first one that is not positive definite, or -1.

    Factorised as L D Lᵀ, so that a sliver's tiny block keeps all its digits.
    """
    for row in range(len(blocks)):
        b10, b20, b21 = blocks[row, 1, 0], blocks[row, 2, 0], blocks[row, 2, 1]
        d0 = blocks[row, 0, 0]
        i0 = 1.0 / d0
        l10, l20 = b10 * i0, b20 * i0
        d1 = blocks[row, 1, 1] - l10 * b10
        i1 = 1.0 / d1
        e21 = b21 - l20 * b10
        l21 = e21 * i1
        d2 = blocks[row, 2, 2] - l20 * b20 - l21 * e21
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


@njit(cache=True, fastmath=_SUMS)
def conjugate_gradients(
    starts, columns, upper, diagonal, inverse, is_zero, work, flat, target, limit
):
    """Improve x (N, 3), the first of `work`, until ‖b − Kx‖² ≤ target; b is the second.

    With K = L + D + Lᵀ, of the system (D + L)⁻¹ K (D + Lᵀ)⁻¹ x̂ = (D + L)⁻¹ b, preconditioned by D,
    which is K preconditioned by (D + L) D⁻¹ (D + Lᵀ), block Gauß–Seidel there and back. Its
    product needs no K: K = (D + L) + (D + Lᵀ) − D, so with t = (D + Lᵀ)⁻¹ p it is
    t + (D + L)⁻¹ (p − D t) (Eisenstat, SIAM J. Sci. Stat. Comput. 2, 1981): an iteration reads the
    matrix as often as one without preconditioning. The residual is known in the norm of the
    preconditioner; in the 2-norm it is taken where that promises the end.

    Parameters
    ----------
    starts, columns, upper
        What is above the diagonal, as the sweeps take it.
    diagonal, inverse : (N, 3, 3) float array
        Blocks, and their inverses.
    is_zero : bool
        Whether x is, so that the first residual is the load.
    work : (8, N, 3) float array
    flat : (8, 3 N) float array
        The same memory.

    Returns
    -------
    iterations : int
        -1 if the matrix is not positive definite.
    square : float
        ‖b − Kx‖² by the recurrence.
    """
    x, z, r, p, t, q, u, g = flat[0], flat[1], flat[2], flat[3], flat[4], flat[5], flat[6], flat[7]
    if not is_zero:
        subtract_product(starts, columns, upper, diagonal, work[0], work[1])
    square = rho = 0.0
    for i in range(len(z)):
        square += z[i] * z[i]
    if square <= target or limit == 0:
        return 0, square
    solve_lower(starts, columns, upper, inverse, work[1], work[2])  # z becomes D r
    for i in range(len(z)):
        p[i] = z[i]
        rho += r[i] * z[i]
    promise = rho * target / square
    for iteration in range(1, limit + 1):
        solve_upper(starts, columns, upper, inverse, work[3], work[4], work[7], work[6])
        solve_lower(starts, columns, upper, inverse, work[7], work[5])
        curvature = 0.0
        for i in range(len(p)):
            q[i] += t[i]
            u[i] += g[i]
            curvature += p[i] * q[i]
        if not curvature > 0.0:
            return -1, square
        old, alpha, rho = rho, rho / curvature, 0.0
        for i in range(len(x)):
            x[i] += alpha * t[i]
            r[i] -= alpha * q[i]
            z[i] -= alpha * u[i]
            rho += r[i] * z[i]
        # round-off may leave a rho that is no square: the iteration has broken down
        broken = not rho > 0.0
        if rho <= promise or iteration == limit or broken:
            for i in range(len(z)):
                t[i] = z[i]
            add_lower_product(starts, columns, upper, work[2], work[4])
            square = 0.0
            for i in range(len(t)):
                square += t[i] * t[i]
            if square <= target or iteration == limit or broken:
                return iteration, square
            promise = rho * target / square
        beta = rho / old
        for i in range(len(p)):
            p[i] = z[i] + beta * p[i]
    return limit, square
