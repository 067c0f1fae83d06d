"""Nearly symmetric matrices: Cholesky factorisation and refinement, LU where that does not do."""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky import Cholesky
from verify.xfem.arrays import check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.errors import SingularStiffnessError
from verify.xfem.linear_solvers import LinearSolver, SparseLU, nodal_vector

_Floats = NDArray[np.float64]

_REFINED = 1e-9  # residual over load: the rounding of a Newton correction, not of a solution
_REFINEMENTS = 12
_RESPITE = 16  # factorisations that go straight to LU after one that needed it


class NearlySymmetric(LinearSolver):
    """Cholesky factorisation of the symmetric part, and refinement; LU where that does not do.

    The stiffness of a conserving step is symmetric but for the square of the step; with the mass
    its symmetric part is positive definite as long as the step resolves the motion.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.

    Attributes
    ----------
    pivoted : int
        Factorisations so far that needed the LU.
    """

    def __init__(self, pattern: BlockPattern, block: int) -> None:
        self._pattern, self._block = pattern, block
        self._symmetric = Cholesky(pattern, block)
        self._general = SparseLU(pattern, block)
        self._blocks: _Floats | None = None
        self._is_general = False
        self._respite = 0
        self.pivoted = 0

    def factorize(self, blocks: _Floats) -> None:
        """Factorise; see `LinearSolver`."""
        check_floats("blocks", blocks, (len(self._pattern.columns), self._block, self._block))
        self._blocks, self._is_general = blocks, False
        if self._respite > 0:
            self._respite -= 1
            self._pivot()
            return
        transposed = blocks[self._pattern.mirror].transpose(0, 2, 1)
        try:
            self._symmetric.factorize(0.5 * (blocks + transposed))
        except SingularStiffnessError:
            self._respite = _RESPITE
            self._pivot()

    def _pivot(self) -> None:
        assert self._blocks is not None
        self._general.factorize(self._blocks)
        self._is_general = True
        self.pivoted += 1

    def solve(self, load: _Floats, x: _Floats | None = None) -> _Floats:
        """Solve; see `LinearSolver`."""
        if self._blocks is None:
            raise RuntimeError("solve before factorize")
        load = nodal_vector(load, "right-hand side", self._pattern.node_count, self._block)
        if not self._is_general:
            solution = self._refine(load)
            if solution is not None:
                if x is not None:
                    x[:] = solution
                return solution
            self._respite = _RESPITE
            self._pivot()
        return self._general.solve(load, x)

    def _refine(self, load: _Floats) -> _Floats | None:
        """Solution by refinement, or nothing where that does not halve the residual each time."""
        assert self._blocks is not None
        matrix = self._pattern.matrix(self._blocks)
        # as displacements: the rows of slivers are many orders smaller than the others
        diagonal = np.abs(self._blocks[self._pattern.diagonal]).max(axis=(1, 2))[:, None]
        size = float(np.linalg.norm(load / diagonal))
        solution = self._symmetric.solve(load)
        before = np.inf
        for _ in range(_REFINEMENTS):
            residual = load - (matrix @ solution.ravel()).reshape(load.shape)
            norm = float(np.linalg.norm(residual / diagonal))
            if norm <= _REFINED * size:
                return solution
            if not norm < 0.5 * before:
                return None
            solution += self._symmetric.solve(residual)
            before = norm
        return None
