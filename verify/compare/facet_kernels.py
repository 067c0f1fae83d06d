"""Kernel: nearest segments."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_Floats = NDArray[np.float64]


def distance_to_segments(points: _Floats, segments: _Floats) -> _Floats:
    """Distance (n,) of points (n, d) to the nearest segment (k, 2, d); infinite without any."""
    return nearest_segments(points, segments)[0]


def nearest_segments(
    points: _Floats, segments: _Floats
) -> tuple[_Floats, _Floats, NDArray[np.int64]]:
    """Distance (n,) of points (n, d) to the nearest segment, its foot (n, d), and which it is (n,).

    Without any segment the distance is infinite, the foot the point, and the segment −1.
    """
    distance, foot = np.empty(len(points)), np.array(points, dtype=float)
    which = np.empty(len(points), dtype=np.int64)
    starts, ends = (np.ascontiguousarray(segments[:, k]) for k in (0, 1))
    _nearest(np.ascontiguousarray(points), starts, ends, distance, foot, which)
    return distance, foot, which


@njit(cache=True)
def _nearest(points, starts, ends, distance, foot, which):
    n, d = points.shape
    for i in range(n):
        best, share, which[i] = np.inf, 0.0, -1
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
                best, which[i], share = away2, k, t
        distance[i], k = np.sqrt(best), which[i]
        if k >= 0:
            for c in range(d):
                foot[i, c] = (1 - share) * starts[k, c] + share * ends[k, c]
