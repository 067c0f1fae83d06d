"""Compiled loops of the multifrontal Cholesky factorisation.

A front has the columns of its supernode and, below them, the rows that these columns reach. Its
factor columns are stored one after the other (column j of front s starts at
``offset[s] + j·height``), so the innermost loops run over consecutive numbers. Its update matrix
waits on a stack until the parent front adds it.
"""

import numpy as np
from numba import njit

from verify.xfem.short_sort import sort_short

__all__ = ["assembly_lists", "factorise_fronts", "front_rows", "solve_fronts"]

# a pivot below this share of the diagonal entry that it came from is round-off
_TINY = 1e-14


@njit(cache=True)
def front_rows(starts, columns, order, bounds, nearest):
    """Rows of each front and the tree of fronts, from the sparsity and the order.

    `nearest` (S,), or (0,), gives fronts beyond which the parents must not be: -1 where there is
    none. A front then has the rows of its children even where it does not meet them itself.

    Returns
    -------
    row_start : (S + 1,) int array
        Rows of front s are entries row_start[s] to row_start[s + 1] of `rows`.
    rows : (R,) int array
        Places in the order, ascending, after the columns of the front.
    parent : (S,) int array
        Parent front, -1 at a root.
    """
    nodes = len(order)
    fronts = len(bounds) - 1
    rank = np.empty(nodes, dtype=np.int64)
    front_of = np.empty(nodes, dtype=np.int64)
    for k in range(nodes):
        rank[order[k]] = k
    for s in range(fronts):
        for k in range(bounds[s], bounds[s + 1]):
            front_of[k] = s
    head = np.full(fronts, -1, dtype=np.int64)
    following = np.full(fronts, -1, dtype=np.int64)
    parent = np.full(fronts, -1, dtype=np.int64)
    row_start = np.zeros(fronts + 1, dtype=np.int64)
    rows = np.empty(4 * nodes + 16, dtype=np.int64)
    mark = np.full(nodes, -1, dtype=np.int64)
    used = 0
    for s in range(fronts):
        begin = used
        if used + nodes > len(rows):
            grown = np.empty(2 * len(rows) + nodes, dtype=np.int64)
            for at in range(used):
                grown[at] = rows[at]
            rows = grown
        for k in range(bounds[s], bounds[s + 1]):
            for at in range(starts[order[k]], starts[order[k] + 1]):
                row = rank[columns[at]]
                if row >= bounds[s + 1] and mark[row] != s:
                    mark[row] = s
                    rows[used] = row
                    used += 1
        child = head[s]
        while child >= 0:
            for at in range(row_start[child], row_start[child + 1]):
                row = rows[at]
                if row >= bounds[s + 1] and mark[row] != s:
                    mark[row] = s
                    rows[used] = row
                    used += 1
            child = following[child]
        sort_short(rows[begin:used])
        row_start[s + 1] = used
        if used > begin:
            above = front_of[rows[begin]]
            if len(nearest) > 0 and 0 <= nearest[s] < above:
                above = nearest[s]
            parent[s] = above
            following[s] = head[above]
            head[above] = s
    return row_start, rows[:used].copy(), parent


