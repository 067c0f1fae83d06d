"""The cut that a point of its faces, as a solver realises them, belongs to."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.geometry.nearest import nearest_parts
from verify.scene.spatial_cuts import SpatialCut

if TYPE_CHECKING:
    from verify.scene.scene import Scene

Array = NDArray[np.float64]


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
        distance, nearest = nearest_parts(points, parts)
        closer = distance < away
        away[closer], cut[closer], normal[closer] = (
            distance[closer], k, normals[nearest[closer]],
        )  # fmt: skip
    return Faces(cut, normal)


def distance_to_cuts(cuts: Sequence[Any], points: Array) -> Array:
    """Distances (n, c) of points (n, d) to cuts, of which curves are faceted, m."""
    found = [nearest_parts(points, _parts(cut)[0])[0] for cut in cuts]
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
