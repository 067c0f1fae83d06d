"""Kernels: where a ray leaves a body, and how much of two simplices is common to both.

Of simplices a (d + 1, d) array of corners; of facets a (d, d) array, whose normal points out of
the material. `lower`, `upper` and `cells` are a tree, see `verify.compare.cell_tree`.
"""

import numpy as np
from numba import njit

from verify.compare.locate_kernels import Floats, Ints, box_distance2, segment_distance2

# A ray through an edge must not slip between two facets.
_EDGE = 1e-9
_MOST = 128  # parts that a tetrahedron has at most when four planes have cut it: 3⁴


@njit(inline="always")
def _meets_box(x, way, low, high):
    """Whether the ray x + t way, t ≥ 0, meets a box."""
    first, last = 0.0, np.inf
    for a in range(x.shape[0]):
        if way[a] == 0.0:
            if x[a] < low[a] or x[a] > high[a]:
                return False
            continue
        s, t = (low[a] - x[a]) / way[a], (high[a] - x[a]) / way[a]
        first, last = max(first, min(s, t)), min(last, max(s, t))
    slack = 1e-9 * (abs(first) + abs(last)) if last < np.inf else 0.0
    return first <= last + slack


@njit(cache=True)
def _crossing(x, way, facet):
    """Parameter t at which the line x + t way crosses a facet, or −1."""
    if x.shape[0] == 2:
        ex, ey = facet[1, 0] - facet[0, 0], facet[1, 1] - facet[0, 1]
        ox, oy = facet[0, 0] - x[0], facet[0, 1] - x[1]
        det = way[0] * ey - way[1] * ex
        if det == 0.0:
            return -1.0
        on = (ox * way[1] - oy * way[0]) / det
        return (ox * ey - oy * ex) / det if -_EDGE <= on <= 1.0 + _EDGE else -1.0
    det = u = v = t = 0.0  # Möller & Trumbore (1997)
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        e1, e2, off = facet[1, a] - facet[0, a], facet[2, a] - facet[0, a], x[a] - facet[0, a]
        p = way[b] * (facet[2, c] - facet[0, c]) - way[c] * (facet[2, b] - facet[0, b])
        q = (x[b] - facet[0, b]) * (facet[1, c] - facet[0, c])
        q -= (x[c] - facet[0, c]) * (facet[1, b] - facet[0, b])
        det += e1 * p
        u += off * p
        v += way[a] * q
        t += e2 * q
    if det == 0.0:
        return -1.0
    u, v = u / det, v / det
    return t / det if u >= -_EDGE and v >= -_EDGE and u + v <= 1.0 + _EDGE else -1.0


def first_exits(
    points: Floats, ways: Floats, lower: Floats, upper: Floats, cells: Ints, facets: Floats,
    normals: Floats,
) -> tuple[Floats, Ints]:  # fmt: skip
    """Distance (n,) to the first facet through which a ray leaves material, and which (n,).

    Facets through which it enters are passed; infinite and −1 where it leaves nothing. `ways`
    (n, d) are unit vectors, `facets` is (f, d, d), `normals` (f, d).
    """
    distance, which = np.full(len(points), np.inf), np.full(len(points), -1)
    stack = np.empty(64, dtype=np.int64)
    _first_exits(points, ways, lower, upper, cells, facets, normals, stack, distance, which)
    return distance, which


@njit(cache=True)
def _first_exits(points, ways, lower, upper, cells, facets, normals, stack, distance, which):
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    for i in range(len(points)):
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if not _meets_box(points[i], ways[i], lower[node], upper[node]):
                continue
            if node < leaves:
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
                facet = cells[k]
                if facet < 0:
                    break
                along = 0.0
                for a in range(points.shape[1]):
                    along += normals[facet, a] * ways[i, a]
                if along <= 0.0:
                    continue
                t = _crossing(points[i], ways[i], facets[facet])
                if 0.0 <= t < distance[i]:
                    distance[i], which[i] = t, facet


@njit(cache=True)
def _facet_distance2(x, facet, normal):
    """Squared distance of a point to a facet."""
    d = x.shape[0]
    best = np.inf
    for i in range(d):
        best = min(best, segment_distance2(x, facet[i], facet[(i + 1) % d]))
    if d == 2:
        return best
    height = side = 0.0
    for a in range(3):
        height += normal[a] * (x[a] - facet[0, a])
    if height * height >= best:
        return best
    for i in range(3):  # whether the foot lies inside of all edges
        side = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            edge_b = facet[(i + 1) % 3, b] - facet[i, b]
            edge_c = facet[(i + 1) % 3, c] - facet[i, c]
            side += normal[a] * (edge_b * (x[c] - facet[i, c]) - edge_c * (x[b] - facet[i, b]))
        if side < 0.0:
            return best
    return height * height


def facet_distances(points: Floats, which: Ints, facets: Floats, normals: Floats) -> Floats:
    """Distance (n,) of each point to one facet, `which` (n,); infinite for facet −1."""
    found = np.full(len(points), np.inf)
    _facet_distances(points, which, facets, normals, found)
    return found


