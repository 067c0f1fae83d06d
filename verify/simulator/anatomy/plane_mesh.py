"""A patch of skin over a plane, of triangles of nearly equal size.

The border is resampled at the element size and kept; inner points start on a hexagonal lattice
and are moved to the mean of their neighbours, Delaunay's triangles being made anew each time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import Delaunay, cKDTree

from verify.errors import InputError
from verify.xfem.arrays import Bools, Floats, Ints

_SWEEPS = 12  # of smoothing; angles change by less than a degree after that
_CLEARANCE = 0.62  # of an element size, between the border and the first inner points
_ATTEMPTS, _FINER = 12, 0.97
_FLAT = 0.05  # least shape of a triangle, 1 is equilateral


@dataclass(frozen=True)
class Patch:
    """Skin as a height over a plane.

    Attributes
    ----------
    outline : (k, 2) float array
        Outer border, m.
    height : callable
        z (n,) at points (n, 2), m.
    holes : list of (k, 2) float arrays
        Borders of openings, m.
    """

    outline: Floats
    height: Callable[[Floats], Floats]
    holes: list[Floats] = field(default_factory=list)

    def triangulate(self, triangles: int) -> tuple[Floats, Ints, int]:
        """Mesh the patch with about so many triangles.

        Returns
        -------
        points : (n, 3) float array
        triangles : (m, 3) int array
            Anticlockwise seen from outside the body.
        rim : int
            Number of points on the outer border, which are the first.
        """
        plane, cells, rim = mesh_of_about(self.outline, self.holes, triangles)
        return np.column_stack([plane, self.height(plane)]), cells, rim


def plane_mesh(outline: Floats, holes: list[Floats], size: float) -> tuple[Floats, Ints, int]:
    """Triangulate a domain.

    Parameters
    ----------
    outline : (k, 2) float array
        Corners of the outer border in order, m.
    holes : list of (k, 2) float arrays
    size : float
        Length of edges, m.

    Returns
    -------
    points : (n, 2) float array
        First those of the outer border, in order, then those of the holes.
    triangles : (m, 3) int array
        Anticlockwise.
    rim : int
        Number of points on the outer border.

    Raises
    ------
    InputError
        If the size is too coarse for the domain.
    """
    rings = [_resampled(ring, size) for ring in (outline, *holes)]
    border = np.concatenate(rings)
    points = np.concatenate([border, _lattice(rings, border, size)])
    fixed = len(border)
    for _ in range(_SWEEPS):
        triangles = _triangles(points, rings)
        points[fixed:] = _means(points, triangles)[fixed:]
    triangles = _triangles(points, rings)
    _check(points, triangles, rings, size)
    return points, triangles, len(rings[0])


def mesh_of_about(outline: Floats, holes: list[Floats], triangles: int) -> tuple[Floats, Ints, int]:
    """Triangulate a domain with about so many triangles; returns what `plane_mesh` does."""
    area = _area(outline) - sum(_area(hole) for hole in holes)
    size = float(np.sqrt(area / triangles * 4.0 / np.sqrt(3.0)))
    for _ in range(3):
        mesh, size = _next_finer(outline, holes, size)
        got = len(mesh[1])
        if abs(got / triangles - 1.0) < 0.01:
            break
        size *= float(np.sqrt(got / triangles))
    return mesh


def _next_finer(
    outline: Floats, holes: list[Floats], size: float
) -> tuple[tuple[Floats, Ints, int], float]:
    """Mesh with the first size that does, from the one asked for downwards, and that size.

    Where points happen to lie badly beside a narrow bend, a size a little smaller is right.
    """
    for attempt in range(_ATTEMPTS):
        try:
            return plane_mesh(outline, holes, size * _FINER**attempt), size * _FINER**attempt
        except InputError:
            if attempt == _ATTEMPTS - 1:
                raise
    raise AssertionError


def inside(points: Floats, rings: list[Floats]) -> Bools:
    """Whether points (n, 2) lie within the first ring and in none of the others."""
    odd = np.zeros(len(points), dtype=bool)
    for ring in rings:
        for (x0, y0), (x1, y1) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if y0 == y1:
                continue
            crosses = (y0 > points[:, 1]) != (y1 > points[:, 1])
            at = x0 + (points[:, 1] - y0) * (x1 - x0) / (y1 - y0)
            odd ^= crosses & (points[:, 0] < at)
    return odd


def _resampled(ring: Floats, size: float) -> Floats:
    closed = np.concatenate([ring, ring[:1]])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    # a hole keeps a shape however coarse the mesh
    count = max(6, round(along[-1] / size))
    places = np.arange(count) * along[-1] / count
    return np.column_stack([np.interp(places, along, closed[:, axis]) for axis in range(2)])


def _lattice(rings: list[Floats], border: Floats, size: float) -> Floats:
    low, high = rings[0].min(axis=0), rings[0].max(axis=0)
    rise = 0.5 * np.sqrt(3.0) * size
    rows = int(np.ceil((high[1] - low[1]) / rise)) + 1
    columns = int(np.ceil((high[0] - low[0]) / size)) + 2
    row, column = np.mgrid[0:rows, 0:columns]
    x = low[0] + (column - 0.5 * (row % 2)) * size
    points = np.column_stack([x.ravel(), (low[1] + row * rise).ravel()])
    far = cKDTree(border).query(points)[0] > _CLEARANCE * size
    return points[far & inside(points, rings)]


def _triangles(points: Floats, rings: list[Floats]) -> Ints:
    cells = Delaunay(points).simplices.astype(np.int64)
    corners = points[cells]
    kept = inside(corners.mean(axis=1), rings)
    edges = corners[:, 1:] - corners[:, :1]
    doubled = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1)
    # three points of a straight border are no triangle
    kept &= np.abs(doubled) > _FLAT * longest**2
    cells, doubled = cells[kept], doubled[kept]
    cells[doubled < 0.0] = cells[doubled < 0.0][:, ::-1]
    return cells


def _means(points: Floats, triangles: Ints) -> Floats:
    start, end = triangles.ravel(), np.roll(triangles, 1, axis=1).ravel()
    total = np.zeros_like(points)
    np.add.at(total, start, points[end])
    np.add.at(total, end, points[start])
    count = np.bincount(start, minlength=len(points)) + np.bincount(end, minlength=len(points))
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], points)


def _check(points: Floats, triangles: Ints, rings: list[Floats], size: float) -> None:
    """Every point is used, and the border of the triangles is that of the domain."""
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    single, uses = np.unique(edges, axis=0, return_counts=True)
    border = single[uses == 1]
    expected, begin = [], 0
    for ring in rings:
        number = begin + np.arange(len(ring))
        expected.append(np.sort(np.column_stack([number, np.roll(number, -1)]), axis=1))
        begin += len(ring)
    wanted = np.unique(np.concatenate(expected), axis=0)
    if not np.array_equal(border, wanted) or len(np.unique(triangles)) != len(points):
        raise InputError(f"an element size of {size:.3g} m is too coarse for the outline")


def _area(ring: Floats) -> float:
    x, y = ring.T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
