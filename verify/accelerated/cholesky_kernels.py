"""Compiled loops of the multifrontal Cholesky factorisation.

A front has the columns of its supernode and, below them, the rows that these columns reach. Its
factor columns are stored one after the other: a panel (width, height) of which row j is column j of
the factor, from its diagonal on. Entries before the diagonal are never read. The update matrix of a
front waits on a stack until the parent front adds it. BLAS multiplies where there are many columns.
`plan` is a `verify.accelerated.fronts.FrontPlan`.
"""

import numpy as np
from numba import njit

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
