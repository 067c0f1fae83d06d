"""Planar predicates: simple polygons, polylines, points inside."""

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.geometry.simplices import distance_to_outline

Array = NDArray[np.float64]


def polygon_area(corners: Array) -> float:
    """Area of a polygon (k, 2), positive if its corners go anticlockwise."""
    x, y = (corners - corners[0]).T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def polygon_defect(corners: Array) -> str | None:
    """Why the closed polygon `corners` (n, 2) is not simple, or None if it is."""
    closed = np.vstack([corners, corners[:1]])
    defect = _segments_defect(closed, closed=True)
    if defect:
        return f"the polygon {defect}"
    if abs(polygon_area(corners)) <= 1e-12 * np.ptp(corners, axis=0).max() ** 2:
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
    left = _cross(b - a, p - a)
    winding = np.sum(above_a & ~above_b & (left > 0), axis=1) - np.sum(
        ~above_a & above_b & (left < 0), axis=1
    )
    return winding != 0


def arc_lengths(points: Array) -> Array:
    """Measure the way (k,) along a polyline (k, d) up to each of its points."""
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([np.zeros(min(len(points), 1)), np.cumsum(steps)])


def points_along(vertices: Array, fractions: ArrayLike) -> Array:
    """Find the points (..., d) at `fractions` (...) of the length of the polyline (k, d)."""
    lengths = arc_lengths(vertices)
    where = np.asarray(fractions) * lengths[-1]
    return np.stack([np.interp(where, lengths, column) for column in vertices.T], axis=-1)


def inner_parts(vertices: Array, corners: Array) -> list[tuple[Array, Array]]:
    """Find the parts of a polyline that lie inside a polygon and not along its boundary.

    Parameters
    ----------
    vertices : (n, 2) array
        The polyline.
    corners : (k, 2) array
        The polygon.

    Returns
    -------
    list of (start, end)
        Straight parts in the order of the polyline.
    """
    tolerance = 1e-9 * float(np.ptp(corners, axis=0).max())
    edges = np.roll(corners, -1, axis=0) - corners
    parts = []
    for a, b in pairwise(vertices):
        direction, offset = b - a, corners - a
        det = _cross(direction, edges)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = _cross(offset, edges) / det
            t = _cross(offset, direction) / det
        # corners too, for segments that run along an edge and leave it there
        along = offset @ direction / (direction @ direction)
        stops = np.concatenate([s[(t >= 0) & (t <= 1)], along, [0.0, 1.0]])
        stops = np.unique(stops[(stops >= 0) & (stops <= 1)])
        middle = a + (0.5 * (stops[1:] + stops[:-1]))[:, None] * direction
        inside = inside_polygon(middle, corners)
        inside &= distance_to_outline(middle, corners) > tolerance
        parts += [
            (a + stops[i] * direction, a + stops[i + 1] * direction) for i in np.flatnonzero(inside)
        ]
    return parts


def overlap_length(p: Array, q: Array) -> float:
    """Length over which the polylines `p` (n, 2) and `q` (m, 2) lie on each other.

    Less than 1e-9 of their size is none: they touch, up to round-off.
    """
    scale = float(np.ptp(np.vstack([p, q]), axis=0).max())
    total = 0.0
    for a, b in pairwise(p):
        length = float(np.linalg.norm(b - a))
        u = (b - a) / length
        off = np.maximum(np.abs(_cross(u, q[:-1] - a)), np.abs(_cross(u, q[1:] - a)))
        s, e = (q[:-1] - a) @ u, (q[1:] - a) @ u
        shared = np.clip(np.maximum(s, e), 0, length) - np.clip(np.minimum(s, e), 0, length)
        total += float(shared[off <= 1e-12 * scale].sum())
    return total if total > 1e-9 * scale else 0.0


def _cross(u: Array, v: Array) -> Array:
    cross: Array = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    return cross


def _segments_defect(points: Array, closed: bool) -> str | None:
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    scale = max(float(np.ptp(points, axis=0).max()), 1e-300)
    short = np.flatnonzero(lengths <= 1e-12 * scale)
    if short.size:
        return f"repeats point {int(short[0])} {tuple(points[short[0]].tolist())}"
    n = len(lengths)
    for i in range(n - 1):
        if _folds_back(points[i : i + 3]):
            return f"folds back onto itself between segments {i} and {i + 1}"
        last = n - 1 if closed and i == 0 else n  # the closing segment is a neighbour too
        met = _meet(points[i], points[i + 1], points[i + 2 : last], points[i + 3 : last + 1])
        if met.any():
            return f"intersects itself (segments {i} and {i + 2 + int(np.argmax(met))})"
    if closed and _folds_back(np.array([points[n - 1], points[0], points[1]])):
        return f"folds back onto itself between segments {n - 1} and 0"
    return None


def _folds_back(points: Array) -> bool:
    """Whether the path through three points turns by half a turn at the second."""
    u, v = points[1] - points[0], points[2] - points[1]
    size = float(np.linalg.norm(u) * np.linalg.norm(v))
    return bool(np.dot(u, v) < 0 and abs(float(_cross(u, v))) <= 1e-12 * size)


def _meet(a: Array, b: Array, c: Array, d: Array) -> NDArray[np.bool_]:
    """Whether segment ab shares a point with each of the segments c (m, 2) – d (m, 2)."""
    u, v, w = b - a, d - c, c - a
    size = np.linalg.norm(u) * np.linalg.norm(v, axis=1)
    det = _cross(u, v)
    parallel = np.abs(det) <= 1e-14 * size
    safe = np.where(parallel, 1.0, det)
    s, t = _cross(w, v) / safe, _cross(w, u) / safe
    crossing = (s >= -1e-12) & (s <= 1 + 1e-12) & (t >= -1e-12) & (t <= 1 + 1e-12)
    reach = np.maximum(np.linalg.norm(w, axis=1), np.linalg.norm(v, axis=1))
    on_line = np.abs(_cross(w, u)) <= 1e-12 * np.linalg.norm(u) * reach
    first, second = w @ u, (d - a) @ u
    touching = (np.minimum(first, second) <= u @ u) & (np.maximum(first, second) >= 0.0)
    met: NDArray[np.bool_] = np.where(parallel, on_line & touching, crossing)
    return met
