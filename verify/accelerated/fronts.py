"""Analysis before a factorisation sees a value: elimination order, fronts, their tree and places.

The order keeps the factor sparse: approximate minimum degree, the quotient-graph method of Amestoy,
Davis & Duff (1996), on nodes instead of scalar unknowns. Eliminated sets become *elements*; a
node's degree is bounded from the elements and nodes that it still sees. Nodes that see nothing but
the newest element go with it. So the order comes with its fundamental supernodes, and the nodes of
an element are the rows of its front. Small fronts are then merged into their parents, and the tree
is put in postorder.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.arrays import Ints


def minimum_degree(
    starts: NDArray[np.int64], columns: NDArray[np.int64]
) -> tuple[Ints, Ints, Ints, Ints]:
    """Order nodes for elimination.

    Parameters
    ----------
    starts, columns : int arrays
        Adjacency as compressed rows; symmetric, with or without the diagonal.

    Returns
    -------
    order : (N,) int array
        The nodes, first to be eliminated first.
    bounds : (S + 1,) int array
        Supernode s is ``order[bounds[s]:bounds[s + 1]]``.
    row_start : (S + 1,) int array
        Rows of supernode s are entries row_start[s] to row_start[s + 1] of `rows`.
    rows : (R,) int array
        Nodes that the elimination of a supernode couples to each other.
    """
    count = len(starts) - 1
    zeros, none = np.zeros((11, count + 1), dtype=np.int64), np.full((5, count + 1), -1)
    room = np.empty(2 * len(columns) + count, dtype=np.int64)
    sets, rows = _eliminate_all(starts, columns, np.empty_like(columns), zeros, none, room)
    order, bounds, row_start = zeros[:3]
    return order[:count], bounds[: sets + 1], row_start[: sets + 1], rows[: row_start[sets]]


@njit(inline="always")
def _unlink(node, degree, head, after, before):
    if before[node] >= 0:
        after[before[node]] = after[node]
    else:
        head[degree[node]] = after[node]
    if after[node] >= 0:
        before[after[node]] = before[node]


@njit(inline="always")
def _link(node, degree, head, after, before):
    first = head[degree[node]]
    after[node] = first
    before[node] = -1
    if first >= 0:
        before[first] = node
    head[degree[node]] = node


@njit(inline="always")
def _see_neighbours(starts, columns, sees, variables):
    """Let every node see its neighbours, not itself."""
    for node in range(len(starts) - 1):
        for at in range(starts[node], starts[node + 1]):
            if columns[at] != node:
                sees[starts[node] + variables[node]] = columns[at]
                variables[node] += 1


@njit(inline="always")
def _gather(pivot, start, elements, variables, sees, begin, size, members, dead, mark, found):
    """Find nodes of the new element: what the pivot sees, directly or through its elements."""
    count = 0
    mark[pivot] = pivot
    for at in range(start[pivot], start[pivot] + elements[pivot] + variables[pivot]):
        # a node that is seen directly is a list of its own
        other, first, last = sees[at], at, at + 1
        direct = at >= start[pivot] + elements[pivot]
        if not direct:
            first, last = begin[other], begin[other] + (0 if dead[other] else size[other])
            dead[other] = 1
        for k in range(first, last):
            node = sees[k] if direct else members[k]
            if mark[node] != pivot:
                mark[node] = pivot
                found[count] = node
                count += 1
    return count


@njit(inline="always")
def _count_outside(pivot, found, number, start, elements, sees, dead, size, seen_by, outside):
    """Find nodes of each older element that the new one does not have."""
    for index in range(number):
        node = found[index]
        for at in range(start[node], start[node] + elements[node]):
            element = sees[at]
            if not dead[element]:
                if seen_by[element] != pivot:
                    seen_by[element] = pivot
                    outside[element] = size[element]
                outside[element] -= 1


@njit(inline="always")
def _shorten(node, pivot, start, elements, variables, sees, dead, outside, gone, mark):
    """Replace what the new element covers by the element; bound the degree of the rest."""
    begin = start[node]
    write = begin
    bound = 0
    for at in range(begin, begin + elements[node]):
        element = sees[at]
        if not dead[element]:
            if outside[element] == 0:
                dead[element] = 1
            else:
                bound += outside[element]
                sees[write] = element
                write += 1
    middle = write
    for at in range(begin + elements[node], begin + elements[node] + variables[node]):
        other = sees[at]
        if not gone[other] and mark[other] != pivot:
            sees[write] = other
            write += 1
    # what led to the pivot has fallen away, so there is a place left for the new element
    sees[write] = sees[middle]
    sees[middle] = pivot
    elements[node] = middle - begin + 1
    variables[node] = write - middle
    return bound + variables[node]


@njit(cache=True)
def _eliminate_all(starts, columns, sees, zeros, none, members):
    """Write order, bounds and ends of rows into the first of `zeros`; the sets, and the rows.

    `sees` has of each node its elements, then its nodes.
    """
    order, bounds, ends = zeros[0], zeros[1], zeros[2]
    elements, variables, degree, begin = zeros[3], zeros[4], zeros[5], zeros[6]
    size, outside, gone, dead = zeros[7], zeros[8], zeros[9], zeros[10]
    head, after, before, mark, seen_by = none[0], none[1], none[2], none[3], none[4]
    count = len(starts) - 1
    _see_neighbours(starts, columns, sees, variables)
    for node in range(count):
        degree[node] = variables[node]
        _link(node, degree, head, after, before)
    filled = done = sets = least = 0
    while done < count:
        while head[least] < 0:
            least += 1
        pivot = head[least]
        _unlink(pivot, degree, head, after, before)
        gone[pivot] = 1
        order[done] = pivot
        done += 1
        if filled + count > len(members):
            grown = np.empty(2 * len(members) + count, dtype=np.int64)
            for at in range(filled):
                grown[at] = members[at]
            members = grown
        found = members[filled:]  # of which those that stay move to the front
        number = _gather(
            pivot, starts, elements, variables, sees, begin, size, members, dead, mark, found
        )
        _count_outside(pivot, found, number, starts, elements, sees, dead, size, seen_by, outside)
        begin[pivot] = filled
        for index in range(number):
            node = found[index]
            _unlink(node, degree, head, after, before)
            bound = _shorten(
                node, pivot, starts, elements, variables, sees, dead, outside, gone, mark
            )
            if elements[node] == 1 and variables[node] == 0:
                gone[node] = 1
                order[done] = node
                done += 1
            else:
                members[filled] = node
                filled += 1
                degree[node] = min(bound, degree[node]) + number - 1
        size[pivot] = filled - begin[pivot]
        for at in range(begin[pivot], filled):
            node = members[at]
            degree[node] = max(0, min(degree[node], count - done - 1))
            _link(node, degree, head, after, before)
            least = min(least, degree[node])
        sets += 1
        bounds[sets], ends[sets] = done, filled
    return sets, members


# Merge while the merged front has at most that many columns, or that share of added zeros:
# dense loops are faster per entry than short ones (measured).
_NARROW = 8
_ZEROS = 0.1


def merge_and_order(
    order: Ints, bounds: Ints, parent: Ints, below: Ints
) -> tuple[Ints, Ints, Ints, Ints]:
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
        The front that a merged one joined; both share their rows.
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
    """Write the first place of each front's columns; of merged fronts, the values returned."""
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


