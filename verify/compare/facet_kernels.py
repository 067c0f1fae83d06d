"""Kernels: distance to segments in space, and where a way crosses triangles."""

import numpy as np
from numba import njit

__all__ = ["crossings", "distance_to_segments"]

# Edges of a triangle count to it within this share: a way through an edge must not slip between.
_EDGE = 1e-9


@njit(cache=True)
def distance_to_segments(points, starts, ends):
    """Distance (n,) of points (n, d) to the nearest segment (k, d)–(k, d)."""
    n, d = points.shape
    distance = np.empty(n)
    for i in range(n):
        best = np.inf
        for k in range(starts.shape[0]):
            along, length2 = 0.0, 0.0
            for c in range(d):
                edge = ends[k, c] - starts[k, c]
                along += (points[i, c] - starts[k, c]) * edge
                length2 += edge * edge
            t = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
            away2 = 0.0
            for c in range(d):
                away2 += (points[i, c] - (1 - t) * starts[k, c] - t * ends[k, c]) ** 2
            best = min(best, away2)
        distance[i] = np.sqrt(best)
    return distance


@njit(cache=True)
def crossings(points, steps, lower, upper, cells, facets):
    """Largest parameter t (n,) in [0, 1] at which points + t steps crosses a triangle, else −∞.

    `lower`, `upper`, `cells` are a tree over the triangles, see `verify.compare.cell_tree`;
    `facets` is (f, 3, 3). The test is that of Möller & Trumbore (1997).
    """
    n = points.shape[0]
    found = np.full(n, -np.inf)
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    stack = np.empty(64, dtype=np.int64)
    for i in range(n):
        x, step = points[i], steps[i]
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            node = stack[top]
            apart = False
            for a in range(3):
                end = x[a] + step[a]
                if min(x[a], end) > upper[node, a] or max(x[a], end) < lower[node, a]:
                    apart = True
            if apart:
                continue
            if node < leaves:
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
                if cells[k] < 0:
                    break
                t = _crossing(x, step, facets[cells[k]])
                found[i] = max(found[i], t)
    return found


@njit(cache=True)
def _crossing(x, step, facet):
    """Parameter in [0, 1] at which a way crosses a triangle, or −∞."""
    det = u = v = t = 0.0
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        e1, e2, off = facet[1, a] - facet[0, a], facet[2, a] - facet[0, a], x[a] - facet[0, a]
        p = step[b] * (facet[2, c] - facet[0, c]) - step[c] * (facet[2, b] - facet[0, b])
        q = (x[b] - facet[0, b]) * (facet[1, c] - facet[0, c])
        q -= (x[c] - facet[0, c]) * (facet[1, b] - facet[0, b])
        det += e1 * p
        u += off * p
        v += step[a] * q
        t += e2 * q
    if det == 0.0:
        return -np.inf
    u, v, t = u / det, v / det, t / det
    if u < -_EDGE or v < -_EDGE or u + v > 1.0 + _EDGE or t < -_EDGE or t > 1.0:
        return -np.inf
    return t
