"""Sparse Cholesky factorisation of nodal blocks, with the symbolic analysis kept.

A multifrontal method (Duff & Reid 1983), ordered by minimum degree on nodes. Everything that
depends on the sparsity only (order, fronts, where each block goes) is found once per topology;
`Cholesky.factorize` then runs over values alone. No pivoting: the stiffness of a supported body
is positive definite, and the error of a Cholesky factorisation does not depend on diagonal
scaling, so slivers do not hurt it (Higham 2002, section 10.1).
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.block_pattern import BlockPattern
from verify.xfem.cholesky_kernels import (
    assembly_lists,
    factorise_fronts,
    front_rows,
    solve_fronts,
)
from verify.xfem.errors import XfemError
from verify.xfem.front_tree import merge_and_order, stack_depth
from verify.xfem.minimum_degree import minimum_degree

__all__ = ["Cholesky", "SingularStiffnessError"]

_Ints = NDArray[np.int64]


class SingularStiffnessError(XfemError):
    """The matrix is not positive definite: something moves freely, or a sign is wrong.

    Attributes
    ----------
    node : int or None
        Unknown node at which the factorisation stopped, where it is known.
    """

    def __init__(self, node: int | None) -> None:
        self.node = node
        where = "" if node is None else f" (at unknown node {node})"
        super().__init__(
            f"the stiffness is not positive definite{where}: a free piece without support, "
            "or a wrong sign"
        )


class Cholesky:
    """Solver of K x = b for symmetric positive definite K in nodal blocks.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    """

    def __init__(self, pattern: BlockPattern, block: int) -> None:
        graph = (pattern.starts, pattern.columns)
        order, bounds = minimum_degree(*graph)
        row_start, _, parent = front_rows(*graph, order, bounds)
        order, bounds = merge_and_order(order, bounds, parent, np.diff(row_start))
        row_start, rows, parent = front_rows(*graph, order, bounds)
        lists = assembly_lists(*graph, order, bounds, row_start, rows, parent)
        self._order, self._bounds, self._block = order, bounds, block
        self._row_start, self._rows, self._parent = row_start, rows, parent
        self._relative, self._entry_start, self._entry_block, self._entry_row = lists
        width = np.diff(bounds) * block
        below = np.diff(self._row_start) * block
        self._offset = np.concatenate([[0], np.cumsum(width * (width + below))])
        self._factor = np.zeros(self._offset[-1])
        self._stack = np.empty(stack_depth(self._parent, below))
        self._update = np.empty(int(below.max(initial=0)) ** 2)
        self._place = np.empty(int(below.max(initial=0)), dtype=np.int64)
        self._diagonal = np.empty(int(width.max(initial=0)))
        self._gathered = np.empty(int(below.max(initial=0)))

    @property
    def factor_entries(self) -> int:
        """Stored entries of the factor."""
        width = np.diff(self._bounds) * self._block
        return int(self._offset[-1] - (width * (width - 1) // 2).sum())

    def factorize(self, blocks: NDArray[np.float64]) -> None:
        """Factorise the matrix with these blocks (B, block, block).

        Raises
        ------
        SingularStiffnessError
            If a pivot is not positive beyond round-off.
        """
        failed = factorise_fronts(
            blocks,
            self._bounds,
            self._row_start,
            self._relative,
            self._parent,
            self._entry_start,
            self._entry_block,
            self._entry_row,
            self._offset,
            self._factor,
            self._stack,
            self._update,
            self._place,
            self._diagonal,
        )
        if failed >= 0:
            raise SingularStiffnessError(int(self._order[failed // self._block]))

    def solve(self, load: NDArray[np.float64]) -> NDArray[np.float64]:
        """Solution (N, block) for a right-hand side (N, block)."""
        x = np.ascontiguousarray(load[self._order])
        solve_fronts(
            self._bounds,
            self._row_start,
            self._rows,
            self._offset,
            self._factor,
            self._block,
            self._gathered,
            x.reshape(-1),
        )
        solution = np.empty_like(x)
        solution[self._order] = x
        return solution
