"""Result of every method: a body to solve on, one to show, and an account of the cut."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from verify.xfem.arrays import Ints
from verify.xfem.elasticity import Material
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, SubCells
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
        What resists deformation: the same unknowns and cells as `phantom`, and its weights too,
        except where a method lets copies of cells resist as if they were whole.
    conforming : Subdivision
        The body as a mesh that conforms to the realised cut, for output and comparison.
    cell_origin : (m,) int array
        Cell of the mesh as given in which each cell of ``phantom.mesh`` lies (or from which it
        was moved).
    counts : Counts
    smallest_fraction : float
        Smallest volume of a cell, or piece of a cell, over that of the cell as given.
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
        """Material of the cells of ``phantom.mesh``, from that of the cells as given."""
        count = len(self.cell_origin)
        lam, mu = (
            value if np.ndim(value) == 0 else value[self.cell_origin]
            for value in (given.lam, given.mu)
        )
        assert np.shape(lam) in ((), (count,))
        return Material(lam, mu)


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
