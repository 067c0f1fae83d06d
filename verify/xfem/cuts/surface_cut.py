"""A cut along a triangulated surface in space: curved patches, closed shells, swept paths."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import index_array, places, real_array

__all__ = ["TriangulatedSurface"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_PAIRS_AT_ONCE = 500_000  # points × triangles in one sweep
_FLAT = 1e-12  # area over squared edge below which a triangle has none


@dataclass(frozen=True)
class TriangulatedSurface:
    """An oriented triangulated surface, open or closed.

    The side of a point is told by the angle-weighted normal of the nearest face, edge or vertex
    (Bærentzen & Aanæs 2005). Where the nearest feature is on the rim, the level set is that of
    the tangent plane there.

    Parameters
    ----------
    points : (n, 3) array_like
        Vertices, in metres.
    triangles : (m, 3) array_like of int
        Consistently oriented; the normal points to the positive side.

    Raises
    ------
    XfemError
        If a triangle has no area, or an edge is used twice in the same direction (orientation
        not consistent, or more than two triangles at an edge).
    """

    points: _Floats
    triangles: _Ints

    def __init__(self, points: ArrayLike, triangles: ArrayLike) -> None:
        vertices = real_array(points, "surface points")
        faces = index_array(triangles, "surface triangles")
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise XfemError(f"surface points of shape {vertices.shape}; expected finite (n, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0:
            raise XfemError(f"surface triangles of shape {faces.shape}; expected (m, 3), m > 0")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise XfemError(f"a surface triangle has a vertex outside 0..{len(vertices) - 1}")
        object.__setattr__(self, "points", vertices)
        object.__setattr__(self, "triangles", faces)
        areas = np.linalg.norm(self._area_vectors, axis=1)
        longest = np.linalg.norm(vertices[faces] - np.roll(vertices[faces], 1, axis=1), axis=2)
        flat = ~(areas > _FLAT * longest.max(axis=1) ** 2)
        if flat.any():
            raise XfemError(f"surface triangle {int(flat.argmax())} has no area")
        edges = faces[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2)
        if len(np.unique(edges, axis=0)) < len(edges):
            raise XfemError("the triangles of the surface are not consistently oriented")

    @cached_property
    def _area_vectors(self) -> _Floats:
        a, b, c = (self.points[self.triangles[:, k]] for k in range(3))
        return np.cross(b - a, c - a)

    @cached_property
    def _normals(self) -> _Floats:
        return self._area_vectors / np.linalg.norm(self._area_vectors, axis=1)[:, None]

    @cached_property
    def _opposite(self) -> _Ints:
        """(m, 3) triangle across the edge opposite to each vertex, -1 on the rim."""
        edges = self.triangles[:, [[1, 2], [2, 0], [0, 1]]]
        forward = {(int(p), int(q)): i for i, tri in enumerate(edges) for p, q in tri}
        return np.array([[forward.get((int(q), int(p)), -1) for p, q in tri] for tri in edges])

    @cached_property
    def _rim(self) -> NDArray[np.bool_]:
        """(n,) whether a vertex is on the rim."""
        rim = np.zeros(len(self.points), dtype=bool)
        for k in range(3):
            open_edge = self._opposite[:, k] < 0
            rim[self.triangles[open_edge][:, [(k + 1) % 3, (k + 2) % 3]]] = True
        return rim

    @cached_property
    def _rim_edges(self) -> _Floats:
        """(r, 2, 3) end points of the rim's edges."""
        face, k = np.nonzero(self._opposite < 0)
        ends = np.stack([self.triangles[face, (k + 1) % 3], self.triangles[face, (k + 2) % 3]], 1)
        return self.points[ends]

    @cached_property
    def _vertex_normals(self) -> _Floats:
        """(n, 3) angle-weighted normals, of length one."""
        total = np.zeros_like(self.points)
        for k in range(3):
            a, b, c = (self.points[self.triangles[:, (k + i) % 3]] for i in range(3))
            cosine = _dot(b - a, c - a) / np.sqrt(_dot(b - a, b - a) * _dot(c - a, c - a))
            angle = np.arccos(np.clip(cosine, -1.0, 1.0))
            np.add.at(total, self.triangles[:, k], angle[:, None] * self._normals)
        return total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]

    def level_set(self, points: _Floats) -> _Floats:
        """Signed distance to the surface, to its tangent plane past the rim."""
        foot, normal, rim, face = self._nearest(points)
        offset = points - foot
        side = np.where(_dot(offset, normal) >= 0.0, 1.0, -1.0)
        return np.where(rim | face, _dot(offset, normal), side * np.linalg.norm(offset, axis=1))

    def depth(self, points: _Floats) -> _Floats:
        """Distance along the surface's tangent to the rim, negative past it."""
        if len(self._rim_edges) == 0:
            return np.full(len(points), np.inf)
        foot, normal, rim, _ = self._nearest(points)
        offset = points - foot
        beyond = np.linalg.norm(offset - _dot(offset, normal)[:, None] * normal, axis=1)
        return np.where(rim, -beyond, _distance_to_edges(foot, self._rim_edges))

    def _nearest(
        self, points: _Floats
    ) -> tuple[_Floats, _Floats, NDArray[np.bool_], NDArray[np.bool_]]:
        """Nearest point, its normal, whether it is on the rim, whether inside a face."""
        points = places(points, 3, "surface")
        chunk = max(1, _PAIRS_AT_ONCE // len(self.triangles))
        face = np.zeros(len(points), dtype=np.int64)
        weights = np.zeros((len(points), 3))
        corners = self.points[self.triangles]
        for i in range(0, len(points), chunk):
            some = slice(i, i + chunk)
            face[some], weights[some] = _nearest_in_triangles(points[some], corners)
        foot = (weights[:, :, None] * corners[face]).sum(axis=1)
        normal = self._normals[face].copy()
        on_rim = np.zeros(len(points), dtype=bool)
        zeros = (weights == 0.0).sum(axis=1)
        edge, vertex = zeros == 1, zeros == 2
        if edge.any():
            across = self._opposite[face[edge], weights[edge].argmin(axis=1)]
            total = self._normals[face[edge]] + self._normals[across]
            length = np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None]
            normal[edge] = np.where((across < 0)[:, None], normal[edge], total / length)
            on_rim[edge] = across < 0
        if vertex.any():
            which = self.triangles[face[vertex], weights[vertex].argmax(axis=1)]
            normal[vertex] = self._vertex_normals[which]
            on_rim[vertex] = self._rim[which]
        return foot, normal, on_rim, zeros == 0


