"""The cut that a point of its faces, as a solver realises them, belongs to."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.scene.spatial_cuts import SpatialCut

if TYPE_CHECKING:
    from verify.scene.scene import Scene

Array = NDArray[np.float64]

_CHUNK = 2**20  # pairs of points and parts of a cut at a time


class Faces(NamedTuple):
    """The cut nearest to each of n points.

    Attributes
    ----------
    cut : (n,) int array
        Its number in the scene.
    normal : (n, d) array
        Unit normal of its nearest part, towards its positive side.
    """

    cut: NDArray[np.int64]
    normal: Array


def faces_of(scene: "Scene", points: Array) -> Faces:
    """Find the cut that each point (n, d) lies on: the nearest, of which curves are faceted."""
    away = np.full(len(points), np.inf)
    cut, normal = np.zeros(len(points), dtype=np.int64), np.zeros(points.shape)
    for k, one in enumerate(scene.cuts):
        parts, normals = _parts(one)
        distance, nearest = _nearest(points, parts)
        closer = distance < away
        away[closer], cut[closer], normal[closer] = (
            distance[closer], k, normals[nearest[closer]],
        )  # fmt: skip
    return Faces(cut, normal)


def distance_to_cuts(cuts: Sequence[Any], points: Array) -> Array:
    """Distances (n, c) of points (n, d) to cuts, of which curves are faceted, m."""
    found = [_nearest(points, _parts(cut)[0])[0] for cut in cuts]
    return np.array(found).reshape(len(cuts), len(points)).T


def _parts(cut: Any) -> tuple[Array, Array]:
    """Segments (m, 2, 2) or triangles (m, 3, 3) of a cut, and their unit normals (m, d)."""
    if isinstance(cut, SpatialCut):
        points, triangles = cut.surface()
        parts = points[triangles]
        normals = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
    else:
        vertices = cut.vertices()
        parts = np.stack([vertices[:-1], vertices[1:]], axis=1)
        along = parts[:, 1] - parts[:, 0]
        normals = np.column_stack([-along[:, 1], along[:, 0]])
    return parts, normals / np.linalg.norm(normals, axis=1)[:, None]


def _nearest(points: Array, parts: Array) -> tuple[Array, NDArray[np.int64]]:
    """Distance (n,) to the nearest of m parts, and its number (n,)."""
    distance, number = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    step = max(1, _CHUNK // len(parts))
    for start in range(0, len(points), step):
        here = slice(start, start + step)
        away = _distances(points[here], parts)
        number[here] = away.argmin(axis=1)
        distance[here] = away.min(axis=1)
    return distance, number


def _distances(points: Array, parts: Array) -> Array:
    """Distances (n, m) of points to segments or triangles."""
    corners = parts.shape[1]
    away = np.full((len(points), len(parts)), np.inf)
    edges = [(0, 1)] if corners == 2 else [(0, 1), (1, 2), (2, 0)]
    for i, j in edges:
        start, along = parts[:, i], parts[:, j] - parts[:, i]
        spoke = points[:, None] - start
        share = np.clip(np.sum(spoke * along, axis=2) / np.sum(along**2, axis=1), 0.0, 1.0)
        off = np.linalg.norm(spoke - share[:, :, None] * along, axis=2)
        away = np.minimum(away, off)
    if corners == 3:
        normal = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
        above = np.ones(away.shape, dtype=bool)
        for i, j in edges:
            inward = np.cross(normal, parts[:, j] - parts[:, i])
            above &= np.sum((points[:, None] - parts[:, i]) * inward, axis=2) >= 0.0
        height = np.abs(np.sum((points[:, None] - parts[:, 0]) * normal, axis=2))
        height /= np.linalg.norm(normal, axis=1)
        away = np.where(above, np.minimum(away, height), away)
    return away
