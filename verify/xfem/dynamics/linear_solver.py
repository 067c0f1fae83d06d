"""The linear solvers that an implicit step needs: factorise nodal blocks, solve."""

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from verify.xfem.dynamics.body import DynamicBody
from verify.xfem.sparse.block_pattern import BlockPattern
from verify.xfem.sparse.cholesky import Cholesky, SingularStiffnessError
from verify.xfem.sparse.solver_by_cost import SolverByCost
from verify.xfem.sparse.system_shapes import check_blocks, checked_load

__all__ = ["LinearSolver", "NearlySymmetric", "SparseLU", "default_solver"]

_Floats = NDArray[np.float64]

_REFINED = 1e-9  # residual over load: the rounding of a Newton correction, not of a solution
_REFINEMENTS = 12
_RESPITE = 16  # factorisations that go straight to LU after one that needed it


class LinearSolver(Protocol):
    """Solver whose analysis of the sparsity is kept between factorisations."""

    def factorize(self, blocks: _Floats) -> None:
        """Factorise the matrix with these nodal blocks (B, d, d)."""
        ...

    def solve(self, load: _Floats) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d)."""
        ...


def default_solver(body: DynamicBody, tolerance: float) -> SolverByCost:
    """Make the solver that has least to do for a body; the tolerance is that of iterations."""
    solid = body.force.virtual.cells.shape[1] == 4
    held = body.fixed.all(axis=1)
    return SolverByCost(body.pattern, body.shape[1], held, solid, tolerance)


class SparseLU:
    """LU factorisation with pivoting, for matrices that are not symmetric.

    Rows and columns are scaled by the diagonal before: those of a sliver are many orders smaller
    than others, and a pivot among numbers of both sizes would lose them.

    Parameters
    ----------
    pattern : BlockPattern
    """

    def __init__(self, pattern: BlockPattern) -> None:
        self._pattern = pattern
        self._factor: SuperLU | None = None
        self._scale: _Floats | None = None
        self._block = 0

    def factorize(self, blocks: _Floats) -> None:
        """Factorise the matrix with these nodal blocks (B, d, d).

        Raises
        ------
        SingularStiffnessError
            If it is singular or not finite.
        XfemError
            If the blocks are not those of the pattern.
        """
        check_blocks(blocks, len(self._pattern.columns), blocks.shape[-1])
        self._block = blocks.shape[-1]
        matrix = self._pattern.matrix(blocks)
        diagonal = np.abs(matrix.diagonal())
        self._scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        scaling = diags_array(self._scale)
        try:
            self._factor = splu(csc_array(scaling @ matrix @ scaling))
        except RuntimeError as failure:
            raise SingularStiffnessError(None) from failure

    def solve(self, load: _Floats) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d).

        Raises
        ------
        XfemError
            If the right-hand side has another shape or is not finite.
        RuntimeError
            If nothing was factorised before.
        """
        if self._factor is None or self._scale is None:
            raise RuntimeError("solve before factorize")
        load = checked_load(load, self._pattern.node_count, self._block)
        scaled = self._factor.solve(self._scale * load.ravel())
        return np.asarray(self._scale * scaled).reshape(load.shape)


class NearlySymmetric:
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
        self._general = SparseLU(pattern)
        self._blocks: _Floats | None = None
        self._is_general = False
        self._respite = 0
        self.pivoted = 0

    def factorize(self, blocks: _Floats) -> None:
        """Factorise the matrix with these nodal blocks (B, d, d), kept by reference.

        Raises
        ------
        SingularStiffnessError
            If it is singular or not finite.
        XfemError
            If the blocks are not those of the pattern.
        """
        check_blocks(blocks, len(self._pattern.columns), self._block)
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

    def solve(self, load: _Floats) -> _Floats:
        """Solution (N, d) for a right-hand side (N, d).

        Raises
        ------
        SingularStiffnessError
            If it is singular.
        XfemError
            If the right-hand side has another shape or is not finite.
        RuntimeError
            If nothing was factorised before.
        """
        if self._blocks is None:
            raise RuntimeError("solve before factorize")
        load = checked_load(load, self._pattern.node_count, self._block)
        if not self._is_general:
            solution = self._refine(load)
            if solution is not None:
                return solution
            self._respite = _RESPITE
            self._pivot()
        return self._general.solve(load)

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