@njit(cache=True)
def _facet_distances(points, which, facets, normals, found):
    for i in range(len(points)):
        if which[i] >= 0:
            facet, normal = facets[which[i]], normals[which[i]]
            found[i] = np.sqrt(_facet_distance2(points[i], facet, normal))


def nearest_before(
    points: Floats, lower: Floats, upper: Floats, cells: Ints, facets: Floats, normals: Floats
) -> Ints:
    """Nearest facet (n,) that has a point on its inner side; −1 where none has."""
    found, stack = np.full(len(points), -1), np.empty(64, dtype=np.int64)
    _nearest_before(points, lower, upper, cells, facets, normals, stack, found)
    return found


@njit(cache=True)
def _nearest_before(points, lower, upper, cells, facets, normals, stack, found):
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    for i in range(len(points)):
        best2 = np.inf
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if box_distance2(points[i], lower[node], upper[node]) >= best2:
                continue
            if node < leaves:
                left, right = 2 * node, 2 * node + 1
                left2 = box_distance2(points[i], lower[left], upper[left])
                if left2 < box_distance2(points[i], lower[right], upper[right]):
                    left, right = right, left
                stack[top], stack[top + 1] = left, right  # the nearer child is taken first
                top += 2
                continue
            for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
                facet = cells[k]
                if facet < 0:
                    break
                height = 0.0
                for a in range(points.shape[1]):
                    height += normals[facet, a] * (points[i, a] - facets[facet, 0, a])
                if height < 0.0:
                    distance2 = _facet_distance2(points[i], facets[facet], normals[facet])
                    if distance2 < best2:
                        best2, found[i] = distance2, facet


@njit(inline="always")
def _measure(simplex):
    """Area or volume of a simplex, whatever its orientation."""
    if len(simplex) == 3:
        ex, ey = simplex[1, 0] - simplex[0, 0], simplex[1, 1] - simplex[0, 1]
        fx, fy = simplex[2, 0] - simplex[0, 0], simplex[2, 1] - simplex[0, 1]
        return 0.5 * abs(ex * fy - ey * fx)
    det = 0.0
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        fb, fc = simplex[2, b] - simplex[0, b], simplex[2, c] - simplex[0, c]
        gb, gc = simplex[3, b] - simplex[0, b], simplex[3, c] - simplex[0, c]
        det += (simplex[1, a] - simplex[0, a]) * (fb * gc - fc * gb)
    return abs(det) / 6.0


@njit(cache=True)
def _write_corner(simplex, depth, i, j, corner):
    """Write where the edge from corner i, inside, to corner j is met, or corner i if j is i."""
    share = 0.0 if i == j else depth[i] / (depth[i] - depth[j])
    for a in range(len(corner)):
        corner[a] = simplex[i, a] + share * (simplex[j, a] - simplex[i, a])


@njit(inline="always")
def _kept(simplex, depth, order, parts, count):
    """Append to `parts` the part of a simplex where a linear function is positive.

    `depth` (d + 1,) are its values at the corners, `order` (d + 1,) is room for the corners, those
    inside first. The part with k positive corners is a simplex (k = 1), a simplex less one
    (k = d), or in space a wedge (k = 2): as many corners as a simplex has, of the corners inside
    and the points met, in a fan, the staircase triangulation of the product of two simplices.
    """
    size = len(depth)
    positive, outside = 0, size
    for i in range(size):
        if depth[i] > 0.0:
            order[positive] = i
            positive += 1
        else:
            outside -= 1
            order[outside] = i
    if positive == 0:
        return count
    a = order[0]
    if positive == size or positive == 1:
        for k in range(size):
            i = k if positive == size else a
            _write_corner(simplex, depth, i, order[k] if positive == 1 else i, parts[count, k])
        return count + 1
    if positive == size - 1:
        out = order[positive]
        for first in range(positive):
            for k in range(first + 1):
                _write_corner(simplex, depth, order[k], out, parts[count, k])
            for k in range(first, positive):
                _write_corner(simplex, depth, order[k], order[k], parts[count, k + 1])
            count += 1
        return count
    b = order[1]
    for first in range(3):
        for k in range(first + 1):
            _write_corner(simplex, depth, b, order[k + 1] if k > 0 else b, parts[count, k])
        for k in range(first, 3):
            _write_corner(simplex, depth, a, order[k + 1] if k > 0 else a, parts[count, k + 1])
        count += 1
    return count


@njit(cache=True)
def _apart(one, other, inward, tolerance):
    """Whether a facet of `other` has all of `one` behind it, or within `tolerance` of it."""
    size, d = one.shape
    for facet in range(size):
        deepest = -np.inf
        for i in range(size):
            depth = 0.0
            for a in range(d):
                depth += inward[facet, a] * (one[i, a] - other[(facet + 1) % size, a])
            deepest = max(deepest, depth)
        if deepest <= tolerance:
            return True
    return False


