"""Triangulated surfaces from files: STL, OBJ, PLY, VTU, MSH and what else meshio reads."""

from pathlib import Path

import numpy as np

from verify.errors import InputError
from verify.read_mesh import read_with_meshio
from verify.xfem.arrays import Bools, Floats, Ints

_SAME = 1e-9  # of the extent: STL repeats every point for each of its triangles


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
