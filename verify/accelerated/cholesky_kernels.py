"""Compiled loops of the multifrontal Cholesky factorisation.

A front has the columns of its supernode and, below them, the rows that these columns reach. Its
factor columns are stored one after the other (column j of front s starts at
``offset[s] + j·height``), in fours; the rows of the columns and those below them each fill
vectors (`dense_tiles`), zeros after them. The update matrix of a front, as padded, waits on a stack
until the parent front adds it.
"""

import numpy as np
from numba import njit

from verify.accelerated.dense_tiles import (
    COLUMNS,
    ROWS,
    add_run,
    padded,
    project_columns,
    substitute,
    subtract_columns,
    subtract_product,
)
from verify.xfem.lanes.shuffles import address

__all__ = ["factorise_fronts", "solve_fronts"]

# a pivot below this share of the diagonal entry that it came from is round-off
_TINY = 1e-14
_BAND = 96  # columns that a product takes at a time: more do not stay in the first cache
_STRIP = 16  # rows: what they hold above the diagonal is for nothing


@njit(cache=True)
def _write_block(blocks, at, block, panel, into, height):
    """Write the block whose first number is at `at`, transposed."""
    if block == 3:  # written out: a third of the time
        for _ in range(3):
            panel[into], panel[into + 1] = blocks[at], blocks[at + 1]
            panel[into + 2] = blocks[at + 2]
            at, into = at + 3, into + height
        return
    for a in range(block):
        for b in range(block):
            panel[into + a * height + b] = blocks[at + a * block + b]


