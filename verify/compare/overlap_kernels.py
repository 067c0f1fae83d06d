"""Kernels: where a ray leaves a body, and which cells a segment runs through.

Of simplices a (d + 1, d) array of corners; of facets a (d, d) array, whose normal points out of
the material. `lower`, `upper` and `cells` are a tree, see `verify.compare.cell_tree`.
"""

import numpy as np

from verify.compare.cell_tree import Floats, Ints, box_distance2, segment_distance2
from verify.compiled import njit

# A ray through an edge must not slip between two facets.
_EDGE = 1e-9


@njit(inline="always")
def _meets_box(x, way, low, high):
    """Tell whether the ray x + t way, t ≥ 0, meets a box."""
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
    """Compute the parameter t at which the line x + t way crosses a facet, or −1."""
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
    """Compute distance (n,) to the first facet through which a ray leaves material, and which (n,).

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
    """Compute the squared distance of a point to a facet."""
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
    """Compute the distance (n,) of each point to one facet, `which` (n,); infinite for facet −1."""
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
    """Find the nearest facet (n,) that has a point on its inner side; −1 where none has."""
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
    """Tell whether a segment has a part where all normals · x > offsets (Cyrus and Beck, 1978)."""
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