@njit(cache=True)
def _common(one, other, inward, tolerance, depth, order, room):
    """Area or volume of what two simplices have in common, less a layer of thickness `tolerance`.

    `inward` (d + 1, d) are the unit normals of the facets of `other` opposite to its corners.
    """
    size, d = one.shape
    parts, cut = room[0], room[1]
    for i in range(size):
        for a in range(d):
            parts[0, i, a] = one[i, a]
    count = 1
    for facet in range(size):
        on_it = other[(facet + 1) % size]
        kept = 0
        for p in range(count):
            for i in range(size):
                depth[i] = -tolerance
                for a in range(d):
                    depth[i] += inward[facet, a] * (parts[p, i, a] - on_it[a])
            kept = _kept(parts[p], depth, order, cut, kept)
        parts, cut, count = cut, parts, kept
    total = 0.0
    for p in range(count):
        total += _measure(parts[p])
    return total


def overlapping(
    seeds: Ints, lower: Floats, upper: Floats, cells: Ints, low: Floats, high: Floats,
    corners: Floats, inward: Floats, tolerance: float,
) -> float:  # fmt: skip
    """Area or volume that is covered twice by simplices around the `seeds` (s,).

    Starting from the seeds, neighbours of cells that overlap another are looked at as well, so
    that every cell of a connected region of overlap is met. `low` and `high` (m, d) are the boxes
    of the cells, `corners` (m, d + 1, d), `inward` their facets' unit normals.
    """
    seen = np.zeros(len(low), dtype=np.int64)
    waiting, near, stack = np.empty((3, max(len(low), 64)), dtype=np.int64)
    size, d = corners.shape[1:]
    depth, order, room = (
        np.empty(size),
        np.empty(size, dtype=np.int64),
        np.empty((2, _MOST, size, d)),
    )
    memory = seen, waiting, near, stack, depth, order, room
    return float(
        _overlapping(seeds, lower, upper, cells, low, high, corners, inward, tolerance, memory)
    )


@njit(cache=True)
def _overlapping(seeds, lower, upper, cells, low, high, corners, inward, tolerance, memory):
    seen, waiting, near, stack, depth, order, room = memory
    d = low.shape[1]
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    begun = ended = 0
    for seed in seeds:
        if not seen[seed]:
            seen[seed], waiting[ended] = 1, seed
            ended += 1
    total = 0.0
    while begun < ended:
        one = waiting[begun]
        begun += 1
        stack[0], top, around = 1, 1, 0
        while top > 0:
            top -= 1
            node = stack[top]
            apart = False
            for a in range(d):
                apart |= low[one, a] > upper[node, a] or high[one, a] < lower[node, a]
            if apart:
                continue
            if node < leaves:
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
                if cells[k] < 0:
                    break
                near[around] = cells[k]
                around += 1
        own = 0.0
        for k in range(around):
            other = near[k]
            if other == one or _apart(corners[one], corners[other], inward[other], tolerance):
                continue
            if not _apart(corners[other], corners[one], inward[one], tolerance):
                own += _common(
                    corners[one], corners[other], inward[other], tolerance, depth, order, room
                )
        total += 0.5 * own
        if own > 0.0:
            for k in range(around):
                if not seen[near[k]]:
                    seen[near[k]], waiting[ended] = 1, near[k]
                    ended += 1
    return total


def cells_run_through(
    starts: Floats, ends: Floats, own: Ints, lower: Floats, upper: Floats, cells: Ints,
    normals: Floats, offsets: Floats,
) -> Ints:  # fmt: skip
    """Find a convex cell (n,) that a segment runs through, other than its own; −1 if none.

    A cell is where all normals · x > offsets: `normals` is (m, k, d), `offsets` (m, k). `own` (n,)
    is −1 for a segment without a cell.
    """
    found, stack = np.full(len(starts), -1), np.empty(64, dtype=np.int64)
    _run_through(starts, ends, own, lower, upper, cells, normals, offsets, stack, found)
    return found


@njit(cache=True)
def _clipped(start, end, normals, offsets):
    """Whether a segment has a part where all normals · x > offsets (Cyrus and Beck, 1978)."""
    first, last = 0.0, 1.0
    for k in range(len(offsets)):
        at_start = at_end = -offsets[k]
        for a in range(len(start)):
            at_start += normals[k, a] * start[a]
            at_end += normals[k, a] * end[a]
        if at_start <= 0.0 and at_end <= 0.0:
            return False
        if at_start < 0.0:
            first = max(first, at_start / (at_start - at_end))
        elif at_end < 0.0:
            last = min(last, at_start / (at_start - at_end))
    return first < last


@njit(cache=True)
def _run_through(starts, ends, own, lower, upper, cells, normals, offsets, stack, found):
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    for i in range(len(starts)):
        stack[0], top = 1, 1
        while top > 0 and found[i] < 0:
            top -= 1
            node = stack[top]
            apart = False
            for a in range(starts.shape[1]):
                apart |= min(starts[i, a], ends[i, a]) > upper[node, a]
                apart |= max(starts[i, a], ends[i, a]) < lower[node, a]
            if apart:
                continue
            if node < leaves:
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
                cell = cells[k]
                if cell < 0 or found[i] >= 0:
                    break
                if cell != own[i] and _clipped(starts[i], ends[i], normals[cell], offsets[cell]):
                    found[i] = cell