@njit(cache=True)
def _factorise_group(panel, at, step, width, diagonal, factor):
    """Factorise the square of `COLUMNS` columns whose first number is at `at`.

    Only the first `width` are there. Writes the factor row by row, with the inverses of its
    diagonal; returns the failing column or -1.
    """
    for i in range(COLUMNS):
        for j in range(i + 1):
            entry = i * (i + 1) // 2 + j
            if i >= width:
                factor[entry] = 1.0 if i == j else 0.0
                continue
            value = panel[at + j * step + i]
            for k in range(j):
                value -= factor[i * (i + 1) // 2 + k] * factor[j * (j + 1) // 2 + k]
            if i > j:
                factor[entry] = value * factor[j * (j + 1) // 2 + j]
            elif value > _TINY * diagonal[i]:
                factor[entry] = 1.0 / np.sqrt(value)
            else:
                return i
    return -1


@njit(cache=True)
def _eliminate(panel, at, width, height, diagonal, factor):
    """Factorise the columns of a panel in place, `height` numbers each; the failing one or -1."""
    numbers, coefficients = address(panel), address(factor)
    begin = 0
    while begin < width:
        end = min(width, begin + _BAND)
        for j in range(begin, end, COLUMNS):
            row = j // ROWS * ROWS  # what is above the diagonal is never read
            top = at + j * height
            if j > begin:
                subtract_product(
                    numbers, top + row, height, numbers, at + begin * height + row,
                    at + begin * height + j, height, height - row, COLUMNS, j - begin,
                )  # fmt: skip
            failed = _factorise_group(panel, top + j, height, width - j, diagonal[j:], factor)
            if failed >= 0:
                return j + failed
            substitute(numbers, top + row, height, height - row, coefficients)
            for k in range(COLUMNS):
                column = top + k * height
                for i in range(column + row, column + j + k):
                    panel[i] = 0.0
                panel[column + j + k] = factor[k * (k + 1) // 2 + k] if j + k < width else 0.0
        for j in range(end, width, COLUMNS):
            row = j // ROWS * ROWS
            subtract_product(
                numbers, at + j * height + row, height, numbers, at + begin * height + row,
                at + begin * height + j, height, height - row, COLUMNS, end - begin,
            )  # fmt: skip
        begin = end
    return -1


@njit(cache=True)
def _complement(panel, at, width, height, update, into, below):
    """Subtract L Lᵀ of the last `below` rows from an update matrix (lower part)."""
    numbers, others = address(panel), address(update)
    first = height - below
    for begin in range(0, width, _BAND):
        left, depth = at + begin * height + first, min(_BAND, width - begin)
        for row in range(0, below, _STRIP):
            rows = min(_STRIP, below - row)
            subtract_product(
                others, into + row, below, numbers, left + row, left, height, rows, row + rows,
                depth,
            )  # fmt: skip


@njit(cache=True)
def _extend_add(waiting, at, count, runs, first, length, row, panel, panel_at, width, height,
                update, update_at, below):  # fmt: skip
    """Add the update matrix of a child, in runs of rows that follow each other in this front too.

    Row first[r] + i of the child is row row[r] + i of this front, i < length[r].
    """
    top = height - below
    source, own, other = address(waiting), address(panel), address(update)
    for r in range(runs):
        for k in range(length[r]):
            column = row[r] + k
            j = first[r] + k
            begin = at + j * count
            if column < width:
                into = panel_at + column * height
                add_run(own, into + column, source, begin + j, length[r] - k)
                for q in range(r + 1, runs):
                    add_run(own, into + row[q], source, begin + first[q], length[q])
            else:
                into = update_at + (column - top) * below - top
                add_run(other, into + column, source, begin + j, length[r] - k)
                for q in range(r + 1, runs):
                    add_run(other, into + row[q], source, begin + first[q], length[q])


@njit(cache=True)
def _find_runs(relative, columns, top, block, first, length, row):
    """Write the runs of a child's rows, given its places among columns and rows; their number."""
    runs, k = 0, 0
    while k < len(relative):
        begin = k
        k += 1
        while k < len(relative) and relative[k] == relative[k - 1] + 1 and relative[k] != columns:
            k += 1
        first[runs], length[runs] = begin * block, (k - begin) * block
        place = relative[begin]
        row[runs] = place * block if place < columns else top + (place - columns) * block
        runs += 1
    return runs


@njit(cache=True)
def _write_entries(blocks, block, begin, end, entry_start, entry_block, entry_row, panel, at,
                   height):  # fmt: skip
    """Write the blocks of the columns of a front, nodes `begin` to `end` in the order."""
    columns = end - begin
    shift = padded(columns * block) - columns * block  # of rows below the columns
    for k in range(columns):
        column = at + k * block * height
        for entry in range(entry_start[begin + k], entry_start[begin + k + 1]):
            into = column + entry_row[entry] * block
            if entry_row[entry] >= columns:
                into += shift
            _write_block(blocks, entry_block[entry] * block * block, block, panel, into, height)


@njit(cache=True)
def factorise_fronts(
    blocks,
    bounds,
    row_start,
    relative,
    parent,
    level,
    entry_start,
    entry_block,
    entry_row,
    offset,
    factor,
    stacks,
    place,
    diagonal,
    square,
):
    """Factorise; return the scalar column (in the order) whose pivot failed, or -1.

    The update matrices of fronts wait on one of two stacks, by the parity of their level: fronts
    are in postorder, so those of the children are the last ones on the other.
    """
    block = blocks.shape[1]
    fronts = len(bounds) - 1
    waiting_front = np.empty(fronts, dtype=np.int64)
    waiting = 0
    tops = np.zeros(2, dtype=np.int64)
    first, length, row = place[0], place[1], place[2]
    numbers = blocks.reshape(-1)
    for s in range(fronts):
        columns = bounds[s + 1] - bounds[s]
        width = columns * block
        below = padded((row_start[s + 1] - row_start[s]) * block)
        height, at = padded(width) + below, offset[s]
        for entry in range(at, offset[s + 1]):
            factor[entry] = 0.0
        mine = level[s] & 1
        update, other, into = stacks[mine], stacks[1 - mine], tops[mine]
        for j in range(below):
            for i in range(into + j * below + j // ROWS * ROWS, into + (j + 1) * below):
                update[i] = 0.0
        _write_entries(
            numbers, block, bounds[s], bounds[s + 1], entry_start, entry_block, entry_row, factor,
            at, height,
        )  # fmt: skip
        for j in range(width):
            diagonal[j] = factor[at + j * height + j]
        while waiting > 0 and parent[waiting_front[waiting - 1]] == s:
            waiting -= 1
            child = waiting_front[waiting]
            mine_too = relative[row_start[child] : row_start[child + 1]]
            count = padded(len(mine_too) * block)
            tops[1 - mine] -= count * count
            runs = _find_runs(mine_too, columns, padded(width), block, first, length, row)
            _extend_add(
                other, tops[1 - mine], count, runs, first, length, row, factor, at, width, height,
                update, into, below,
            )  # fmt: skip
        failed = _eliminate(factor, at, width, height, diagonal, square)
        if failed >= 0:
            return bounds[s] * block + failed
        if below > 0:
            _complement(factor, at, width, height, update, into, below)
            tops[mine] += below * below
            waiting_front[waiting] = s
            waiting += 1
    return -1


@njit(cache=True, fastmath={"contract"})
def solve_fronts(bounds, row_start, rows, offset, factor, block, gathered, four, x):
    """Solve L Lᵀ x = b in place; x (N·block,) is in the order of elimination.

    Diagonals of the factor are inverted. `gathered` has room for the rows of any front, `four`
    for `COLUMNS` numbers.
    """
    fronts = len(bounds) - 1
    panels, local, few = address(factor), address(gathered), address(four)
    for s in range(fronts):
        own, width = bounds[s] * block, (bounds[s + 1] - bounds[s]) * block
        top, below = padded(width), padded((row_start[s + 1] - row_start[s]) * block)
        height = top + below
        for i in range(width):
            gathered[i] = x[own + i]
        for i in range(width, height):
            gathered[i] = 0.0
        for j in range(0, width, COLUMNS):
            column = offset[s] + j * height
            for k in range(COLUMNS):
                value = gathered[j + k]
                for l in range(k):
                    value -= factor[column + l * height + j + k] * four[l]
                four[k] = value * factor[column + k * height + j + k]
            for k in range(min(COLUMNS, width - j)):
                x[own + j + k] = four[k]
            row = j // ROWS * ROWS
            subtract_columns(local, row, panels, column + row, height, height - row, few)
        for k in range(row_start[s + 1] - row_start[s]):
            into, source = rows[row_start[s] + k] * block, top + k * block
            for a in range(block):
                x[into + a] += gathered[source + a]
    for s in range(fronts - 1, -1, -1):
        own, width = bounds[s] * block, (bounds[s + 1] - bounds[s]) * block
        top, below = padded(width), padded((row_start[s + 1] - row_start[s]) * block)
        height = top + below
        for i in range(height):
            gathered[i] = 0.0
        for k in range(row_start[s + 1] - row_start[s]):
            source, into = rows[row_start[s] + k] * block, top + k * block
            for a in range(block):
                gathered[into + a] = x[source + a]
        for j in range((width - 1) // COLUMNS * COLUMNS, -1, -COLUMNS):
            column, row = offset[s] + j * height, j // ROWS * ROWS
            project_columns(local, row, panels, column + row, height, height - row, few)
            for k in range(min(COLUMNS, width - j) - 1, -1, -1):
                value = x[own + j + k] - four[k]
                for l in range(k + 1, min(COLUMNS, width - j)):
                    value -= factor[column + k * height + j + l] * x[own + j + l]
                x[own + j + k] = value * factor[column + k * height + j + k]
            for k in range(min(COLUMNS, width - j)):
                gathered[j + k] = x[own + j + k]
