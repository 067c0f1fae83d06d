"""A face and the back of a hand made by formulas, for scenes that need no real anatomy.

Plausible proportions of an adult, not of anybody: sums of smooth bumps on a rounded base, in
millimetres inside this file, metres outside. A patch of skin is meshed in its plane, by triangles
of nearly equal size: the border is resampled at the element size and kept; inner points start on a
hexagonal lattice and are moved to the mean of their neighbours, Delaunay's triangles being made
anew each time.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay, cKDTree

from verify.errors import InputError
from verify.xfem.arrays import Bools, Floats, Ints

_MM = 1e-3
_POINTS = 400  # on a border, far more than any mesh resolves

# height, x, y, width in x, width in y of each bump; mirrored ones stand for both sides
_FACE_MIRRORED = [
    (4.0, 30.0, 45.0, 17.0, 7.0),  # brow
    (-9.0, 31.0, 27.0, 15.0, 11.0),  # socket
    (4.0, 31.0, 26.0, 13.0, 7.0),  # eyeball under the lids
    (5.0, 44.0, 4.0, 16.0, 16.0),  # cheekbone
    (8.0, 11.0, -12.0, 6.0, 6.0),  # wing of the nose
    (-3.5, 38.0, -38.0, 12.0, 18.0),  # hollow of the cheek
]
_FACE_MIDDLE = [
    (5.5, 0.0, -39.5, 20.0, 4.0),  # upper lip
    (6.0, 0.0, -51.0, 18.0, 4.5),  # lower lip
    (-2.5, 0.0, -61.0, 20.0, 5.0),  # fold above the chin
    (9.0, 0.0, -78.0, 17.0, 11.0),  # chin
    (-1.8, 0.0, -30.0, 3.5, 6.0),  # philtrum
]
# left hand from behind: wrist, little finger to index finger, thumb
_HAND_BORDER = [
    (-27, -52), (-36, -35), (-41, -10), (-43, 15), (-45, 32), (-46, 44), (-40, 51), (-31, 50),
    (-25.5, 42), (-22, 50), (-19, 60), (-10.5, 63), (-4, 58), (-1, 46), (2, 57), (7, 65),
    (15, 65), (20, 58), (22, 45), (26, 55), (32, 60), (40, 57), (45, 48), (46, 35), (46, 18),
    (51, 5), (59, -6), (60, -18), (51, -25), (41, -33), (33, -43), (28, -52), (15, -55), (0, -56),
    (-14, -55),
]  # fmt: skip
_KNUCKLES = [(-33, 33), (-12, 41), (11, 43), (34, 38)]
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


def procedural_face() -> Patch:
    """Skin of a face, 150 mm wide, 205 mm high, with openings for the eyes and the mouth."""
    holes = [_almond(side * 31.0, 26.5, 14.0, 5.0) for side in (1.0, -1.0)]
    holes.append(_almond(0.0, -45.0, 23.0, 2.2))
    return Patch(_egg() * _MM, _in_metres(_face_height), [hole * _MM for hole in holes])


def procedural_hand() -> Patch:
    """Skin of the back of a left hand up to the roots of the fingers, about 110 mm × 120 mm."""
    border = np.array(_HAND_BORDER, dtype=float)
    closed = np.concatenate([border, border[:1]])
    # clockwise as written down, for the eye to follow; the spline keeps the round of the fingers
    turns = np.arange(len(closed))
    spline = CubicSpline(turns, closed, bc_type="periodic")
    outline = spline(np.linspace(0.0, turns[-1], _POINTS, endpoint=False))[::-1]
    return Patch(outline * _MM, _in_metres(_hand_height))


def _in_metres(height: Callable[[Floats, Floats], Floats]) -> Callable[[Floats], Floats]:
    return lambda points: height(points[:, 0] / _MM, points[:, 1] / _MM) * _MM


def _egg() -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS, endpoint=False)
    y = -5.0 + 102.0 * np.sin(turn)
    # narrower at the chin than at the forehead
    x = (72.0 + 5.0 * np.sin(turn) - 4.0 * np.sin(turn) ** 2) * np.cos(turn)
    return np.column_stack([x, y])


def _almond(x: float, y: float, half_length: float, half_height: float) -> Floats:
    turn = np.linspace(0.0, 2.0 * np.pi, _POINTS // 4, endpoint=False)
    lens = np.sin(turn) * np.abs(np.sin(turn)) ** 0.5
    return np.column_stack([x + half_length * np.cos(turn), y + half_height * lens])


def _bump(x: Floats, y: Floats, bump: tuple[float, ...], side: float = 1.0) -> Floats:
    height, x0, y0, wx, wy = bump
    return height * np.exp(-(((x - side * x0) / wx) ** 2) - ((y - y0) / wy) ** 2)


def _face_height(x: Floats, y: Floats) -> Floats:
    base = 55.0 * (1.0 - (np.abs(x) / 92.0) ** 2.4) - 18.0 * (np.abs(y + 5.0) / 102.0) ** 2.5
    for bump in _FACE_MIRRORED:
        base = base + _bump(x, y, bump, 1.0) + _bump(x, y, bump, -1.0)
    for bump in _FACE_MIDDLE:
        base = base + _bump(x, y, bump)
    return base + _nose(x, y)


def _nose(x: Floats, y: Floats) -> Floats:
    """Ridge that rises from the root to the tip and falls off to the lip within a few mm."""
    root, tip, foot = 32.0, -9.0, -21.0
    rise = np.clip((root - y) / (root - tip), 0.0, 1.0) ** 1.3
    fall = np.clip((y - foot) / (tip - foot), 0.0, 1.0)
    along = np.where(y >= tip, rise, fall * fall * (3.0 - 2.0 * fall))
    width = 7.0 + 4.0 * rise
    return 21.0 * along * np.exp(-((x / width) ** 2))


def _hand_height(x: Floats, y: Floats) -> Floats:
    arch = 16.0 * (1.0 - (np.abs(x) / 62.0) ** 2.2) - 4.0 * ((y - 5.0) / 60.0) ** 2
    for x0, y0 in _KNUCKLES:
        arch = arch + _bump(x, y, (5.0, x0, y0, 8.5, 10.0))
        # the tendon that runs from the wrist to the knuckle
        share = np.clip((y + 50.0) / (y0 + 50.0), 0.0, 1.0)
        arch = arch + 1.3 * np.exp(-(((x - share * x0) / 3.5) ** 2)) * share * (y < y0)
        # fingers are round: between them the skin falls off to the web
        beyond = np.clip((y - y0 - 4.0) / 12.0, 0.0, 1.0)
        arch = arch - 2.5 * beyond * np.clip(np.abs(x - x0) / 11.0, 0.0, 1.0) ** 2 * (
            np.abs(x - x0) < 11.0
        )
    return arch
