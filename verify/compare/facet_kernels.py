"""Kernel: nearest segments."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_Floats = NDArray[np.float64]


def distance_to_segments(points: _Floats, starts: _Floats, ends: _Floats) -> _Floats:
    """Distance (n,) of points (n, d) to the nearest segment (k, d)–(k, d); infinite without any."""
    return nearest_segments(points, starts, ends)[0]


def nearest_segments(points: _Floats, starts: _Floats, ends: _Floats) -> tuple[_Floats, _Floats]:
    """Distance (n,) of points (n, d) to the nearest of segments (k, d)–(k, d), and its foot (n, d).

    Without any segment the distance is infinite, and the foot the point.
    """
    distance, foot = np.empty(len(points)), np.array(points, dtype=float)
    _nearest(points, starts, ends, distance, foot)
    return distance, foot


@njit(cache=True)
def _nearest(points, starts, ends, distance, foot):
    n, d = points.shape
    for i in range(n):
        best, where, share = np.inf, -1, 0.0
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
            if away2 < best:
                best, where, share = away2, k, t
        distance[i] = np.sqrt(best)
        if where >= 0:
            for c in range(d):
                foot[i, c] = (1 - share) * starts[where, c] + share * ends[where, c]
