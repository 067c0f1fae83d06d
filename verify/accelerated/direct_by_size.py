"""Factorisation by SciPy or by `Cholesky`: SciPy's for a few solutions with a small matrix.

SciPy needs milliseconds more for each, but nothing has to be compiled, which takes ten seconds at
the first use of `Cholesky`. Factorisations are counted, not timed, so that the same load steps take
the same way twice.
"""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky import Cholesky
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.linear_solvers import LinearSolver, SparseLU

_Floats = NDArray[np.float64]

# where SuperLU takes about 30 ms more than `Cholesky` (benchmarks/test_xfem_static compares them)
_SMALL = 110_000  # entries of the matrix: 4000 nodes in the plane, 900 in space
_FEW = 8  # factorisations, a quarter of a second at most


class DirectBySize(LinearSolver):
    """Solver of K x = b for symmetric positive definite K in nodal blocks.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    held : (N,) bool array, optional
        As of `Cholesky`.
    """

    def __init__(
        self, pattern: BlockPattern, block: int, held: NDArray[np.bool_] | None = None
    ) -> None:
        self._problem = pattern, block, held
        self._count = 0
        self._solver: LinearSolver
        if len(pattern.columns) * block**2 <= _SMALL:
            self._solver = SparseLU(pattern, block, definite=True)
        else:
            self._solver = Cholesky(*self._problem)

    def factorize(self, blocks: _Floats) -> None:
        """Factorise; see `LinearSolver`."""
        self._count += 1
        if self._count > _FEW and isinstance(self._solver, SparseLU):
            self._solver = Cholesky(*self._problem)
        self._solver.factorize(blocks)

    def solve(self, load: _Floats, x: _Floats | None = None) -> _Floats:
        """Solve; see `LinearSolver`."""
        return self._solver.solve(load, x)
