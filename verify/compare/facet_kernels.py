"""Kernel: distance to segments."""

import numpy as np
from numba import njit


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
