"""Frames, and predicates in space: triangulated cuts against a box, and each other."""

from math import factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_TOLERANCE = 1e-9  # of the body's size


def frame(normal: ArrayLike, axis: ArrayLike | None = None) -> Array:
    """Right-handed orthonormal frame, as rows (3, 3), whose third vector is along `normal`.

    Parameters
    ----------
    normal : (3,) array_like
        Not zero.
    axis : (3,) array_like, optional
        The first vector is along its projection; by default along the projection of the
        coordinate direction that is farthest from the normal.
    """
    third = np.asarray(normal, dtype=float)
    third = third / np.linalg.norm(third)
    guide = np.eye(3)[np.argmin(np.abs(third))] if axis is None else np.asarray(axis, dtype=float)
    first = guide - (guide @ third) * third
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])


def measures(simplices: Array) -> Array:
    """Lengths, areas, volumes (m,) of segments, triangles, tetrahedra (m, c, d); of a point 1."""
    count = simplices.shape[1] - 1
    if count in (0, simplices.shape[2]):
        sides = simplices[:, 1:] - simplices[:, :1]
        return np.abs(np.linalg.det(sides)) / factorial(count) if count else np.ones(len(sides))
    edges = np.moveaxis(simplices[:, 1:] - simplices[:, :1], 1, 0)
    across = 0.5 * np.cross(*edges) if len(edges) == 2 else edges[0]
    return np.asarray(np.linalg.norm(across, axis=1))


def unit_normals(simplices: Array) -> Array:
    """Return unit normals (m, d) of segments (m, 2, 2), to the left, or of triangles (m, 3, 3)."""
    edges = np.moveaxis(simplices[:, 1:] - simplices[:, :1], 1, 0)
    across = np.cross(*edges) if len(edges) == 2 else edges[0][:, ::-1] * [-1.0, 1.0]
    return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def ear_clipping(corners: Array) -> Ints:
    """Triangles (n - 2, 3) of a plane simple polygon (n, 3), turned as the polygon is."""
    spokes = corners - corners[0]
    plane = corners @ frame(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0))[:2].T
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        areas = []
        for k in range(len(left)):
            ear = plane[[left[k - 1], left[k], left[(k + 1) % len(left)]]]
            area = _area(ear)
            others = plane[[i for j, i in enumerate(left) if abs(j - k) > 1]]
            blocked = area > 0.0 and len(others) > 0 and bool(_strictly_inside(others, ear).any())
            areas.append(-np.inf if blocked else area)
        k = int(np.argmax(areas))
        triangles.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return np.array([*triangles, tuple(left)], dtype=np.int64)


def _area(triangle: Array) -> float:
    (ax, ay), (bx, by), (cx, cy) = triangle
    return 0.5 * float((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))


def _strictly_inside(points: Array, triangle: Array) -> NDArray[np.bool_]:
    """Whether points (n, 2) other than its corners lie in an anticlockwise triangle (3, 2)."""
    inside = (points[:, None] != triangle).any(axis=2).all(axis=1)
    for k in range(3):
        a, b = triangle[k], triangle[(k + 1) % 3]
        inside &= (b[0] - a[0]) * (points[:, 1] - a[1]) - (points[:, 0] - a[0]) * (
            b[1] - a[1]
        ) >= 0.0
    return inside


def area_inside(surface: tuple[Array, Ints], lower: Array, upper: Array) -> float:
    """Area of a triangulated surface inside an open box; what lies along its faces is not."""
    points, triangles = surface
    tolerance = _TOLERANCE * float(np.max(upper - lower))
    total = 0.0
    for triangle in points[triangles]:
        polygon = _clipped(triangle, lower, upper)
        if len(polygon) >= 3:
            middle = polygon.mean(axis=0)
            if ((middle > lower + tolerance) & (middle < upper - tolerance)).all():
                total += _polygon_area(polygon)
    return total if total > tolerance**2 else 0.0


def length_inside(edges: Array, lower: Array, upper: Array) -> float:
    """Length of segments (r, 2, 3) inside an open box."""
    tolerance = _TOLERANCE * float(np.max(upper - lower))
    total = 0.0
    for a, b in edges:
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.concatenate(
                [(lower + tolerance - a) / (b - a), (upper - tolerance - a) / (b - a)]
            )
        stops = np.unique(np.concatenate([s[(s > 0) & (s < 1)], [0.0, 1.0]]))
        middle = a + 0.5 * (stops[1:] + stops[:-1])[:, None] * (b - a)
        inside = ((middle > lower + tolerance) & (middle < upper - tolerance)).all(axis=1)
        total += float(np.diff(stops)[inside].sum() * np.linalg.norm(b - a))
    return total if total > tolerance else 0.0


def rim_edges(surface: tuple[Array, Ints]) -> Array:
    """Edges (r, 2, 3) that belong to one triangle only."""
    points, triangles = surface
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    distinct, count = np.unique(edges, axis=0, return_counts=True)
    return points[distinct[count == 1]]


def overlap_area(one: tuple[Array, Ints], other: tuple[Array, Ints]) -> float:
    """Area over which two triangulated surfaces lie on each other, m²."""
    first, second = one[0][one[1]], other[0][other[1]]
    scale = float(np.ptp(np.vstack([one[0], other[0]]), axis=0).max())
    tolerance = _TOLERANCE * scale
    total = 0.0
    normals = np.cross(second[:, 1] - second[:, 0], second[:, 2] - second[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    for triangle in first:
        off = np.abs(np.einsum("tij,tj->ti", triangle - second[:, :1], normals)).max(axis=1)
        apart = (triangle.min(axis=0) > second.max(axis=1) + tolerance) | (
            triangle.max(axis=0) < second.min(axis=1) - tolerance
        )
        for k in np.flatnonzero((off <= tolerance) & ~apart.any(axis=1)):
            total += _common_area(triangle, second[k], normals[k])
    return total if total > tolerance * scale else 0.0


def _common_area(one: Array, other: Array, normal: Array) -> float:
    polygon = one
    for k in range(3):
        a, b = other[k], other[(k + 1) % 3]
        inward = np.cross(normal, b - a)
        polygon = _half(polygon, (polygon - a) @ inward)
    return _polygon_area(polygon) if len(polygon) >= 3 else 0.0


def _clipped(polygon: Array, lower: Array, upper: Array) -> Array:
    """Part (k, 3) of a plane polygon inside a closed box (Sutherland & Hodgman 1974)."""
    for axis in range(3):
        polygon = _half(polygon, polygon[:, axis] - lower[axis])
        polygon = _half(polygon, upper[axis] - polygon[:, axis])
    return polygon


def _half(polygon: Array, height: Array) -> Array:
    """Part of a polygon (k, 3) where the linear function with these corner values is ≥ 0."""
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if height[i] >= 0.0:
            kept.append(polygon[i])
        if (height[i] >= 0.0) != (height[j] >= 0.0):
            share = height[i] / (height[i] - height[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, 3)


def _polygon_area(polygon: Array) -> float:
    spokes = polygon - polygon[0]
    return 0.5 * float(np.linalg.norm(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0)))
