"""Approximate minimum degree: an elimination order that keeps the factor sparse.

The quotient-graph method of Amestoy, Davis & Duff (1996), on nodes instead of scalar unknowns.
Eliminated sets become *elements*; a node's degree is bounded from the elements and nodes that it
still sees. Nodes that see nothing but the newest element go with it, so the order comes with its
fundamental supernodes.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_Ints = NDArray[np.int64]


def minimum_degree(starts: NDArray[np.int32], columns: NDArray[np.int32]) -> tuple[_Ints, _Ints]:
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
    """
    order, bounds = _eliminate_all(starts, columns)
    return order, bounds


@njit(cache=True)
def _unlink(node, degree, head, after, before):
    if before[node] >= 0:
        after[before[node]] = after[node]
    else:
        head[degree[node]] = after[node]
    if after[node] >= 0:
        before[after[node]] = before[node]


@njit(cache=True)
def _link(node, degree, head, after, before):
    first = head[degree[node]]
    after[node] = first
    before[node] = -1
    if first >= 0:
        before[first] = node
    head[degree[node]] = node


@njit(cache=True)
def _gather(pivot, start, elements, variables, sees, begin, size, members, alive, mark, found):
    """Nodes of the new element: what the pivot sees, directly or through its elements."""
    count = 0
    mark[pivot] = pivot
    for k in range(elements[pivot]):
        element = sees[start[pivot] + k]
        if not alive[element]:
            continue
        alive[element] = False
        for at in range(begin[element], begin[element] + size[element]):
            node = members[at]
            if mark[node] != pivot:
                mark[node] = pivot
                found[count] = node
                count += 1
    for k in range(elements[pivot], elements[pivot] + variables[pivot]):
        node = sees[start[pivot] + k]
        if mark[node] != pivot:
            mark[node] = pivot
            found[count] = node
            count += 1
    return count


@njit(cache=True)
def _see_neighbours(starts, columns, sees, variables):
    """Let every node see its neighbours, not itself."""
    for node in range(len(variables)):
        for at in range(starts[node], starts[node + 1]):
            if columns[at] != node:
                sees[starts[node] + variables[node]] = columns[at]
                variables[node] += 1


@njit(cache=True)
def _count_outside(pivot, found, start, elements, sees, alive, size, seen_by, outside):
    """Nodes of each older element that the new one does not have."""
    for node in found:
        for k in range(elements[node]):
            element = sees[start[node] + k]
            if alive[element]:
                if seen_by[element] != pivot:
                    seen_by[element] = pivot
                    outside[element] = size[element]
                outside[element] -= 1


@njit(cache=True)
def _eliminate_all(starts, columns):
    count = len(starts) - 1
    start = starts[:-1].astype(np.int64)
    sees = columns.astype(np.int64)  # of each node: its elements, then its nodes
    elements = np.zeros(count, dtype=np.int64)
    variables = np.zeros(count, dtype=np.int64)
    degree = np.zeros(count, dtype=np.int64)
    head = np.full(count + 1, -1, dtype=np.int64)
    after = np.full(count, -1, dtype=np.int64)
    before = np.full(count, -1, dtype=np.int64)
    _see_neighbours(starts, columns, sees, variables)
    for node in range(count):
        degree[node] = variables[node]
        _link(node, degree, head, after, before)
    mark = np.full(count, -1, dtype=np.int64)
    gone = np.zeros(count, dtype=np.bool_)
    alive = np.ones(count, dtype=np.bool_)  # as elements
    begin = np.zeros(count, dtype=np.int64)
    size = np.zeros(count, dtype=np.int64)
    members = np.empty(2 * len(columns) + count, dtype=np.int64)
    filled = 0
    outside = np.zeros(count, dtype=np.int64)
    seen_by = np.full(count, -1, dtype=np.int64)
    space = np.empty(count, dtype=np.int64)
    order = np.empty(count, dtype=np.int64)
    bounds = np.zeros(count + 1, dtype=np.int64)
    done = 0
    sets = 0
    least = 0
    while done < count:
        while head[least] < 0:
            least += 1
        pivot = head[least]
        _unlink(pivot, degree, head, after, before)
        gone[pivot] = True
        order[done] = pivot
        done += 1
        number = _gather(
            pivot, start, elements, variables, sees, begin, size, members, alive, mark, space
        )
        found = space[:number]
        _count_outside(pivot, found, start, elements, sees, alive, size, seen_by, outside)
        if filled + number > len(members):
            grown = np.empty(2 * len(members) + number, dtype=np.int64)
            for at in range(filled):
                grown[at] = members[at]
            members = grown
        begin[pivot] = filled
        for node in found:
            _unlink(node, degree, head, after, before)
            bound = _shorten(
                node, pivot, start, elements, variables, sees, alive, outside, gone, mark
            )
            if elements[node] == 1 and variables[node] == 0:
                gone[node] = True
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
        bounds[sets] = done
    return order, bounds[: sets + 1]


@njit(cache=True)
def _shorten(node, pivot, start, elements, variables, sees, alive, outside, gone, mark):
    """Replace what the new element covers by the element; bound the degree of the rest."""
    begin = start[node]
    write = begin
    bound = 0
    for at in range(begin, begin + elements[node]):
        element = sees[at]
        if alive[element]:
            if outside[element] == 0:
                alive[element] = False
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
