"""Kernel: distance to segments."""

import numpy as np
from numba import njit
from numpy.typing import NDArray


def distance_to_segments(
    points: NDArray[np.float64], starts: NDArray[np.float64], ends: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distance (n,) of points (n, d) to the nearest segment (k, d)–(k, d)."""
    distance = np.empty(len(points))
    _distances(points, starts, ends, distance)
    return distance


@njit(cache=True)
def _distances(points, starts, ends, distance):
    n, d = points.shape
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
