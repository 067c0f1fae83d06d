"""Sparse Cholesky factorisation of nodal blocks, with the symbolic analysis kept.

A multifrontal method (Duff & Reid 1983), ordered by minimum degree on nodes. Everything that
depends on the sparsity only (order, fronts, where each block goes) is found once per topology;
`Cholesky.factorize` then runs over values alone. No pivoting: the stiffness of a supported body is
positive definite. The error of a Cholesky factorisation does not depend on diagonal scaling, so
slivers do not hurt it (Higham 2002, section 10.1). `NearlySymmetric` factorises the symmetric part
and refines, and takes LU where that does not converge.
"""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky_kernels import BAND, factorise_fronts, solve_fronts
from verify.accelerated.fronts import plan_fronts, stack_depths
from verify.xfem.arrays import Floats, SingularStiffnessError, XfemError, check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.linear_solvers import LinearSolver, SparseLU, nodal_vector


class Cholesky(LinearSolver):
    """Solver of K x = b for symmetric positive definite K in nodal blocks.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    held : (N,) bool array, optional
        Nodes of which every component is held: the matrix couples them to no other, and whatever
        stands in these blocks is not read.

    Raises
    ------
    XfemError
        If the held nodes are not one bool for each node of the pattern.
    """

    def __init__(
        self, pattern: BlockPattern, block: int, held: NDArray[np.bool_] | None = None
    ) -> None:
        nodes = pattern.node_count
        held = np.zeros(nodes, dtype=bool) if held is None else held
        if held.shape != (nodes,) or held.dtype != bool:
            raise XfemError(
                f"held nodes: {held.dtype} array of shape {held.shape}; expected bool "
                f"and ({nodes},)"
            )
        self._block, self._block_count = block, len(pattern.columns)
        self._is_factorised = False
        plan = self._plan = plan_fronts(pattern.starts, pattern.columns, held)
        width, below = np.diff(plan.bounds) * block, np.diff(plan.row_start) * block
        self._work = float(width @ (width + below) ** 2)
        self._entries = int((width * (width + below) - width * (width - 1) // 2).sum())
        height = width + below
        self._offset = np.concatenate([[0], np.cumsum(width * height)])
        depths = stack_depths(plan.parent, plan.level, below**2)
        self._factor = np.empty(int(self._offset[-1]))
        self._stack, self._tops = np.empty(sum(depths)), np.array([0, depths[0]])
        self._waiting = np.empty_like(plan.parent)
        most = int(height.max(initial=0))
        self._diagonal, self._gathered = np.empty(most), np.empty(most)
        self._place = np.empty(most, dtype=np.uint64)
        products = np.maximum(
            width * below, BAND * (width + height) + (width - BAND) * (height - BAND)
        )
        self._products = np.empty(int(products.max(initial=0)))
        self._permuted = np.empty((nodes, block))

    @property
    def factor_entries(self) -> int:
        """Stored entries of the factor."""
        return self._entries

    @property
    def operations(self) -> float:
        """About the operations of a factorisation."""
        return self._work

    def factorize(self, blocks: Floats) -> None:
        """Factorise; see `LinearSolver`."""
        check_floats("blocks", blocks, (self._block_count, self._block, self._block))
        self._is_factorised = False
        failed = factorise_fronts(
            np.ascontiguousarray(blocks),
            self._plan,
            self._offset,
            self._factor,
            self._stack,
            self._tops.copy(),
            self._waiting,
            self._place,
            self._diagonal,
            self._products,
        )
        if failed >= 0:
            raise SingularStiffnessError(int(self._plan.order[failed // self._block]))
        self._is_factorised = True

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`."""
        if not self._is_factorised:
            raise RuntimeError("solve before factorize")
        load = nodal_vector(load, "right-hand side", len(self._plan.order), self._block)
        solution = np.empty(load.shape) if x is None else x
        np.take(load, self._plan.order, axis=0, out=self._permuted, mode="clip")
        solve_fronts(
            self._plan,
            self._offset,
            self._factor,
            self._block,
            self._gathered,
            self._permuted.reshape(-1),
        )
        solution[self._plan.order] = self._permuted
        return solution


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
    """

    def __init__(self, pattern: BlockPattern, block: int) -> None:
        self._pattern, self._block = pattern, block
        self._symmetric = Cholesky(pattern, block)
        self._general = SparseLU(pattern, block)
        self._blocks: Floats | None = None
        self._is_general = False
        self._respite = 0

    def factorize(self, blocks: Floats) -> None:
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

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
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

    def _refine(self, load: Floats) -> Floats | None:
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
