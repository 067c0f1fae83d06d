"""Conjugate gradients preconditioned by symmetric Gauß–Seidel on nodal blocks, with a warm start.

Scaling by nodal blocks bounds the condition number of the side-wise unknowns whatever the size of
the slivers. Gauß–Seidel does not depend on such a scaling, so the number of iterations does not see
them either.
"""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.conjugate_gradient_kernels import conjugate_gradients, invert_blocks
from verify.accelerated.symmetric_sweep_kernels import take_upper, upper_pattern
from verify.xfem.arrays import check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.errors import NotConvergedError, SingularStiffnessError, XfemError
from verify.xfem.linear_solvers import LinearSolver, nodal_vector

_Floats = NDArray[np.float64]

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
        self._rows, self._columns = upper_pattern(pattern.starts, pattern.columns, pattern.diagonal)
        self._upper = np.empty((len(self._columns), block, block))
        self._inverse = np.zeros((pattern.node_count, block, block))
        self._work = np.zeros((8, pattern.node_count, block))
        self._block = block
        self._blocks: _Floats | None = None
        self.iterations = 0

    def factorize(self, blocks: _Floats) -> None:
        """Take the matrix and invert its diagonal blocks; see `LinearSolver`."""
        check_floats("blocks", blocks, (len(self._pattern.columns), self._block, self._block))
        failed = invert_blocks(blocks, self._pattern.diagonal, self._inverse)
        if failed >= 0:
            raise SingularStiffnessError(failed)
        self._blocks = np.ascontiguousarray(blocks)
        take_upper(self._pattern.starts, self._pattern.diagonal, self._blocks, self._upper)

    def solve(self, load: _Floats, x: _Floats | None = None) -> _Floats:
        """Solve; see `LinearSolver`. With room for the solution, nothing is allocated."""
        if self._blocks is None:
            raise RuntimeError("solve before factorize")
        pattern, nodes = self._pattern, self._pattern.node_count
        load = nodal_vector(load, "right-hand side", nodes, self._block)
        x = np.zeros(load.shape) if x is None else x
        if nodal_vector(x, "first guess", nodes, self._block) is not x:
            raise XfemError("first guess with gaps, or not of floats; expected room for x")
        if not _SMALLEST < np.vdot(load, load) < _LARGEST and load.any():
            scale = 2.0 ** -np.frexp(np.abs(load).max())[1]
            x *= scale
            self.solve(scale * load, x)
            x /= scale
            return x
        iterations, residual = conjugate_gradients(
            pattern.starts, pattern.columns, pattern.diagonal, self._blocks, self._rows,
            self._columns, self._upper, self._inverse, load, x, not x.any(), self._work,
            self._work.reshape(len(self._work), -1), self.tolerance, self.limit,
        )  # fmt: skip
        if iterations < 0:
            raise SingularStiffnessError(None)
        if residual > self.tolerance:
            raise NotConvergedError(
                f"conjugate gradients: residual {residual:.3g} after {iterations} iterations; "
                f"expected {self.tolerance:g}"
            )
        self.iterations = iterations
        return x
