"""The deformed body x = X + u as linear simplices, with the facets that bound it.

Cells of a quadratic solution are divided at their mid-edge nodes, so that faces follow the
deformed nodes; between them they are straight.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import CellTree, build_cell_tree
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.simplices import Simplices, facet_nodes, facet_normals, simplices
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

# Cells and facets of a quadratic simplex by its nodes in VTK's order. The octahedron in the middle
# of a tetrahedron is divided along the diagonal between nodes 4 and 9.
_PARTS = {
    1: ((0, 2), (2, 1)),
    2: ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    3: ((0, 4, 6, 7), (4, 1, 5, 8), (6, 5, 2, 9), (7, 8, 9, 3),
        (4, 9, 6, 5), (4, 9, 5, 8), (4, 9, 8, 7), (4, 9, 7, 6)),
}  # fmt: skip


@dataclass(frozen=True)
class Faces:
    """Facets that bound the material of a solution: its outside, and the faces of its cuts.

    Parameters
    ----------
    nodes : (f, d) int array
        Ordered so that the normal in the material configuration points out of the material.
    behind : (f,) int array
        The cell of the solution that each belongs to.
    across : (f,) int array
        The cell on the other side of a cut; that of `behind` where there is none, outside.
    """

    nodes: Ints
    behind: Ints
    across: Ints

    def take(self, kept: NDArray[np.bool_]) -> "Faces":
        """Return some of them."""
        return Faces(self.nodes[kept], self.behind[kept], self.across[kept])


@dataclass(frozen=True)
class DeformedCells:
    """Linear simplices in the deformed configuration.

    Parameters
    ----------
    nodes : (m, d + 1) int array
    shape : Simplices
        Of the deformed corners.
    upright : (m,) bool array
        Whether a cell has a volume and is not inside out; others are in no tree.
    tree : CellTree
    """

    nodes: Ints
    shape: Simplices
    upright: NDArray[np.bool_]
    tree: CellTree


def faces_of(solution: Solution, field: SolutionField) -> Faces:
    """Find the facets of a solution in the plane or in space that belong to one cell only.

    Parameters
    ----------
    solution : Solution
    field : SolutionField
        Of the same solution; it tells what lies across a facet by its place, since a guest's mesh
        may have nodes that are double without a cut.
    """
    d, cells = solution.dimension, solution.cells
    opposite = range(d + 1)
    local = [facet_nodes(d, corner, solution.order) for corner in opposite]
    nodes = np.concatenate([cells[:, own] for own in local])
    behind = np.tile(np.arange(len(cells)), d + 1)
    apex = np.concatenate([cells[:, corner] for corner in opposite])
    _, which, count = np.unique(
        np.sort(nodes[:, :d], axis=1), axis=0, return_inverse=True, return_counts=True
    )
    single = count[which.ravel()] == 1
    nodes, behind, apex = nodes[single], behind[single], apex[single]
    corners = solution.points[nodes[:, :d]]
    inward = solution.points[apex] - corners[:, 0]
    normals = facet_normals(corners)
    turned = np.sum(normals * inward, axis=1) > 0.0
    nodes[turned] = nodes[turned][:, _swapped(d, solution.order)]
    normals[turned] *= -1.0
    kept = ~field.shape.degenerate[behind] & np.isfinite(normals).all(axis=1)
    nodes, behind, normals = nodes[kept], behind[kept], normals[kept]
    middle = solution.points[nodes[:, :d]].mean(axis=1)
    across = field.cells_at(middle, middle + normals * field.scale)
    if solution.order == 2:
        parts = np.array(_PARTS[d - 1])
        nodes = nodes[:, parts].reshape(-1, d)
        behind, across = (np.repeat(a, len(parts)) for a in (behind, across))
    return Faces(nodes, behind, across)


def deformed_cells(
    solution: Solution, displacement: Array, low: Array, high: Array
) -> DeformedCells:
    """Take the cells that meet the box from `low` to `high` (d,) when nodes are moved.

    Parameters
    ----------
    solution : Solution
    displacement : (n, d) array
        Of its nodes, m.
    """
    places = solution.points + displacement
    around = places[solution.cells]
    met = (around.min(axis=1) <= high).all(axis=1) & (around.max(axis=1) >= low).all(axis=1)
    nodes = solution.cells[met]
    if solution.order == 2:
        nodes = nodes[:, np.array(_PARTS[solution.dimension])].reshape(-1, solution.dimension + 1)
    shape = simplices(places, nodes)
    upright = ~shape.degenerate & (_turn(places[nodes]) * _turn(solution.points[nodes]) > 0.0)
    lower, upper = shape.corners.min(axis=1), shape.corners.max(axis=1)
    tree = build_cell_tree(np.where(upright[:, None], lower, np.nan), upper)
    return DeformedCells(nodes, shape, upright, tree)


def is_glued(faces: Faces, solution: Solution, field: SolutionField) -> NDArray[np.bool_]:
    """Whether both sides of facets (f,) move as one: a cut that has not opened yet, or none.

    Parameters
    ----------
    field : SolutionField
        With the nodal displacements that are asked about.
    """
    middle = solution.points[faces.nodes].mean(axis=1)
    here, there = (field.in_cells(middle, cells)[0] for cells in (faces.behind, faces.across))
    together = np.linalg.norm(there - here, axis=1) <= ROUND_OFF * field.scale
    return np.asarray(together & (faces.across != faces.behind))


def _turn(corners: Array) -> Array:
    """Signed volume (m,), up to a factor."""
    return np.asarray(np.linalg.det(corners[:, 1:] - corners[:, :1]))


def _swapped(d: int, order: int) -> list[int]:
    """Order of a facet's nodes that turns its normal round."""
    corners = [1, 0] if d == 2 else [0, 2, 1]
    if order == 1:
        return corners
    return [*corners, *([2] if d == 2 else [5, 4, 3])]
