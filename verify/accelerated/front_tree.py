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
) -> tuple[_Ints, _Ints]:
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
    order, bounds
        The same for the merged fronts; update matrices can then wait on a stack.
    """
    group = _merge(np.diff(bounds), parent, below)
    position, ends = _postorder(np.diff(bounds), parent, group)
    new = np.empty_like(order)
    columns = np.arange(len(order)) - np.repeat(bounds[:-1], np.diff(bounds))
    new[np.repeat(position, np.diff(bounds)) + columns] = order
    return new, ends


def levels(parent: _Ints, entries: _Ints) -> tuple[_Ints, tuple[int, int]]:
    """Levels of fronts in postorder, and how deep two stacks of update matrices become.

    Parameters
    ----------
    parent : (S,) int array
    entries : (S,) int array
        Of the update matrix of each front. It waits on the stack of even levels or on that of odd
        ones, where its parent, which then takes it, does not write its own.

    Returns
    -------
    level : (S,) int array
        0 at a root.
    depths : (int, int)
    """
    level, even, odd = _levels(parent, entries)
    return level, (int(even), int(odd))


@njit(cache=True)
def _merge(width, parent, below):
    """Front into which each front goes in the end (itself if it stays)."""
    count = len(parent)
    group, zeros = np.empty(count, dtype=np.int64), np.zeros(count, dtype=np.int64)
    columns = width.copy()
    for front in range(count):
        group[front] = front
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
    for front in range(count - 1, -1, -1):
        group[front] = group[group[front]]
    return group


@njit(cache=True)
def _postorder(width, parent, group):
    """First place of each front's columns, and the ends of the merged fronts (from 0)."""
    count = len(parent)
    head = np.full(count + 1, -1, dtype=np.int64)  # children of merged fronts; last: roots
    following = np.full(count, -1, dtype=np.int64)
    member = np.full(count, -1, dtype=np.int64)  # fronts merged into one, ascending
    next_member = np.full(count, -1, dtype=np.int64)
    for front in range(count - 1, -1, -1):
        next_member[front] = member[group[front]]
        member[group[front]] = front
        if group[front] == front:
            above = group[parent[front]] if parent[front] >= 0 else count
            following[front] = head[above]
            head[above] = front
    position = np.empty(count, dtype=np.int64)
    ends = np.zeros(count + 1, dtype=np.int64)
    stack = np.empty(count + 1, dtype=np.int64)
    stack[0] = count
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
        fronts += 1
        ends[fronts] = used
    return position, ends[: fronts + 1]


@njit(cache=True)
def _levels(parent, entries):
    count = len(parent)
    level = np.zeros(count, dtype=np.int64)
    for front in range(count - 1, -1, -1):
        if parent[front] >= 0:
            level[front] = level[parent[front]] + 1
    freed = np.zeros(count, dtype=np.int64)  # by each front, of the other stack
    waiting, deepest = np.zeros(2, dtype=np.int64), np.zeros(2, dtype=np.int64)
    for front in range(count):
        mine = level[front] & 1
        waiting[mine] += entries[front]
        deepest[mine] = max(deepest[mine], waiting[mine])
        waiting[1 - mine] -= freed[front]
        if parent[front] >= 0:
            freed[parent[front]] += entries[front]
    return level, deepest[0], deepest[1]