class FrontPlan(NamedTuple):
    """Fronts in postorder, as kernels take them.

    Attributes
    ----------
    order : (N,) int array
        Nodes in the order of elimination.
    bounds : (F + 1,) int array
        Columns of front s are places bounds[s] to bounds[s + 1] in the order.
    row_start : (F + 1,) int array
        Rows of front s are entries row_start[s] to row_start[s + 1] of `rows`.
    rows : (R,) int array
        Places in the order, ascending, after the columns of the front.
    relative : (R,) int array
        Place of each row among the columns and rows of the parent front.
    parent, level : (F,) int arrays
        Parent front, -1 at a root, and how many are above.
    entry_start : (N + 1,) int array
        Matrix blocks of each column (in the order).
    entry_block, entry_row : (E,) int arrays
        Which block, transposed, adds to which local row of the column's front.
    """

    order: Ints
    bounds: Ints
    row_start: Ints
    rows: Ints
    relative: Ints
    parent: Ints
    level: Ints
    entry_start: Ints
    entry_block: Ints
    entry_row: Ints


def plan_fronts(
    starts: NDArray[np.int32], columns: NDArray[np.int32], held: NDArray[np.bool_]
) -> FrontPlan:
    """Find order, fronts and places for a sparsity.

    Parameters
    ----------
    starts, columns : int arrays
        Symmetric, as compressed rows.
    held : (N,) bool array
        Nodes that are coupled to no other.
    """
    nodes = len(held)
    node = np.repeat(np.arange(nodes), np.diff(starts))
    blocks = np.flatnonzero((columns == node) | ~(held[node] | held[columns]))
    begins, coupled = np.searchsorted(blocks, starts), columns[blocks].astype(np.int64)
    order, bounds, row_start, rows = minimum_degree(begins, coupled)
    parent = _parents(bounds, row_start, _inverse(order)[rows])
    below = np.diff(row_start)
    order, bounds, tops, level = merge_and_order(order, bounds, parent, below)
    rank, below = _inverse(order), below[tops]
    # rows of a front, ascending: sorted by front and place at once
    front = np.repeat(np.arange(len(tops)), below)
    keys = np.sort(nodes * front + rank[rows[_ranges(row_start[tops], below)]])
    row_start, rows = _starts(below), keys - nodes * front
    parent = _parents(bounds, row_start, rows)

    def places(front: Ints, row: Ints) -> Ints:
        """Find places of rows among the columns and rows of fronts."""
        found = row - bounds[front]
        outside = np.flatnonzero(row >= bounds[front + 1])
        front = front[outside]
        at = np.searchsorted(keys, nodes * front + row[outside])
        found[outside] = (bounds[front + 1] - bounds[front]) + at - row_start[front]
        return found

    count = np.diff(begins)[order]
    at = _ranges(begins[order], count)
    column, row = np.repeat(np.arange(nodes), count), rank[coupled[at]]
    lower = row >= column
    at, column, row = at[lower], column[lower], row[lower]
    return FrontPlan(
        order, bounds, row_start, rows, places(parent[front], rows), parent, level,
        _starts(np.bincount(column, minlength=nodes)), blocks[at],
        places(np.repeat(np.arange(len(tops)), np.diff(bounds))[column], row),
    )  # fmt: skip


