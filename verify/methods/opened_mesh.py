"""A mesh that is already cut: nodes doubled, and a boundary without the faces of the cut."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, eye_array

from verify.xfem.mesh import SimplexMesh
from verify.xfem.subdivision import Subdivision

_Ints = NDArray[np.int64]


class OpenedMesh(SimplexMesh):
    """A mesh with a cut in it, of which only the outer boundary counts as boundary.

    Supports and loads on the boundary of the body must not act on the faces of the cut.

    Parameters
    ----------
    points, cells
        As of `SimplexMesh`.
    outer : (b, 2) array_like of int
        Pairs (cell, local node opposite to the facet) of the outer boundary.
    """

    def __init__(self, points: ArrayLike, cells: ArrayLike, outer: ArrayLike) -> None:
        super().__init__(points, cells)
        object.__setattr__(self, "_outer", np.asarray(outer, dtype=np.int64).reshape(-1, 2))

    @cached_property
    def boundary_facets(self) -> _Ints:
        """(b, 2) pairs (cell, local node opposite) of the outer boundary."""
        outer: _Ints = self.__dict__["_outer"]
        return outer


def facets_without_twin(points: NDArray[np.float64], cells: _Ints) -> _Ints:
    """(b, 2) facets of one cell only that are not the face of a cut: nothing is at their place."""
    mesh = SimplexMesh(points, cells)
    facets = np.argwhere(mesh.neighbours < 0)
    _, place = np.unique(points, axis=0, return_inverse=True)
    on_facet = np.arange(mesh.dim + 1) != facets[:, 1:]
    corners = place.ravel()[cells[facets[:, 0]]][on_facet].reshape(len(facets), mesh.dim)
    _, which, count = np.unique(
        np.sort(corners, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    return facets[count[which.ravel()] == 1]


def conforming_to(
    mesh: SimplexMesh, cell_parent: _Ints, cut_facets: NDArray[np.float64]
) -> Subdivision:
    """Return a mesh that is its own conforming sub-division: every node an unknown."""
    return Subdivision(
        points=mesh.points,
        cells=mesh.cells,
        cell_piece=np.arange(len(mesh.cells)),
        cell_parent=cell_parent,
        interpolation=csr_array(eye_array(len(mesh.points))),
        cut_facets=cut_facets,
    )
