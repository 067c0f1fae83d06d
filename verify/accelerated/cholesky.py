"""Sparse Cholesky factorisation of nodal blocks, with the symbolic analysis kept.

A multifrontal method (Duff & Reid 1983), ordered by minimum degree on nodes. Everything that
depends on the sparsity only (order, fronts, where each block goes) is found once per topology;
`Cholesky.factorize` then runs over values alone. No pivoting: the stiffness of a supported body
is positive definite, and the error of a Cholesky factorisation does not depend on diagonal
scaling, so slivers do not hurt it (Higham 2002, section 10.1).
"""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky_kernels import BAND, factorise_fronts, solve_fronts
from verify.accelerated.front_plan import plan_fronts, stack_depths
from verify.xfem.arrays import check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.errors import SingularStiffnessError, XfemError
from verify.xfem.linear_solvers import LinearSolver, nodal_vector

_Floats = NDArray[np.float64]


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

    def factorize(self, blocks: _Floats) -> None:
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

    def solve(self, load: _Floats, x: _Floats | None = None) -> _Floats:
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
