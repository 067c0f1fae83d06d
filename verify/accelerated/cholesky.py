"""Sparse Cholesky factorisation of nodal blocks, with the symbolic analysis kept.

A multifrontal method (Duff & Reid 1983), ordered by minimum degree on nodes. Everything that
depends on the sparsity only (order, fronts, where each block goes) is found once per topology;
`Cholesky.factorize` then runs over values alone. No pivoting: the stiffness of a supported body
is positive definite, and the error of a Cholesky factorisation does not depend on diagonal
scaling, so slivers do not hurt it (Higham 2002, section 10.1).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.accelerated.cholesky_kernels import BAND, factorise_fronts, solve_fronts
from verify.accelerated.front_plan_kernels import assembly_lists, front_rows
from verify.accelerated.front_tree import levels, merge_and_order
from verify.accelerated.minimum_degree import minimum_degree
from verify.xfem.arrays import check_floats
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.errors import SingularStiffnessError, XfemError
from verify.xfem.linear_solvers import LinearSolver, nodal_vector

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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
        starts, columns, _ = coupled = _coupled(pattern.starts, pattern.columns, held)
        order, bounds = minimum_degree(starts, columns)
        row_start, _, parent = front_rows(starts, columns, order, bounds)
        order, bounds = merge_and_order(order, bounds, parent, np.diff(row_start))
        self._plan(coupled, order, bounds)

    def _plan(self, coupled: tuple[_Ints, _Ints, _Ints], order: _Ints, bounds: _Ints) -> None:
        """Find fronts and room for an order, and where each block goes."""
        starts, columns, blocks = coupled
        row_start, rows, parent = front_rows(starts, columns, order, bounds)
        lists = assembly_lists(starts, columns, order, bounds, row_start, rows, parent)
        self._order, self._bounds = order, bounds
        self._row_start, self._rows, self._parent = row_start, rows, parent
        self._relative, self._entry_start, self._entry_block, self._entry_row = lists
        self._entry_block = blocks.take(self._entry_block)
        width = np.diff(bounds) * self._block
        below = np.diff(row_start) * self._block
        self._work = float(width @ (width + below) ** 2)
        self._entries = int((width * (width + below) - width * (width - 1) // 2).sum())
        height = width + below
        self._offset = np.concatenate([[0], np.cumsum(width * height)])
        self._level, depths = levels(parent, below**2)
        self._factor = np.empty(int(self._offset[-1]))
        self._stacks = (np.empty(depths[0]), np.empty(depths[1]))
        most = int(height.max(initial=0))
        self._diagonal, self._gathered = np.empty(most), np.empty(most)
        self._place = np.empty(most, dtype=np.uint64)
        products = np.maximum(
            width * below, BAND * (width + height) + (width - BAND) * (height - BAND)
        )
        self._products = np.empty(int(products.max(initial=0)))
        self._permuted = np.empty((len(order), self._block))

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
            self._bounds,
            self._row_start,
            self._relative,
            self._parent,
            self._level,
            self._entry_start,
            self._entry_block,
            self._entry_row,
            self._offset,
            self._factor,
            self._stacks,
            self._place,
            self._diagonal,
            self._products,
        )
        if failed >= 0:
            raise SingularStiffnessError(int(self._order[failed // self._block]))
        self._is_factorised = True

    def solve(self, load: _Floats, x: _Floats | None = None) -> _Floats:
        """Solve; see `LinearSolver`."""
        if not self._is_factorised:
            raise RuntimeError("solve before factorize")
        load = nodal_vector(load, "right-hand side", len(self._order), self._block)
        solution = np.empty(load.shape) if x is None else x
        np.take(load, self._order, axis=0, out=self._permuted, mode="clip")
        solve_fronts(
            self._bounds,
            self._row_start,
            self._rows,
            self._offset,
            self._factor,
            self._block,
            self._gathered,
            self._permuted.reshape(-1),
        )
        solution[self._order] = self._permuted
        return solution


@njit(cache=True)
def _coupled(starts, columns, held):
    """Rows without what couples held nodes: starts, columns, and which blocks are left."""
    fewer = np.empty_like(starts)
    left, blocks = np.empty_like(columns), np.empty(len(columns), dtype=np.int64)
    count = 0
    fewer[0] = 0
    for i in range(len(starts) - 1):
        for k in range(starts[i], starts[i + 1]):
            if columns[k] == i or not (held[i] or held[columns[k]]):
                left[count], blocks[count] = columns[k], k
                count += 1
        fewer[i + 1] = count
    return fewer, left[:count], blocks[:count]
