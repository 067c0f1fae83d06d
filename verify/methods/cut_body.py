"""Result of every method: a body to solve on, one to show, an account; bodies that open bit by bit.

Virtual nodes and removal cut again what a cut has opened so far (`cut_so_far`); a mesh that is
prepared for the whole cut (subdivision, snapping) is opened facet by facet (`Seams`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, eye_array

from verify.xfem.arrays import Floats, Ints
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.element import Material
from verify.xfem.mesh import SimplexMesh, connected
from verify.xfem.phantom import PhantomMesh, SubCells, cut_mesh
from verify.xfem.subdivision import Subdivision, subdivide


@dataclass(frozen=True)
class Change:
    """Something that a method moved, merged, removed or took for something else.

    Attributes
    ----------
    kind : str
    count : int
    size : float
        Largest contribution, or the sum where the kind says so.
    unit : str
    """

    kind: str
    count: int
    size: float
    unit: str


@dataclass(frozen=True)
class Counts:
    """Sizes before and after; `nodes` carry one displacement vector each."""

    nodes_before: int
    nodes: int
    elements_before: int
    elements: int


@dataclass(frozen=True)
class CutBody:
    """A body cut by one of the methods.

    Attributes
    ----------
    phantom : PhantomMesh
        The material: loads, supports and masses go here.
    resisting : PhantomMesh
        The elastic body: the same unknowns and cells as `phantom`. The weights are the same too,
        except where a method lets copies of cells resist as if they were whole.
    conforming : Subdivision
        The body as a mesh that conforms to the realised cut, for output and comparison.
    cell_origin : (m,) int array
        Cell of the mesh as given in which each cell of ``phantom.mesh`` lies (or from which it
        was moved).
    counts : Counts
    smallest_fraction : float
        Smallest volume of a cell, or piece of a cell, over the volume of the cell as given.
    changes : tuple of Change
    seconds : dict of str to float
        Wall time of the phases of the cut.
    cell_number : (m,) int array, optional
        Where cells go as the cut opens: ascending numbers that the others keep.
    """

    phantom: PhantomMesh
    resisting: PhantomMesh
    conforming: Subdivision
    cell_origin: Ints
    counts: Counts
    smallest_fraction: float
    changes: tuple[Change, ...]
    seconds: dict[str, float] = field(default_factory=dict)
    cell_number: Ints | None = None

    def material(self, given: Material) -> Material:
        """Map the material of the cells as given to the cells of ``phantom.mesh``."""
        count = len(self.cell_origin)
        lam, mu = (
            value if np.ndim(value) == 0 else value[self.cell_origin]
            for value in (given.lam, given.mu)
        )
        assert np.shape(lam) in ((), (count,))
        return replace(given, lam=lam, mu=mu)


def make_body(
    given: SimplexMesh,
    phantom: PhantomMesh,
    changes: tuple[Change, ...] = (),
    *,
    resisting: PhantomMesh | None = None,
    conforming: Subdivision | None = None,
    cell_origin: Ints | None = None,
    seconds: dict[str, float] | None = None,
    cell_number: Ints | None = None,
) -> CutBody:
    """Make the body of a cut mesh, with its counts.

    Parameters
    ----------
    given : SimplexMesh
        The mesh before the method touched it.
    phantom, resisting, conforming, cell_origin, changes, seconds, cell_number
        As in `CutBody`; without them nothing but `phantom` is special.
    """
    origin = np.arange(len(given.cells)) if cell_origin is None else cell_origin
    return CutBody(
        phantom=phantom,
        resisting=phantom if resisting is None else resisting,
        conforming=subdivide(phantom) if conforming is None else conforming,
        cell_origin=origin,
        counts=Counts(len(given.points), phantom.node_count, len(given.cells), len(phantom.cells)),
        smallest_fraction=float((phantom.volumes / given.measures[origin[phantom.parent]]).min()),
        changes=tuple(change for change in changes if change.count),
        seconds=seconds or {},
        cell_number=cell_number,
    )


def whole_cells(phantom: PhantomMesh, chosen: NDArray[np.bool_] | None = None) -> PhantomMesh:
    """Return the chosen pieces (p,), all by default, each with the whole volume of its cell.

    Unknowns keep their numbers, also those that no chosen piece uses.
    """
    keep = np.ones(len(phantom.cells), dtype=bool) if chosen is None else chosen
    corners = phantom.cells.shape[1]
    return replace(
        phantom,
        cells=phantom.cells[keep],
        parent=phantom.parent[keep],
        fraction=np.ones(int(keep.sum())),
        label=phantom.label[keep],
        sub_cells=SubCells(
            piece=np.zeros(0, dtype=np.int64),
            points=np.zeros((0, corners), dtype=np.int64),
            barycentric=np.zeros((0, corners, corners)),
            fraction=np.zeros(0),
            zero_points=phantom.sub_cells.zero_points,
        ),
    )


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
    first, second = seams.one[closed].ravel(), seams.other[closed].ravel()
    group = connected(phantom.node_count, first, second)
    _, node = np.unique(group, return_index=True)
    mesh = phantom.mesh
    joined = OpenedMesh(phantom.node_points[node], group[phantom.cells], mesh.boundary_facets)
    return cut_mesh(joined, [])
