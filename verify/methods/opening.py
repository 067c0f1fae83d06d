"""Cuts that open bit by bit: cells that are open so far, and faces of a finished mesh still welded.

Virtual nodes and removal cut again what a cut has opened. A mesh that is prepared for the whole cut
(subdivision, snapping) is opened facet by facet.
"""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array, eye_array
from scipy.sparse.csgraph import connected_components

from verify.xfem.arrays import Floats, Ints
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.subdivision import Subdivision


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
    def boundary_facets(self) -> Ints:
        """(b, 2) pairs (cell, local node opposite) of the outer boundary."""
        outer: Ints = self.__dict__["_outer"]
        return outer


def facets_without_twin(points: NDArray[np.float64], cells: Ints) -> Ints:
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
    mesh: SimplexMesh, cell_parent: Ints, cut_facets: NDArray[np.float64]
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


# of a mesh with all cuts: cells (m, cuts) that each cut has opened
OpenedCells = Callable[[PhantomMesh], NDArray[np.bool_]]


def cut_so_far(
    mesh: SimplexMesh, cuts: Sequence[Cut], tip: TipRule, opened: OpenedCells | None
) -> PhantomMesh:
    """Cut a mesh in the cells that are open; without `opened` in all."""
    whole = cut_mesh(mesh, cuts, tip)
    return whole if opened is None else cut_mesh(mesh, cuts, tip, opened(whole))


class Seams(NamedTuple):
    """Facets of a cut mesh at the same place, which the cut has parted.

    Attributes
    ----------
    one, other : (k, d) int array
        Their dof nodes, those at the same place in the same column.
    points : (k, d, space) float array
        Their corners, in metres.
    """

    one: Ints
    other: Ints
    points: Floats


def seams_of(phantom: PhantomMesh) -> Seams:
    """Find the faces of the cut in a mesh of whole cells."""
    corners = phantom.cells.shape[1]
    sides = [[k for k in range(corners) if k != opposite] for opposite in range(corners)]
    facets = np.concatenate([phantom.cells[:, side] for side in sides])
    _, place = np.unique(phantom.node_points, axis=0, return_inverse=True)
    facets = np.take_along_axis(facets, place.ravel()[facets].argsort(axis=1), axis=1)
    places = place.ravel()[facets]
    order = np.lexsort(places.T)
    facets, places = facets[order], places[order]
    twin = (places[1:] == places[:-1]).all(axis=1) & (facets[1:] != facets[:-1]).any(axis=1)
    one, other = facets[:-1][twin], facets[1:][twin]
    return Seams(one, other, phantom.node_points[one])


def welded(phantom: PhantomMesh, seams: Seams, closed: NDArray[np.bool_]) -> PhantomMesh:
    """Join pairs of nodes (k, d) of the seams that are closed; cells stay as they are."""
    count = phantom.node_count
    first, second = seams.one[closed].ravel(), seams.other[closed].ravel()
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    group = connected_components(graph, directed=False)[1]
    _, node = np.unique(group, return_index=True)
    mesh = phantom.mesh
    joined = OpenedMesh(phantom.node_points[node], group[phantom.cells], mesh.boundary_facets)
    return cut_mesh(joined, [])
