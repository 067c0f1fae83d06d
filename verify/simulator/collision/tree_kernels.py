"""Bounding boxes in a heap: node 1 is the root, node i has the children 2i and 2i + 1.

With n items the leaves are nodes n to 2n − 1, in the order of a space-filling curve, so building
is one sort and refitting one backward sweep, without recursion and without allocation.
"""

import numpy as np
from numba import njit

from verify.simulator.simplex_kernels import box_gap
from verify.xfem.nearest_points import foot_on_facet, nearest_on_facet, squared_distance

__all__ = [
    "as_array",
    "boxes_of_facets",
    "items_near_plane",
    "merge_boxes",
    "morton_codes",
    "nearest_facet",
    "nearest_facets",
]

_DEEP = 128  # deeper than any heap: twice its height is what a depth-first stack needs


@njit(cache=True)
def morton_codes(low, high):
    """Place (n,) of the boxes' centres on the Z-order curve of their common box."""
    count, space = low.shape
    floor, widest = np.empty(space), 0.0
    for i in range(space):
        least, most = np.inf, -np.inf
        for n in range(count):
            centre = 0.5 * (low[n, i] + high[n, i])
            least, most = min(least, centre), max(most, centre)
        floor[i], widest = least, max(widest, most - least)
    scale = 1023.0 / widest if widest > 0.0 else 0.0
    codes = np.zeros(count, dtype=np.int64)
    for n in range(count):
        for i in range(space):
            place = np.int64((0.5 * (low[n, i] + high[n, i]) - floor[i]) * scale)
            for bit in range(10):
                codes[n] |= ((place >> bit) & 1) << (space * bit + i)
    return codes


@njit(cache=True)
def boxes_of_facets(points, facets, order, low, high):
    """Write the boxes of the facets, in this order, into the leaves of a heap."""
    count = len(order)
    for leaf in range(count):
        facet = order[leaf]
        for i in range(points.shape[1]):
            smallest = largest = points[facets[facet, 0], i]
            for k in range(1, facets.shape[1]):
                value = points[facets[facet, k], i]
                smallest, largest = min(smallest, value), max(largest, value)
            low[count + leaf, i], high[count + leaf, i] = smallest, largest


@njit(cache=True)
def merge_boxes(low, high):
    """Make every inner box hold its two children."""
    for node in range(len(low) // 2 - 1, 0, -1):
        for i in range(low.shape[1]):
            low[node, i] = min(low[2 * node, i], low[2 * node + 1, i])
            high[node, i] = max(high[2 * node, i], high[2 * node + 1, i])


@njit(cache=True)
def as_array(found):
    """Array (q,) of listed integers: `np.array` of a list takes longer to compile."""
    items = np.empty(len(found), dtype=np.int64)
    for k in range(len(found)):
        items[k] = found[k]
    return items


@njit(cache=True)
def items_near_plane(low, high, order, box_low, box_high, normal, point, margin):
    """Items whose boxes meet a box, and come within a margin of a plane (normal 0: no plane)."""
    count = len(order)
    found, stack = [np.int64(0) for _ in range(0)], np.empty(_DEEP, dtype=np.int64)
    stack[0], top = 1, 1
    while top > 0 and count > 0:
        top -= 1
        node = stack[top]
        away, reach, apart = 0.0, margin, False
        for i in range(len(point)):
            if low[node, i] > box_high[i] or high[node, i] < box_low[i]:
                apart = True
            away += normal[i] * (0.5 * (low[node, i] + high[node, i]) - point[i])
            reach += abs(normal[i]) * 0.5 * (high[node, i] - low[node, i])
        if apart or abs(away) > reach:
            continue
        if node >= count:
            found.append(order[node - count])
        else:
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
    return as_array(found)


@njit(cache=True)
def nearest_facet(x, points, facets, body, wanted, low, high, order, limit, weights):
    """(facet, distance) nearest to x, weights written; -1 if none is nearer than the limit.

    Only facets of the `wanted` body count, all if it is negative. `weights` gets k numbers.
    """
    count, size, space = len(order), facets.shape[1], len(x)
    corners, foot, trial = np.empty((size, space)), np.empty(space), np.empty(size)
    stack = np.empty(_DEEP, dtype=np.int64)
    stack[0], top = 1, 1
    best, found = limit * limit, -1
    while top > 0 and count > 0:
        top -= 1
        node = stack[top]
        if box_gap(x, low[node], high[node]) > best:
            continue
        if node < count:
            left, right = 2 * node, 2 * node + 1
            if box_gap(x, low[left], high[left]) < box_gap(x, low[right], high[right]):
                left, right = right, left
            stack[top], stack[top + 1] = left, right
            top += 2
            continue
        facet = order[node - count]
        if wanted >= 0 and body[facet] != wanted:
            continue
        for k in range(size):
            for i in range(space):
                corners[k, i] = points[facets[facet, k], i]
        nearest_on_facet(x, corners, trial)
        foot_on_facet(corners, trial, foot)
        distance = squared_distance(x, foot)
        if distance < best or (found < 0 and distance <= best):
            best, found = distance, facet
            for k in range(size):
                weights[k] = trial[k]
    return found, np.sqrt(best)


@njit(cache=True)
def nearest_facets(queries, points, facets, body, wanted, low, high, order, limit):
    """`nearest_facet` of many points: facet (q,), distance (q,), weights (q, k)."""
    found = np.empty(len(queries), dtype=np.int64)
    distance = np.empty(len(queries))
    weights = np.zeros((len(queries), facets.shape[1]))
    for q in range(len(queries)):
        found[q], distance[q] = nearest_facet(
            queries[q], points, facets, body, wanted, low, high, order, limit, weights[q]
        )
    return found, distance, weights
