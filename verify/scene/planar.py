"""Planar predicates that validation needs: simple polygons, polylines, points inside."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["distance_to_outline", "inside_polygon", "polygon_defect", "polyline_defect"]

Array = NDArray[np.float64]


def polygon_defect(corners: Array) -> str | None:
    """Why the closed polygon `corners` (n, 2) is not simple, or None if it is."""
    closed = np.vstack([corners, corners[:1]])
    defect = _segments_defect(closed, closed=True)
    if defect:
        return f"the polygon {defect}"
    x, y = corners.T
    area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    if abs(area) <= 1e-12 * np.ptp(corners, axis=0).max() ** 2:
        return "the polygon has no area"
    return None


def polyline_defect(points: Array) -> str | None:
    """Why the polyline `points` (n, 2) cannot be a cut, or None if it can.

    A closed polyline (last point = first point) is accepted.
    """
    closed = len(points) > 3 and bool(np.array_equal(points[0], points[-1]))
    return _segments_defect(points, closed)


def inside_polygon(points: Array, corners: Array) -> NDArray[np.bool_]:
    """Whether each of `points` (n, 2) lies inside the polygon `corners` (k, 2), by winding."""
    p = points[:, None, :]
    a, b = corners[None], np.roll(corners, -1, axis=0)[None]
    above_a, above_b = a[..., 1] <= p[..., 1], b[..., 1] <= p[..., 1]
    left = (b[..., 0] - a[..., 0]) * (p[..., 1] - a[..., 1]) - (p[..., 0] - a[..., 0]) * (
        b[..., 1] - a[..., 1]
    )
    winding = np.sum(above_a & ~above_b & (left > 0), axis=1) - np.sum(
        ~above_a & above_b & (left < 0), axis=1
    )
    return winding != 0


def distance_to_outline(points: Array, corners: Array) -> Array:
    """Distance (n,) of each of `points` (n, 2) to the closed outline `corners` (k, 2)."""
    a, b = corners[None], np.roll(corners, -1, axis=0)[None]
    edge = b - a
    p = points[:, None, :] - a
    t = np.clip(np.sum(p * edge, axis=2) / np.sum(edge * edge, axis=2), 0.0, 1.0)
    return np.linalg.norm(p - t[..., None] * edge, axis=2).min(axis=1)


def _segments_defect(points: Array, closed: bool) -> str | None:
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    scale = max(float(np.ptp(points, axis=0).max()), 1e-300)
    short = np.flatnonzero(lengths <= 1e-12 * scale)
    if short.size:
        return f"repeats point {int(short[0])} {tuple(points[short[0]].tolist())}"
    n = len(lengths)
    for i in range(n):
        for j in range(i + 1, n):
            neighbours = j == i + 1 or (closed and i == 0 and j == n - 1)
            if neighbours:
                if _folds_back(points, i, j, n):
                    return f"folds back onto itself between segments {i} and {j}"
            elif _meet(points[i], points[i + 1], points[j], points[j + 1]):
                return f"intersects itself (segments {i} and {j})"
    return None


def _folds_back(points: Array, i: int, j: int, n: int) -> bool:
    first, second = (i, j) if j == i + 1 else (n - 1, 0)
    u = points[first + 1] - points[first]
    v = points[second + 1] - points[second]
    cross = u[0] * v[1] - u[1] * v[0]
    return bool(np.dot(u, v) < 0 and abs(cross) <= 1e-12 * np.linalg.norm(u) * np.linalg.norm(v))


def _meet(a: Array, b: Array, c: Array, d: Array) -> bool:
    """Whether segments ab and cd share a point (end points included)."""
    u, v, w = b - a, d - c, c - a
    scale = float(np.linalg.norm(u) * np.linalg.norm(v))
    det = u[0] * v[1] - u[1] * v[0]
    if abs(det) > 1e-14 * scale:
        s = (w[0] * v[1] - w[1] * v[0]) / det
        t = (w[0] * u[1] - w[1] * u[0]) / det
        return bool(-1e-12 <= s <= 1 + 1e-12 and -1e-12 <= t <= 1 + 1e-12)
    if abs(w[0] * u[1] - w[1] * u[0]) > 1e-12 * np.linalg.norm(u) * max(np.linalg.norm(w), 1e-300):
        return False
    along = sorted((float(np.dot(c - a, u)), float(np.dot(d - a, u))))
    return along[0] <= float(np.dot(u, u)) and along[1] >= 0.0
