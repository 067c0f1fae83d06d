"""The MakeHuman base mesh (hm08, CC0): its skin, and the places that say where things are.

The file is a Wavefront OBJ in decimetres, y up, the face towards +z. Small cubes in groups of
their own mark joints and other places; the skin is the group ``body``.
"""

from dataclasses import dataclass

import numpy as np

from verify.errors import InputError
from verify.xfem.arrays import Floats, Ints

_DECIMETRE = 0.1
_NEEDED = {
    "body", "helper-l-eye", "helper-upper-teeth", "helper-lower-teeth", "joint-jaw", "joint-l-eye",
    "joint-r-eye", "joint-l-hand", *(f"joint-l-finger-{k}-1" for k in range(2, 6)),
}  # fmt: skip


@dataclass(frozen=True)
class BaseMesh:
    """Skin as triangles, and the middle of every marked place by the name of its group.

    Attributes
    ----------
    points : (n, 3) float array
        m.
    triangles : (m, 3) int array
        Anticlockwise seen from outside.
    places : dict
        (3,) each, m.
    eye : (k, 3) float array
        Points of the left eyeball, m.
    """

    points: Floats
    triangles: Ints
    places: dict[str, Floats]
    eye: Floats


def parse_base_mesh(text: str) -> BaseMesh:
    """Read the file.

    Raises
    ------
    InputError
        If it is not that mesh.
    """
    points: list[list[float]] = []
    faces: dict[str, list[list[int]]] = {}
    group = ""
    for line in text.splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            points.append([float(word) for word in rest.split()])
        elif kind == "g":
            group = rest.strip()
        elif kind == "f":
            corners = [int(word.partition("/")[0]) - 1 for word in rest.split()]
            faces.setdefault(group, []).append(corners)
    if not faces.keys() >= _NEEDED:
        raise InputError("not the MakeHuman base mesh: a group of its faces is missing")
    at = np.array(points) * _DECIMETRE
    triangles = [t for face in faces["body"] for t in _triangles(face)]
    members = {name: np.unique(np.concatenate(faces[name])) for name in faces}
    places = {name: at[own].mean(axis=0) for name, own in members.items() if name != "body"}
    return BaseMesh(at, np.array(triangles, dtype=np.int64), places, at[members["helper-l-eye"]])


def _triangles(face: list[int]) -> list[list[int]]:
    return [[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)]
