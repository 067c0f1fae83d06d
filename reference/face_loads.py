"""Loads on the faces of a cut, on a mesh that conforms to it."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import CutFaces, Scene, faces_of


class CutFacets(NamedTuple):
    """Facets of both faces of a cut.

    Attributes
    ----------
    cell, opposite : (f,) int arrays
        Cell of each, and the corner opposite to it.
    positive : (f,) bool array
        Whether its material is on the positive side of the cut.
    """

    cell: NDArray[np.int64]
    opposite: NDArray[np.int64]
    positive: NDArray[np.bool_]


def cut_facets_of(scene: Scene, space: ConformingSpace, load: CutFaces, key: str) -> CutFacets:
    """Find the facets that a load on the faces of a cut acts on; none if it is still closed.

    Raises
    ------
    InputError
        If there are none in a static scene.
    """
    mesh = space.mesh
    cell, opposite = mesh.faces.T
    k = mesh.cell_dimension
    rest = np.array([[c for c in range(k + 1) if c != j] for j in range(k + 1)])
    corners = mesh.points[mesh.cells[cell[:, None], rest[opposite]]]
    middle = corners.mean(axis=1)
    found = faces_of(scene, middle)
    mine = found.cut == next(i for i, cut in enumerate(scene.cuts) if cut.name == load.cut)
    if not mine.any() and scene.analysis.kind == "static":
        raise InputError(f"{key}: cut '{load.cut}' has no face in the body", str(scene.file or ""))
    inside = np.sum((mesh.points[mesh.cells[cell, opposite]] - middle) * found.normal, axis=1)
    return CutFacets(cell[mine], opposite[mine], inside[mine] > 0.0)