@njit(cache=True)
def assembly_lists(starts, columns, order, bounds, row_start, rows, parent):
    """Where matrix blocks and update matrices of children go in each front.

    Returns
    -------
    relative : (R,) int array
        Place of each row among the columns and rows of the parent front.
    entry_start : (N + 1,) int array
        Matrix blocks of each column (in the order).
    entry_block, entry_row : (E,) int array
        Which block, transposed, adds to which local row of the column's front.
    """
    nodes = len(order)
    fronts = len(bounds) - 1
    rank = np.empty(nodes, dtype=np.int64)
    for k in range(nodes):
        rank[order[k]] = k
    relative = np.empty(len(rows), dtype=np.int64)
    entry_start = np.zeros(nodes + 1, dtype=np.int64)
    entry_block = np.empty((len(columns) + nodes) // 2, dtype=np.int64)
    entry_row = np.empty_like(entry_block)
    place = np.empty(nodes, dtype=np.int64)
    entries = 0
    for s in range(fronts):
        width = bounds[s + 1] - bounds[s]
        for at in range(row_start[s], row_start[s + 1]):
            place[rows[at]] = width + at - row_start[s]
        for k in range(bounds[s], bounds[s + 1]):
            place[k] = k - bounds[s]
        for k in range(bounds[s], bounds[s + 1]):
            for at in range(starts[order[k]], starts[order[k] + 1]):
                row = rank[columns[at]]
                if row >= k:
                    entry_block[entries] = at
                    entry_row[entries] = place[row]
                    entries += 1
            entry_start[k + 1] = entries
    # rows of a front are found among the columns or, in step, among the rows of its parent
    for s in range(fronts):
        above = parent[s]
        if above < 0:
            continue
        at = row_start[above]
        width = bounds[above + 1] - bounds[above]
        for k in range(row_start[s], row_start[s + 1]):
            row = rows[k]
            if row < bounds[above + 1]:
                relative[k] = row - bounds[above]
            else:
                while rows[at] < row:
                    at += 1
                relative[k] = width + at - row_start[above]
    return relative, entry_start, entry_block, entry_row


@njit(cache=True, fastmath={"contract", "reassoc"})
def _subtract(panel, low, high, j, first, second, begin):
    """Subtract columns `low` to `high` times their rows j and j + 1 from two columns.

    Column entries are counted from row `begin` of the panel on: first[0] is row j + begin of
    the front if `begin` is measured from j.
    """
    length = len(first)
    k = low
    while k + 4 <= high:
        a, b, c, d = panel[k], panel[k + 1], panel[k + 2], panel[k + 3]
        a0, b0, c0, d0 = a[j], b[j], c[j], d[j]
        a1, b1, c1, d1 = a[j + 1], b[j + 1], c[j + 1], d[j + 1]
        a, b, c, d = a[begin:], b[begin:], c[begin:], d[begin:]
        for i in range(length):
            first[i] -= a[i] * a0 + b[i] * b0 + c[i] * c0 + d[i] * d0
            second[i] -= a[i] * a1 + b[i] * b1 + c[i] * c1 + d[i] * d1
        k += 4
    while k < high:
        a = panel[k]
        a0, a1 = a[j], a[j + 1]
        a = a[begin:]
        for i in range(length):
            first[i] -= a[i] * a0
            second[i] -= a[i] * a1
        k += 1


@njit(cache=True, fastmath={"contract", "reassoc"})
def _subtract_one(panel, low, high, j, first, begin):
    length = len(first)
    for k in range(low, high):
        a = panel[k]
        a0 = a[j]
        a = a[begin:]
        for i in range(length):
            first[i] -= a[i] * a0


@njit(cache=True)
def _eliminate(panel, diagonal):
    """Factorise the columns of a panel (w, height) in place; the failing column or -1."""
    width, height = panel.shape
    j = 0
    while j < width:
        pair = j + 1 < width
        if pair:
            _subtract(panel, 0, j, j, panel[j, j:], panel[j + 1, j:], j)
        else:
            _subtract_one(panel, 0, j, j, panel[j, j:], j)
        pivot = panel[j, j]
        if not pivot > _TINY * diagonal[j]:
            return j
        scale = 1.0 / np.sqrt(pivot)
        for i in range(j, height):
            panel[j, i] *= scale
        if pair:
            factor = panel[j, j + 1]
            for i in range(j + 1, height):
                panel[j + 1, i] -= panel[j, i] * factor
            pivot = panel[j + 1, j + 1]
            if not pivot > _TINY * diagonal[j + 1]:
                return j + 1
            scale = 1.0 / np.sqrt(pivot)
            for i in range(j + 1, height):
                panel[j + 1, i] *= scale
        j += 2
    return -1


@njit(cache=True)
def _complement(panel, update):
    """Subtract L Lᵀ of the rows below the supernode from its update matrix (lower part)."""
    width, height = panel.shape
    below = height - width
    j = 0
    while j < below:
        if j + 1 < below:
            _subtract(panel, 0, width, width + j, update[j, j:], update[j + 1, j:], width + j)
        else:
            _subtract_one(panel, 0, width, width + j, update[j, j:], width + j)
        j += 2


@njit(cache=True)
def _extend_add(waiting, place, count, panel, update):
    """Add the update matrix of a child, whose row i is row place[i] of this front."""
    width = panel.shape[0]
    for j in range(count):
        column = place[j]
        source = waiting[j]
        if column < width:
            target = panel[column]
            for i in range(j, count):
                target[place[i]] += source[i]
        else:
            target = update[column - width]
            for i in range(j, count):
                target[place[i] - width] += source[i]


@njit(cache=True)
def factorise_fronts(
    blocks,
    bounds,
    row_start,
    relative,
    parent,
    entry_start,
    entry_block,
    entry_row,
    offset,
    factor,
    stack,
    update_space,
    place,
    diagonal,
):
    """Factorise; return the scalar column (in the order) whose pivot failed, or -1."""
    block = blocks.shape[1]
    fronts = len(bounds) - 1
    # children of a front are the last ones on the stack: fronts are in postorder
    waiting_front = np.empty(fronts, dtype=np.int64)
    waiting = 0
    top = 0
    for s in range(fronts):
        width = (bounds[s + 1] - bounds[s]) * block
        below = (row_start[s + 1] - row_start[s]) * block
        height = width + below
        panel = factor[offset[s] : offset[s + 1]].reshape(width, height)
        panel[:] = 0.0
        update = update_space[: below * below].reshape(below, below)
        update[:] = 0.0
        for k in range(bounds[s], bounds[s + 1]):
            column = (k - bounds[s]) * block
            for at in range(entry_start[k], entry_start[k + 1]):
                source = blocks[entry_block[at]]
                row = entry_row[at] * block
                for a in range(block):
                    for b in range(block):
                        panel[column + a, row + b] = source[a, b]
        for j in range(width):
            diagonal[j] = panel[j, j]
        while waiting > 0 and parent[waiting_front[waiting - 1]] == s:
            waiting -= 1
            child = waiting_front[waiting]
            count = (row_start[child + 1] - row_start[child]) * block
            top -= count * count
            for k in range(row_start[child], row_start[child + 1]):
                for a in range(block):
                    place[(k - row_start[child]) * block + a] = relative[k] * block + a
            matrix = stack[top : top + count * count].reshape(count, count)
            _extend_add(matrix, place, count, panel, update)
        failed = _eliminate(panel, diagonal)
        if failed >= 0:
            return bounds[s] * block + failed
        if below > 0:
            _complement(panel, update)
            matrix = stack[top : top + below * below].reshape(below, below)
            for j in range(below):
                for i in range(j, below):
                    matrix[j, i] = update[j, i]
            top += below * below
            waiting_front[waiting] = s
            waiting += 1
    return -1


@njit(cache=True, fastmath={"contract", "reassoc"})
def solve_fronts(bounds, row_start, rows, offset, factor, block, gathered, x):
    """Solve L Lᵀ x = b in place; x (N·block,) is in the order of elimination."""
    fronts = len(bounds) - 1
    for s in range(fronts):
        width = (bounds[s + 1] - bounds[s]) * block
        below = (row_start[s + 1] - row_start[s]) * block
        panel = factor[offset[s] : offset[s + 1]].reshape(width, width + below)
        own = x[bounds[s] * block : bounds[s] * block + width]
        total = gathered[:below]
        total[:] = 0.0
        for j in range(width):
            column = panel[j]
            own[j] /= column[j]
            value = own[j]
            for i in range(j + 1, width):
                own[i] -= column[i] * value
            tail = column[width:]
            for i in range(below):
                total[i] += tail[i] * value
        for k in range(row_start[s], row_start[s + 1]):
            for a in range(block):
                x[rows[k] * block + a] -= total[(k - row_start[s]) * block + a]
    for s in range(fronts - 1, -1, -1):
        width = (bounds[s + 1] - bounds[s]) * block
        below = (row_start[s + 1] - row_start[s]) * block
        panel = factor[offset[s] : offset[s + 1]].reshape(width, width + below)
        own = x[bounds[s] * block : bounds[s] * block + width]
        other = gathered[:below]
        for k in range(row_start[s], row_start[s + 1]):
            for a in range(block):
                other[(k - row_start[s]) * block + a] = x[rows[k] * block + a]
        for j in range(width - 1, -1, -1):
            column = panel[j]
            value = own[j]
            for i in range(j + 1, width):
                value -= column[i] * own[i]
            tail = column[width:]
            for i in range(below):
                value -= tail[i] * other[i]
            own[j] = value / column[j]
