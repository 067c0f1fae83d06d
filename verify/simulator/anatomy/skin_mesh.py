"""The mesh of a scene's skin, and surfaces to show it by or to touch it on."""

from pathlib import Path
from typing import NamedTuple

import numpy as np

from verify.scene import Skin
from verify.simulator.anatomy.plane_mesh import Patch
from verify.simulator.anatomy.procedural import procedural_face, procedural_hand
from verify.simulator.anatomy.surface_file import outer_border, read_surface
from verify.simulator.anatomy.thicken import closed_shell, thicken
from verify.xfem.arrays import Bools, Floats, Ints


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
