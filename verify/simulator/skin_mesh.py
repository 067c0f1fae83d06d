"""The mesh of a scene's skin, and surfaces to show it by or to touch it on.

A skin is made by formulas or comes from a file: STL, OBJ, PLY, VTU, MSH and what else meshio reads.
With a thickness it has layers of prisms below it, each split into three tetrahedra along the
diagonals that start at the point with the smallest number, so that neighbours agree on the diagonal
of the face between them (Dompierre et al. 1999).
"""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from verify.errors import InputError
from verify.read_mesh import read_with_meshio
from verify.scene import Skin
from verify.simulator.skin_shapes import Patch, procedural_face, procedural_hand
from verify.xfem.arrays import Bools, Floats, Ints

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

    That of a file is at least as fine as the file.
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
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    single, place = np.unique(edges, axis=0, return_inverse=True)
    middle = len(points) + place.reshape(-1, 3)
    (a, b, c), (ab, bc, ca) = triangles.T, middle.T
    parts = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    cells = np.concatenate([np.column_stack(part) for part in parts])
    return np.concatenate([points, points[single].mean(axis=1)]), cells


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
    _check(points, triangles, str(path))
    return points, triangles


def border_loops(triangles: Ints) -> list[Ints]:
    """Points along each border of a surface, in the direction of its triangles."""
    edges = triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    inner = {(int(b), int(a)) for a, b in edges}
    follows = {int(a): int(b) for a, b in edges if (int(a), int(b)) not in inner}
    loops = []
    while follows:
        loop = [next(iter(follows))]
        while (after := follows.pop(loop[-1], None)) is not None and after != loop[0]:
            loop.append(after)
        loops.append(np.array(loop, dtype=np.int64))
    return loops


def outer_border(points: Floats, triangles: Ints) -> Bools:
    """Mark the points (n,) of the longest border; none of a closed surface."""
    rim = np.zeros(len(points), dtype=bool)
    loops = border_loops(triangles)
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


def _check(points: Floats, triangles: Ints, where: str) -> None:
    corners = points[triangles]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
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
    """(n, 3) unit normals at the points, weighted by the area of the triangles around."""
    corners = points[triangles]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.zeros_like(points)
    np.add.at(normals, triangles, area[:, None, :])
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return normals / np.where(length > 0.0, length, 1.0)


def thicken(
    points: Floats, triangles: Ints, thickness: float, layers: int = 1
) -> tuple[Floats, Ints]:
    """Tetrahedra between a surface and its copy at a distance below it.

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
