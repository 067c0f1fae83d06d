"""Conjugate gradients preconditioned by symmetric Gauß–Seidel on nodal blocks, with a warm start.

Scaling by nodal blocks bounds the condition number of the side-wise unknowns whatever the size of
the slivers. Gauß–Seidel does not depend on such a scaling, so the number of iterations does not see
them either.
"""

import numpy as np

from verify.accelerated.conjugate_gradient_kernels import (
    conjugate_gradients,
    invert_blocks,
    upper_pattern,
)
from verify.xfem.arrays import Floats, check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.errors import NotConvergedError, SingularStiffnessError, XfemError
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

    reads_half = True

    def __init__(
        self, pattern: BlockPattern, block: int, tolerance: float = 1e-10, limit: int = 10_000
    ) -> None:
        if not 0.0 < tolerance < 1.0 or limit < 1:
            raise XfemError(f"tolerance {tolerance:g}, limit {limit}; expected in (0, 1) and ≥ 1")
        self._pattern, self.tolerance, self.limit = pattern, tolerance, limit
        sparsity = pattern.starts, pattern.columns, pattern.diagonal
        self._rows, self._columns, self._above = upper_pattern(*sparsity)
        # blocks of three, whatever those of the matrix are
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
        iterations, square = conjugate_gradients(
            self._rows, self._columns, self._upper, self._diagonal, self._inverse, not x.any(),
            self._work, self._work.reshape(len(self._work), -1), self.tolerance**2 * size,
            self.limit,
        )  # fmt: skip
        if iterations < 0:
            raise SingularStiffnessError(None)
        if iterations > 0:
            x[:] = guess
        if square > self.tolerance**2 * size:
            raise NotConvergedError(
                f"conjugate gradients: residual {np.sqrt(square / size):.3g} after {iterations} "
                f"iterations; expected {self.tolerance:g}"
            )
        self.iterations = iterations
        return x
