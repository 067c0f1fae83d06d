"""Nearest points on segments, and distances to polylines and triangulated surfaces."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_AT_ONCE = 2**20  # pairs of a point and a part


def shares(points: Array, starts: Array, ends: Array) -> Array:
    """Where on segments the nearest points are: 0 at the start, 1 at the end.

    The arrays (..., d) are broadcast against each other; a segment may have no length.
    """
    along = ends - starts
    square = np.maximum(np.sum(along**2, axis=-1), np.finfo(float).tiny)
    found: Array = np.clip(np.sum((points - starts) * along, axis=-1) / square, 0.0, 1.0)
    return found


def feet(points: Array, starts: Array, ends: Array) -> Array:
    """Nearest points (..., d) on segments; the arrays are broadcast against each other."""
    found: Array = starts + shares(points, starts, ends)[..., None] * (ends - starts)
    return found


def nearest_parts(points: Array, parts: Array) -> tuple[Array, Ints]:
    """Distances (n,) of points (n, d) to the nearest of segments or triangles, and its number.

    Parameters
    ----------
    points : (n, d) array
    parts : (m, 2, d) or (m, 3, 3) array
        Ends of segments, or corners of triangles in space, m > 0.
    """
    distance, number = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    step = max(1, _AT_ONCE // len(parts))
    for start in range(0, len(points), step):
        here = slice(start, start + step)
        away = _distances(points[here, None], parts)
        number[here] = away.argmin(axis=1)
        distance[here] = away.min(axis=1)
    return distance, number


def distance_to_outline(points: Array, corners: Array) -> Array:
    """Distance (n,) of each of `points` (n, d) to the closed outline `corners` (k, d)."""
    return nearest_parts(points, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))[0]


def distance_to_polyline(points: Array, vertices: Array) -> Array:
    """Distance (n,) of each of `points` (n, d) to the polyline `vertices` (k, d)."""
    return nearest_parts(points, np.stack([vertices[:-1], vertices[1:]], axis=1))[0]


def distance_to_triangles(points: Array, surface: tuple[Array, Ints]) -> Array:
    """Distance (n,) of points (n, 3) to a triangulated surface, m."""
    return nearest_parts(points, surface[0][surface[1]])[0]


class HasFeet(Protocol):
    """A piece of a curve or of a surface."""

    def foot(self, points: Array, /) -> Array:
        """Nearest points (n, d) to points (n, d)."""


def distance_to_pieces(points: Array, pieces: Sequence[HasFeet]) -> Array:
    """Distance (n,) of points (n, d) to the nearest of pieces of a cut, not cut into facets, m."""
    away = [np.linalg.norm(points - one.foot(points), axis=1) for one in pieces]
    return np.asarray(np.min(away, axis=0), dtype=float)


def _distances(points: Array, parts: Array) -> Array:
    """Distances (n, m) of points (n, 1, d) to segments or triangles."""
    edges = [(0, 1)] if parts.shape[1] == 2 else [(0, 1), (1, 2), (2, 0)]
    away = np.full((len(points), len(parts)), np.inf)
    for i, j in edges:
        start, end = parts[:, i], parts[:, j]
        share = shares(points, start, end)[..., None]
        off = np.linalg.norm(points - start - share * (end - start), axis=2)
        away = np.minimum(away, off)
    if len(edges) == 3:
        normal = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
        above = np.ones(away.shape, dtype=bool)
        for i, j in edges:
            inward = np.cross(normal, parts[:, j] - parts[:, i])
            above &= np.sum((points - parts[:, i]) * inward, axis=2) >= 0.0
        height = np.abs(np.sum((points - parts[:, 0]) * normal, axis=2))
        height /= np.linalg.norm(normal, axis=1)
        away = np.where(above, np.minimum(away, height), away)
    return away


def on_simplices(points: Array, corners: Array, tolerance: float) -> NDArray[np.bool_]:
    """Tell which points (n, d) lie on simplices (m, c, d) with c corners, within a tolerance, m."""
    from scipy.spatial import cKDTree  # commands that only read cases shall not load scipy

    found = np.zeros(len(points), dtype=bool)
    start, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
    # rates of the barycentric coordinates but the first
    rates = np.linalg.pinv(edges) if edges.shape[1] else np.swapaxes(edges, 1, 2)
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) * (1.0 + 1e-12)
    for begin in range(0, len(points), _AT_ONCE // 16):
        some = points[begin : begin + _AT_ONCE // 16]
        near = cKDTree(some).query_ball_point(middle, reach + tolerance)
        which = np.repeat(np.arange(len(near)), [len(one) for one in near])
        point = np.concatenate([*near, []]).astype(np.int64)
        away = some[point] - start[which]
        share = np.einsum("nd,ndc->nc", away, rates[which])
        on = np.linalg.norm(away - np.einsum("nc,ncd->nd", share, edges[which]), axis=1)
        on = on <= tolerance
        on &= (share >= -tolerance * np.linalg.norm(rates[which], axis=1)).all(axis=1)
        last = np.linalg.norm(rates.sum(axis=2), axis=1)[which]
        on &= 1.0 - share.sum(axis=1) >= -tolerance * last
        found[begin + point[on]] = True
    return found
