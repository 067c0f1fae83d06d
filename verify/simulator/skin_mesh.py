"""Skins: a face and the back of a hand made by formulas, meshes of skins, surfaces to show them by.

The formulas are sums of smooth bumps on a rounded base with the proportions of an adult, in
millimetres inside this file and metres outside. A patch of skin is meshed in its plane by triangles
of nearly equal size: the border is resampled at the element size and kept; inner points start on a
hexagonal lattice and are moved to the mean of their neighbours in Delaunay's triangles.

A skin comes from a file too: STL, OBJ, PLY, VTU, MSH and other formats of meshio. With a thickness
it has layers of prisms below it. Each prism is split into three tetrahedra along the diagonals that
start at the point with the smallest number. So neighbours agree on the diagonal of the face between
them (Dompierre et al. 1999).
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial import Delaunay, cKDTree

from verify.errors import InputError
from verify.geometry.planar import arc_lengths, inside_polygon, points_along, polygon_area
from verify.geometry.simplices import boundary_facets, boundary_loops, measures, refine_uniformly
from verify.read_mesh import read_with_meshio
from verify.scene import Skin
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
        First the outer border, in order, then the holes.
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
    _check_formula(points, triangles, rings, size)
    return points, triangles, len(rings[0])


def mesh_of_about(outline: Floats, holes: list[Floats], triangles: int) -> tuple[Floats, Ints, int]:
    """Triangulate a domain with about so many triangles; returns what `plane_mesh` does."""
    area = abs(polygon_area(outline)) - sum(abs(polygon_area(hole)) for hole in holes)
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


def _inside(points: Floats, rings: list[Floats]) -> Bools:
    """Tell whether points (n, 2) lie within the first ring and in none of the others."""
    first, *holes = (inside_polygon(points, ring) for ring in rings)
    return np.asarray(first & ~np.any([np.zeros_like(first), *holes], axis=0))


def _resampled(ring: Floats, size: float) -> Floats:
    closed = np.concatenate([ring, ring[:1]])
    # a hole keeps a shape however coarse the mesh
    count = max(6, round(float(arc_lengths(closed)[-1]) / size))
    return points_along(closed, np.arange(count) / count)


def _lattice(rings: list[Floats], border: Floats, size: float) -> Floats:
    low, high = rings[0].min(axis=0), rings[0].max(axis=0)
    rise = 0.5 * np.sqrt(3.0) * size
    rows = int(np.ceil((high[1] - low[1]) / rise)) + 1
    columns = int(np.ceil((high[0] - low[0]) / size)) + 2
    row, column = np.mgrid[0:rows, 0:columns]
    x = low[0] + (column - 0.5 * (row % 2)) * size
    points = np.column_stack([x.ravel(), (low[1] + row * rise).ravel()])
    far = cKDTree(border).query(points)[0] > _CLEARANCE * size
    return points[far & _inside(points, rings)]


def _triangles(points: Floats, rings: list[Floats]) -> Ints:
    cells = Delaunay(points).simplices.astype(np.int64)
    corners = points[cells]
    kept = _inside(corners.mean(axis=1), rings)
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


def _check_formula(points: Floats, triangles: Ints, rings: list[Floats], size: float) -> None:
    """Check that every point is used, and that the triangles have the border of the domain."""
    expected, begin = [], 0
    for ring in rings:
        number = begin + np.arange(len(ring))
        expected.append(np.sort(np.column_stack([number, np.roll(number, -1)]), axis=1))
        begin += len(ring)
    wanted = np.unique(np.concatenate(expected), axis=0)
    border, used = boundary_facets(triangles)[0], len(np.unique(triangles))
    if not np.array_equal(border, wanted) or used != len(points):
        raise InputError(f"an element size of {size:.3g} m is too coarse for the outline")


def procedural_face() -> Patch:
    """Make skin of a face, 150 mm wide, 205 mm high, with openings for the eyes and the mouth."""
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
    """Shape a ridge that rises from root to tip and falls off to the lip within a few mm."""
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


_SAME = 1e-9  # of the extent: STL repeats every point for each of its triangles
_SIGNS = (-1.0, 1.0, -1.0)  # orientation of the three tetrahedra of a prism that lies below


class SkinMesh(NamedTuple):
    """Points (n, 3) in m, triangles or tetrahedra, and which points are on the outer border."""

    points: Floats
    cells: Ints
    rim: Bools


def patch_of(skin: Skin) -> Patch:
    """Return the patch of a shape."""
    return procedural_face() if skin.shape == "face" else procedural_hand()


def skin_mesh(skin: Skin, folder: Path) -> SkinMesh:
    """Mesh the skin.

    Parameters
    ----------
    skin : Skin
    folder : Path
        From where a relative file name counts.

    Raises
    ------
    InputError
        If a file is missing or bad, the mesh too coarse, or the surface too curved.
    """
    # a prism under each triangle is three tetrahedra
    share = 1 if skin.thickness is None else 3 * skin.layers
    points, triangles, rim = _surface(skin, folder, (skin.elements or 0) / share)
    if skin.thickness is None:
        return SkinMesh(points, triangles, rim)
    solid, tetrahedra = thicken(points, triangles, skin.thickness, skin.layers)
    return SkinMesh(solid, tetrahedra, np.tile(rim, skin.layers + 1))


def skin_surface(skin: Skin, folder: Path, triangles: int) -> tuple[Floats, Ints]:
    """Close the surface of a skin with a thickness, made of about so many triangles.

    The mesh of a file is at least as fine as the file.
    """
    assert skin.thickness is not None
    points, cells, _ = _surface(skin, folder, triangles / 2)
    while skin.file is not None and 2 * len(cells) < triangles:
        points, cells = quartered(points, cells)
    return closed_shell(points, cells, skin.thickness)


def _surface(skin: Skin, folder: Path, count: float) -> tuple[Floats, Ints, Bools]:
    if skin.file is not None:
        points, triangles = read_surface(folder / skin.file)
        return points, triangles, outer_border(points, triangles)
    points, triangles, rim = patch_of(skin).triangulate(max(1, round(count)))
    return points, triangles, np.arange(len(points)) < rim


def quartered(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    """Split each triangle in four at the middles of its edges."""
    return refine_uniformly(points, triangles, triangles[:0, :2])[:2]


def read_surface(path: Path) -> tuple[Floats, Ints]:
    """Read a surface: points (n, 3) in m and triangles (m, 3), points in one place made one.

    Raises
    ------
    InputError
        If the file is missing, unreadable, or no oriented surface of triangles.
    """
    mesh = read_with_meshio(path, what="a surface")
    kinds = {block.type for block in mesh.cells if len(block.data)} - {"vertex", "line"}
    if kinds != {"triangle"}:
        found = ", ".join(sorted(kinds)) or "no cells"
        raise InputError(f"has {found}; expected a surface of triangles", str(path))
    points = np.asarray(mesh.points, dtype=float)
    if points.shape[1] != 3 or not np.isfinite(points).all():
        raise InputError("expected finite points in space", str(path))
    points, triangles = _welded(points, mesh.cells_dict["triangle"].astype(np.int64))
    _check_closed(points, triangles, str(path))
    return points, triangles


def outer_border(points: Floats, triangles: Ints) -> Bools:
    """Mark the points (n,) of the longest border; none of a closed surface."""
    rim = np.zeros(len(points), dtype=bool)
    loops = boundary_loops(triangles)
    if loops:
        lengths = [
            np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1).sum() for loop in loops
        ]
        rim[loops[int(np.argmax(lengths))]] = True
    return rim


def _welded(points: Floats, triangles: Ints) -> tuple[Floats, Ints]:
    extent = float(np.ptp(points, axis=0).max(initial=0.0))
    key = np.round(points / (_SAME * extent)) if extent > 0.0 else points
    _, first, place = np.unique(key, axis=0, return_index=True, return_inverse=True)
    cells = place.ravel()[triangles]
    used, compact = np.unique(cells, return_inverse=True)
    return points[first[used]], compact.reshape(cells.shape).astype(np.int64)


def _check_closed(points: Floats, triangles: Ints, where: str) -> None:
    corners = points[triangles]
    area = 2.0 * measures(corners)
    longest = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2).max(axis=1)
    if (flat := area <= 1e-12 * longest**2).any():
        raise InputError(
            f"{int(flat.sum())} triangles without area, the first is {int(np.argmax(flat))}", where
        )
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    if len(np.unique(edges, axis=0)) != len(edges):
        raise InputError(
            "an edge is used twice in one direction: more than two triangles meet there, or "
            "neighbours face different ways",
            where,
        )


def vertex_normals(points: Floats, triangles: Ints) -> Floats:
    """Return (n, 3) unit normals at the points, weighted by the area of the triangles around."""
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    np.add.at(normals, triangles, area[:, None, :])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def thicken(
    points: Floats, triangles: Ints, thickness: float, layers: int = 1
) -> tuple[Floats, Ints]:
    """Make tetrahedra between a surface and its copy at a distance below it.

    Parameters
    ----------
    points : (n, 3) float array
        m; they become the first n points of the result.
    triangles : (m, 3) int array
        Anticlockwise seen from outside.
    thickness : float
        m, along the normals.
    layers : int

    Returns
    -------
    points : (n (layers + 1), 3) float array
    tetrahedra : (3 m layers, 4) int array
        Of positive volume.

    Raises
    ------
    InputError
        If the surface is too curved for that thickness.
    """
    count = len(points)
    inwards = -thickness * vertex_normals(points, triangles)
    steps = np.linspace(0.0, 1.0, layers + 1)
    solid = np.concatenate([points + step * inwards for step in steps])
    upper = np.sort(triangles, axis=1)
    a, b, c = upper.T
    first = np.concatenate(
        [
            np.column_stack([a, b, c, c + count]),
            np.column_stack([a, b, b + count, c + count]),
            np.column_stack([a, a + count, b + count, c + count]),
        ]
    )
    tetrahedra = np.concatenate([first + layer * count for layer in range(layers)])
    # sorting has turned a triangle over where it was an odd permutation
    even = np.linalg.det(np.eye(3)[np.argsort(triangles, axis=1)])
    turned = np.tile(np.concatenate([sign * even for sign in _SIGNS]), layers)
    swap = turned < 0.0
    tetrahedra[swap, 0], tetrahedra[swap, 1] = tetrahedra[swap, 1], tetrahedra[swap, 0].copy()
    volume = np.linalg.det(solid[tetrahedra[:, 1:]] - solid[tetrahedra[:, :1]])
    if (volume <= 0.0).any():
        raise InputError(
            f"the surface is too curved to be {thickness:g} m thick: {int((volume <= 0.0).sum())} "
            f"of {len(tetrahedra)} elements turn inside out"
        )
    return solid, tetrahedra


def closed_shell(points: Floats, triangles: Ints, thickness: float) -> tuple[Floats, Ints]:
    """Close the surface (p, 3), (f, 3) of the solid that `thicken` makes, facing outwards."""
    count = len(points)
    shell = np.concatenate([points, points - thickness * vertex_normals(points, triangles)])
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    key = np.sort(edges, axis=1)
    _, place, uses = np.unique(key, axis=0, return_inverse=True, return_counts=True)
    start, end = edges[uses[place.ravel()] == 1].T
    sides = [np.column_stack([start, start + count, end]),
             np.column_stack([end, start + count, end + count])]  # fmt: skip
    return shell, np.concatenate([triangles, triangles[:, ::-1] + count, *sides])
