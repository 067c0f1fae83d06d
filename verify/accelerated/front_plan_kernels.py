"""Plan of a multifrontal factorisation before it sees a value: rows and places."""

import numpy as np
from numba import njit

from verify.accelerated.short_sort import sort_short


@njit(cache=True)
def front_rows(starts, columns, order, bounds):
    """Rows of each front and the tree of fronts, from the sparsity and the order.

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
