"""Approximate minimum degree: an elimination order that keeps the factor sparse.

The quotient-graph method of Amestoy, Davis & Duff (1996), on nodes instead of scalar unknowns.
Eliminated sets become *elements*; a node's degree is bounded from the elements and nodes that it
still sees. Nodes that see nothing but the newest element go with it, so the order comes with its
fundamental supernodes, and the nodes of an element are the rows of its front.
"""

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
    """Nodes of the new element: what the pivot sees, directly or through its elements."""
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
    """Nodes of each older element that the new one does not have."""
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
