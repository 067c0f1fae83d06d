"""Conjugate gradients preconditioned by symmetric Gauß–Seidel on nodal blocks, with a warm start.

Scaling by nodal blocks bounds the condition number of the side-wise unknowns whatever the size of
the slivers. Gauß–Seidel does not depend on such a scaling, so the number of iterations does not see
them either.

The loops are compiled, of K = L + D + Lᵀ, and allocate nothing. The sweeps read the blocks above
the diagonal, which lie one after the other in a memory of their own: read forwards and backwards
without gaps, they arrive before they are asked for. Blocks are of three, written out, so that sums
stay in registers; smaller ones are filled up with zeros.
"""

import numpy as np
from numba import njit

from verify.xfem.arrays import (
    Floats,
    NotConvergedError,
    SingularStiffnessError,
    XfemError,
    check_floats,
)
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.linear_solvers import LinearSolver, nodal_vector

_SMALLEST, _LARGEST = 1e-200, 1e200  # squares of loads that are solved for as they are


class ConjugateGradients(LinearSolver):
    """Iterative solver of K x = b for symmetric positive definite K in nodal blocks.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    tolerance : float
        Of the residual relative to the right-hand side, 2-norm.
    limit : int
        Most iterations.

    Attributes
    ----------
    tolerance, limit : float, int
        Of the next solve.
    iterations : int
        Of the last solve.
    """

    reads_half = is_iterative = True

    def __init__(
        self, pattern: BlockPattern, block: int, tolerance: float = 1e-10, limit: int = 10_000
    ) -> None:
        if not 0.0 < tolerance < 1.0 or limit < 1:
            raise XfemError(f"tolerance {tolerance:g}, limit {limit}; expected in (0, 1) and ≥ 1")
        self._pattern, self.tolerance, self.limit = pattern, tolerance, limit
        sparsity = pattern.starts, pattern.columns, pattern.diagonal
        self._rows, self._columns, self._above = upper_pattern(*sparsity)
        # blocks of three, whatever the blocks of the matrix
        self._upper = np.zeros((len(self._columns), 3, 3))
        self._diagonal = np.tile(np.eye(3), (pattern.node_count, 1, 1))
        self._inverse = np.empty_like(self._diagonal)
        self._work = np.zeros((8, pattern.node_count, 3))
        self._block = block
        self._is_factorised = False
        self.iterations = 0

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix and invert its diagonal blocks; see `LinearSolver`."""
        size = self._block
        check_floats("blocks", blocks, (len(self._pattern.columns), size, size))
        if size == 3:
            np.take(blocks, self._above, axis=0, out=self._upper, mode="clip")
        else:
            self._upper[:, :size, :size] = blocks[self._above]
        self._diagonal[:, :size, :size] = blocks[self._pattern.diagonal]
        failed = invert_blocks(self._diagonal, self._inverse)
        self._is_factorised = failed < 0
        if failed >= 0:
            raise SingularStiffnessError(failed)

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`. With room for the solution, nothing is allocated."""
        if not self._is_factorised:
            raise RuntimeError("solve before factorize")
        nodes = self._pattern.node_count
        load = nodal_vector(load, "right-hand side", nodes, self._block)
        x = np.zeros(load.shape) if x is None else x
        if nodal_vector(x, "first guess", nodes, self._block) is not x:
            raise XfemError("first guess with gaps, or not of floats; expected room for x")
        if not load.any():
            self.iterations, x[:] = 0, 0.0
            return x
        size = float(np.vdot(load, load))
        if not _SMALLEST < size < _LARGEST:
            scale = 2.0 ** -np.frexp(np.abs(load).max())[1]
            x *= scale
            self.solve(scale * load, x)
            x /= scale
            return x
        guess, residual = self._work[:2, :, : self._block]
        guess[:], residual[:] = x, load
        iterations, square = self._improve(not x.any(), self.tolerance**2 * size)
        if iterations < 0:
            raise SingularStiffnessError(None)
        x[:] = guess
        if square > self.tolerance**2 * size:
            raise NotConvergedError(
                f"conjugate gradients: residual {np.sqrt(square / size):.3g} after {iterations} "
                f"iterations; expected {self.tolerance:g}"
            )
        self.iterations = iterations
        return x

    def _improve(self, is_zero: bool, target: float) -> tuple[int, float]:
        """Improve the first of the work vectors; see `conjugate_gradients`."""
        return conjugate_gradients(
            self._rows, self._columns, self._upper, self._diagonal, self._inverse, is_zero,
            self._work, self._work.reshape(len(self._work), -1), target, self.limit,
        )  # fmt: skip


FUSED = {"contract"}  # multiply and add in one, rounded once


def upper_pattern(starts, columns, diagonal):
    """Find first block and columns of each row above the diagonal, and the places of these blocks.

    Columns are unsigned: no index is negative.
    """
    above = np.flatnonzero(columns > np.repeat(np.arange(len(diagonal)), np.diff(starts)))
    count = starts[1:] - diagonal - 1
    return np.concatenate([[0], np.cumsum(count)]), columns[above].astype(np.uint32), above


@njit(cache=True, fastmath=FUSED)
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


@njit(cache=True, fastmath=FUSED)
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


# sums in any order, over long flat vectors, where it lets the compiler use the vector unit
SUMS = {"reassoc", "contract", "nsz"}


@njit(cache=True, error_model="numpy")
def invert_blocks(blocks, out):
    """Compute inverses of blocks (N, 3, 3); the first one that is not positive definite, or -1.

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


@njit(cache=True, fastmath=SUMS)
def conjugate_gradients(
    starts, columns, upper, diagonal, inverse, is_zero, work, flat, target, limit
):
    """Improve x (N, 3), the first of `work`, until ‖b − Kx‖² ≤ target; b is the second.

    Let K = L + D + Lᵀ. The system is (D + L)⁻¹ K (D + Lᵀ)⁻¹ x̂ = (D + L)⁻¹ b, preconditioned by D.
    It is K preconditioned by (D + L) D⁻¹ (D + Lᵀ): symmetric block Gauß–Seidel. Its product needs
    no K, as K = (D + L) + (D + Lᵀ) − D. With t = (D + Lᵀ)⁻¹ p it is t + (D + L)⁻¹ (p − D t)
    (Eisenstat, SIAM J. Sci. Stat. Comput. 2, 1981). So an iteration reads the matrix as often as
    one without preconditioning. The residual is known in the norm of the preconditioner; in the
    2-norm it is taken where that promises the end.

    Parameters
    ----------
    starts, columns, upper
        Blocks above the diagonal, as the sweeps take them.
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
