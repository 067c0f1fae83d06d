"""Sparse Cholesky factorisation of nodal blocks, with the symbolic analysis kept.

A multifrontal method (Duff & Reid 1983), ordered by minimum degree on nodes. Everything that
depends on the sparsity only (order, fronts, where each block goes) is found once per topology;
`Cholesky.factorize` then runs over values alone. No pivoting: the stiffness of a supported body is
positive definite. The error of a Cholesky factorisation does not depend on diagonal scaling, so
slivers do not hurt it (Higham 2002, section 10.1). `NearlySymmetric` factorises the symmetric part
and refines, and takes LU where that does not converge.

A front has the columns of its supernode and, below them, the rows that these columns reach. Its
factor columns are stored one after the other: a panel (width, height) of which row j is column j of
the factor, from its diagonal on. Entries before the diagonal are never read. The update matrix of a
front waits on a stack until the parent front adds it. BLAS multiplies where there are many columns.
In the compiled loops `plan` is a `verify.accelerated.fronts.FrontPlan`.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

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


# a pivot below this share of the diagonal entry that it came from is round-off
_TINY = 1e-14
BAND = 32  #: columns that are eliminated one by one before the others take their product
_FUSED = {"contract"}  # multiply and add in one, rounded once
_SUMS = {"contract", "reassoc", "nsz"}  # and sums in any order


@njit(inline="always")
def _write_entries(blocks, begin, end, plan, panel):
    """Write the blocks of the columns of a front, nodes `begin` to `end` in the order."""
    size = blocks.shape[1]
    for k in range(end - begin):
        for entry in range(plan.entry_start[begin + k], plan.entry_start[begin + k + 1]):
            block, row = plan.entry_block[entry], plan.entry_row[entry] * size
            for a in range(size):
                for b in range(size):
                    panel[k * size + a, row + b] = blocks[block, a, b]


@njit(inline="always")
def _places(child, plan, size, width, place):
    """Write where the rows of a child are in this front; how many there are, and are columns."""
    split = count = 0
    for k in range(plan.row_start[child], plan.row_start[child + 1]):
        first = plan.relative[k] * size
        if first < width:
            split += size
        for a in range(size):
            place[count] = first + a
            count += 1
    return count, split


@njit(inline="always")
def _take_columns(left, first, count, split, place, panel):
    """Take what a child leaves, from `first` on, of the columns of this front."""
    for j in range(split):
        own, at = panel[place[j]], first + j * count
        for i in range(j, count):
            own[place[i]] -= left[at + i]


@njit(inline="always")
def _pass_on(left, first, count, split, place, width, update):
    """Add what a child leaves of the rows of this front to what this front leaves of them."""
    for j in range(split, count):
        place[j] -= np.uint64(width)
    for j in range(split, count):
        own, at = update[place[j]], first + j * count
        for i in range(j, count):
            own[place[i]] += left[at + i]


@njit(inline="always")
def _eliminate_band(panel, begin, end, diagonal):
    """Factorise columns `begin` to `end` of a panel in place; the failing one or -1."""
    for j in range(begin, end):
        own = panel[j, j:]
        k = begin
        while k + 4 <= j:
            a, b, c, d = panel[k, j:], panel[k + 1, j:], panel[k + 2, j:], panel[k + 3, j:]
            s, t, u, v = a[0], b[0], c[0], d[0]
            for i in range(len(own)):
                own[i] -= s * a[i] + t * b[i] + u * c[i] + v * d[i]
            k += 4
        for rest in range(k, j):
            a = panel[rest, j:]
            s = a[0]
            for i in range(len(own)):
                own[i] -= s * a[i]
        if not own[0] > _TINY * diagonal[j]:
            return j
        inverse = 1.0 / np.sqrt(own[0])
        for i in range(len(own)):
            own[i] *= inverse
    return -1


@njit(inline="always")
def _numbers(panel, begin, end, first, room):
    """Find the columns `begin` to `end` of a panel, rows from `first` on, without gaps."""
    depth, rows = end - begin, panel.shape[1] - first
    numbers = room[: depth * rows].reshape(depth, rows)
    for k in range(depth):
        for i in range(rows):
            numbers[k, i] = panel[begin + k, first + i]
    return numbers


@njit(inline="always")
def _subtract_product(panel, begin, end, room):
    """Take the product of columns `begin` to `end` of a panel from those after them."""
    numbers, columns = _numbers(panel, begin, end, end, room), len(panel) - end
    depth, rows = numbers.shape
    used = depth * rows
    left = room[used : used + depth * columns].reshape(depth, columns)
    for k in range(depth):
        for i in range(columns):
            left[k, i] = numbers[k, i]
    used += depth * columns
    product = room[used : used + columns * rows].reshape(columns, rows)
    np.dot(left.T, numbers, product)
    for j in range(columns):
        own, taken = panel[end + j, end:], product[j]
        for i in range(j, rows):
            own[i] -= taken[i]


@njit(cache=True, fastmath=_FUSED)
def _eliminate(panel, diagonal, room):
    """Factorise the columns of a panel in place; the failing one or -1."""
    width = len(panel)
    for begin in range(0, width, BAND):
        end = min(begin + BAND, width)
        failed = _eliminate_band(panel, begin, end, diagonal)
        if failed >= 0:
            return failed
        if end < width:
            _subtract_product(panel, begin, end, room)
    return -1


@njit(cache=True, fastmath=_FUSED)
def factorise_fronts(
    blocks, plan, offset, factor, stack, tops, waiting_front, place, diagonal, room
):
    """Factorise; return the scalar column (in the order) whose pivot failed, or -1.

    The update vector of a front, to be subtracted in its parent, is the product of its own columns
    plus the updates of its children. It waits on one of two stacks, by the parity of the level:
    fronts are in postorder, so the updates of the children are last on the other. Both are in
    `stack`, from the two `tops` on; `waiting_front` (F,) has room for the fronts on them.
    """
    bounds, row_start, parent = plan.bounds, plan.row_start, plan.parent
    size, waiting = blocks.shape[1], 0
    for s in range(len(parent)):
        width = (bounds[s + 1] - bounds[s]) * size
        below = (row_start[s + 1] - row_start[s]) * size
        panel = factor[offset[s] : offset[s + 1]].reshape(width, width + below)
        mine = plan.level[s] & 1
        panel[:] = 0.0
        _write_entries(blocks, bounds[s], bounds[s + 1], plan, panel)
        for j in range(width):
            diagonal[j] = panel[j, j]
        first, top = waiting, tops[1 - mine]
        while first > 0 and parent[waiting_front[first - 1]] == s:
            first -= 1
            count, split = _places(waiting_front[first], plan, size, width, place)
            top -= count * count
            _take_columns(stack, top, count, split, place, panel)
        failed = _eliminate(panel, diagonal, room)
        if failed >= 0:
            return bounds[s] * size + failed
        if below > 0:
            end = tops[mine] + below * below
            update = stack[tops[mine] : end].reshape(below, below)
            numbers = _numbers(panel, 0, width, width, room)
            np.dot(numbers.T, numbers, update)
            top = tops[1 - mine]
            for at in range(waiting - 1, first - 1, -1):
                count, split = _places(waiting_front[at], plan, size, width, place)
                top -= count * count
                _pass_on(stack, top, count, split, place, width, update)
            tops[mine] = end
        tops[1 - mine], waiting = top, first
        if below > 0:
            waiting_front[waiting] = s
            waiting += 1
    return -1


@njit(inline="always")
def _solve_front(panel, x, own, rows, size, gathered):
    """Find a front's values, forwards and in place, and what they leave of its rows."""
    width, height = panel.shape
    for i in range(width):
        gathered[i] = x[own + i]
    for i in range(width, height):
        gathered[i] = 0.0
    for j in range(width):
        column, left = panel[j, j:], gathered[j:height]
        value = left[0] / column[0]
        x[own + j] = value
        for i in range(len(column)):
            left[i] -= value * column[i]
    for k in range(len(rows)):
        for a in range(size):
            x[rows[k] * size + a] += gathered[width + k * size + a]


