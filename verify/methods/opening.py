"""Cuts that open bit by bit: cells that are open so far, and faces of a finished mesh still welded.

Virtual nodes and removal cut again what a cut has opened. A mesh that is prepared for the whole cut
(subdivision, snapping) is opened facet by facet.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.methods.opened_mesh import OpenedMesh
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, cut_mesh

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

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

    one: _Ints
    other: _Ints
    points: _Floats


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