def _dot(a: _Floats, b: _Floats) -> _Floats:
    return (a * b).sum(axis=-1)


def _nearest_in_triangles(points: _Floats, corners: _Floats) -> tuple[_Ints, _Floats]:
    """Nearest triangle of each point and the barycentric coordinates of the nearest point in it.

    Coordinates of features not touched are exactly zero.
    """
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    g11, g12, g22 = _dot(ab, ab), _dot(ab, ac), _dot(ac, ac)
    to_point = points[:, None, :] - a
    p, q = _dot(to_point, ab), _dot(to_point, ac)
    determinant = g11 * g22 - g12**2
    v, w = (g22 * p - g12 * q) / determinant, (g11 * q - g12 * p) / determinant
    inside = (v > 0.0) & (w > 0.0) & (v + w < 1.0)
    candidates = [np.stack([1.0 - v - w, v, w], axis=-1)]
    for k in range(3):
        start, along = corners[:, (k + 1) % 3], corners[:, (k + 2) % 3] - corners[:, (k + 1) % 3]
        share = np.clip(_dot(points[:, None] - start, along) / _dot(along, along), 0.0, 1.0)
        weights = np.zeros((*share.shape, 3))
        weights[..., (k + 1) % 3], weights[..., (k + 2) % 3] = 1.0 - share, share
        candidates.append(weights)
    stacked = np.stack(candidates)
    feet = np.einsum("kpti,tij->kptj", stacked, corners)
    squared = ((points[None, :, None, :] - feet) ** 2).sum(axis=-1)
    squared[0][~inside] = np.inf
    count = len(corners)
    best = squared.transpose(1, 2, 0).reshape(len(points), -1).argmin(axis=1)
    face, feature = best // 4, best % 4
    assert face.max(initial=0) < count
    return face, stacked[feature, np.arange(len(points)), face]


def _distance_to_edges(points: _Floats, edges: _Floats) -> _Floats:
    start, along = edges[:, 0], edges[:, 1] - edges[:, 0]
    to_point = points[:, None] - start
    share = np.clip(_dot(to_point, along) / _dot(along, along), 0.0, 1.0)
    return np.linalg.norm(to_point - share[..., None] * along, axis=-1).min(axis=1)
