"""The tree of fronts: small fronts merged into their parents, and put in postorder."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_Ints = NDArray[np.int64]

# Merge while the merged front has at most that many columns, or that share of added zeros:
# dense loops are faster per entry than short ones (measured).
_NARROW = 8
_ZEROS = 0.1


def merge_and_order(
    order: _Ints, bounds: _Ints, parent: _Ints, below: _Ints
) -> tuple[_Ints, _Ints, _Ints, _Ints]:
    """Merge fronts, and reorder so that the subtree of each comes directly before it.

    Parameters
    ----------
    order, bounds : int arrays
        Elimination order and its fronts.
    parent : (S,) int array
        Parent of each front, a later one, or -1.
    below : (S,) int array
        Rows of each front below its columns.

    Returns
    -------
    order, bounds : int arrays
        The same for the merged fronts; update matrices can then wait on a stack.
    tops : (F,) int array
        The front into which those of a merged one went: its rows are those of this one.
    level : (F,) int array
        0 at a root.
    """
    count, width = len(parent), np.diff(bounds)
    position, group, tops, level, ends = np.zeros((5, count + 1), dtype=np.int64)
    fronts = _merge(width.copy(), parent, below, group, np.zeros(count, dtype=np.int64))
    linked, stack = np.full((4, count + 1), -1), np.full(count + 1, count)
    _postorder(width, parent, group, linked, stack, position, tops, level, ends)
    new = np.empty_like(order)
    columns = np.arange(len(order)) - np.repeat(bounds[:-1], width)
    new[np.repeat(position[:count], width) + columns] = order
    return new, ends[: fronts + 1], tops[:fronts], level[:fronts]


@njit(cache=True)
def _merge(columns, parent, below, group, zeros):
    """Write the front into which each goes in the end (itself if it stays); how many stay."""
    count = len(parent)
    for front in range(count):
        group[front] = front
    left = count
    for front in range(count):
        above = parent[front]
        if above < 0:
            continue
        height = columns[above] + below[above]
        added = columns[front] * (height - below[front]) + zeros[front] + zeros[above]
        merged = columns[front] + columns[above]
        stored = merged * (merged + 1) // 2 + merged * below[above]
        if merged <= _NARROW or added <= _ZEROS * stored:
            group[front] = above
            columns[above] = merged
            zeros[above] = added
            left -= 1
    for front in range(count - 1, -1, -1):
        group[front] = group[group[front]]
    return left


@njit(cache=True)
def _postorder(width, parent, group, linked, stack, position, tops, level, ends):
    """Write the first place of each front's columns, and of merged fronts what is returned."""
    # children of merged fronts, last: roots; and fronts merged into one, ascending
    head, following, member, next_member = linked[0], linked[1], linked[2], linked[3]
    count = len(parent)
    for front in range(count - 1, -1, -1):
        next_member[front] = member[group[front]]
        member[group[front]] = front
        if group[front] == front:
            above = group[parent[front]] if parent[front] >= 0 else count
            following[front] = head[above]
            head[above] = front
    depth, used, fronts = 1, 0, 0
    while depth > 0:
        front = stack[depth - 1]
        child = head[front]
        if child >= 0:
            head[front] = following[child]
            stack[depth] = child
            depth += 1
            continue
        depth -= 1
        if front == count:
            break
        part = member[front]
        while part >= 0:
            position[part] = used
            used += width[part]
            part = next_member[part]
        tops[fronts], level[fronts] = front, depth - 1
        fronts += 1
        ends[fronts] = used
