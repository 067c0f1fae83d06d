"""Conjugate gradients preconditioned by symmetric Gauß–Seidel on nodal blocks, with a warm start.

Scaling by nodal blocks bounds the condition number of the side-wise unknowns whatever the size of
the slivers. Gauß–Seidel does not depend on such a scaling, so the number of iterations does not see
them either.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.errors import XfemError
from verify.xfem.sparse.block_pattern import BlockPattern
from verify.xfem.sparse.cholesky import SingularStiffnessError
from verify.xfem.sparse.conjugate_gradient_kernels import conjugate_gradients, invert_blocks
from verify.xfem.sparse.symmetric_sweep_kernels import vector_width
from verify.xfem.sparse.system_shapes import (
    check_blocks,
    checked_load,
    checked_start,
    largest_entry,
)

__all__ = ["ConjugateGradients", "NotConvergedError"]

_Floats = NDArray[np.float64]

_SMALLEST, _LARGEST = 1e-200, 1e200  # squares of loads that are solved for as they are


class NotConvergedError(XfemError):
    """The iterations ran out before the residual was small enough."""


class ConjugateGradients:
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

    def __init__(
        self, pattern: BlockPattern, block: int, tolerance: float = 1e-10, limit: int = 10_000
    ) -> None:
        if not 0.0 < tolerance < 1.0 or limit < 1:
            raise XfemError(f"tolerance {tolerance:g}, limit {limit}; expected in (0, 1) and ≥ 1")
        self._pattern, self.tolerance, self.limit = pattern, tolerance, limit
        width = vector_width(block)
        self._inverse = np.zeros((pattern.node_count, block, width))
        self._work = np.zeros((8, pattern.node_count, width))
        self._block = block
        self._blocks: _Floats | None = None
        self.iterations = 0

    def factorize(self, blocks: _Floats) -> None:
        """Take the matrix with these blocks (B, d, d), kept by reference.

        Raises
        ------
        SingularStiffnessError
            If a nodal block is not positive definite.
        XfemError
            If the blocks are not those of the pattern.
        """
        check_blocks(blocks, len(self._pattern.columns), self._block)
        failed = invert_blocks(blocks, self._pattern.diagonal, self._inverse)
        if failed >= 0:
            raise SingularStiffnessError(failed)
        self._blocks = np.ascontiguousarray(blocks)

    def solve(self, load: _Floats, start: _Floats | None = None) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d), from a first guess.

        Raises
        ------
        SingularStiffnessError
            If the matrix turns out not to be positive definite.
        NotConvergedError
            If the iterations run out.
        XfemError
            If a shape is wrong or a number is not finite.
        RuntimeError
            If nothing was factorised before.
        """
        x = np.empty(np.shape(load))
        self.improve(load, x, start)
        return x

    def improve(self, load: _Floats, x: _Floats, start: _Floats | None = None) -> None:
        """Overwrite x (N, d) with the solution, from a first guess (x itself, or by default 0).

        Nothing is allocated. Errors are those of `solve`.
        """
        if self._blocks is None:
            raise RuntimeError("solve before factorize")
        pattern, nodes = self._pattern, self._pattern.node_count
        load = checked_load(load, nodes, self._block)
        if x.shape != load.shape:
            raise XfemError(f"room for a solution of shape {x.shape}; expected {load.shape}")
        if start is None:
            x[:] = 0.0
        elif start is not x:
            x[:] = checked_start(start, nodes, self._block)
        if not _SMALLEST < np.vdot(load, load) < _LARGEST and load.any():
            scale = 2.0 ** -np.frexp(largest_entry(load))[1]
            x *= scale
            self.improve(scale * load, x, x)
            x /= scale
            return
        iterations, residual = conjugate_gradients(
            pattern.starts, pattern.columns, pattern.diagonal, self._blocks, self._inverse,
            load, x, start is None, self._work, self.tolerance, self.limit,
        )  # fmt: skip
        if iterations < 0:
            raise SingularStiffnessError(None)
        if residual > self.tolerance:
            raise NotConvergedError(
                f"conjugate gradients: residual {residual:.3g} after {iterations} iterations; "
                f"expected {self.tolerance:g}"
            )
        self.iterations = iterations