@njit(inline="always")
def _solve_front_back(panel, x, own, rows, size, gathered):
    """Find a front's values, backwards and in place, from the values of its rows."""
    width, height = panel.shape
    for k in range(len(rows)):
        for a in range(size):
            gathered[width + k * size + a] = x[rows[k] * size + a]
    for j in range(width - 1, -1, -1):
        column, known = panel[j, j + 1 :], gathered[j + 1 : height]
        total = 0.0
        for i in range(len(column)):
            total += column[i] * known[i]
        gathered[j] = x[own + j] = (x[own + j] - total) / panel[j, j]


@njit(cache=True, fastmath=_SUMS)
def solve_fronts(plan, offset, factor, size, gathered, x):
    """Solve L Lᵀ x = b in place; x (N·size,) is in the order of elimination.

    `gathered` has room for the columns and rows of any front.
    """
    bounds, row_start, rows = plan.bounds, plan.row_start, plan.rows
    fronts = len(bounds) - 1
    for step in range(2 * fronts):
        s = step if step < fronts else 2 * fronts - 1 - step
        width = (bounds[s + 1] - bounds[s]) * size
        below = rows[row_start[s] : row_start[s + 1]]
        panel = factor[offset[s] : offset[s + 1]].reshape(width, width + len(below) * size)
        if step < fronts:
            _solve_front(panel, x, bounds[s] * size, below, size, gathered)
        else:
            _solve_front_back(panel, x, bounds[s] * size, below, size, gathered)