def stack_depths(parent: Ints, level: Ints, entries: Ints) -> tuple[int, int]:
    """Compute depths of two stacks of update matrices, of fronts of even levels and of odd ones.

    A front writes its update matrix (of that many entries) on one. The matrices of its children,
    which it then takes, are last on the other.
    """
    freed = np.bincount(parent[parent >= 0], entries[parent >= 0], len(parent)).astype(np.int64)
    even, odd = (
        np.where(level & 1 == mine, entries, 0) - np.where(level & 1 == mine, 0, freed)
        for mine in (0, 1)
    )
    return int(np.cumsum(even).max(initial=0)), int(np.cumsum(odd).max(initial=0))


def _inverse(order: Ints) -> Ints:
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order))
    return rank


def _starts(counts: Ints) -> Ints:
    return np.concatenate([[0], np.cumsum(counts)])


def _ranges(first: Ints, counts: Ints) -> Ints:
    """Return ranges of that many numbers from the first ones on, one after the other."""
    return np.arange(counts.sum()) + np.repeat(first - _starts(counts)[:-1], counts)


def _parents(bounds: Ints, row_start: Ints, rows: Ints) -> Ints:
    """Compute the front (S,) in whose columns the first row of each is; -1 without rows."""
    parent = np.full(len(bounds) - 1, -1)
    some = np.flatnonzero(np.diff(row_start))
    if len(some):
        first = np.minimum.reduceat(rows, row_start[some])
        parent[some] = np.searchsorted(bounds, first, "right") - 1
    return parent
