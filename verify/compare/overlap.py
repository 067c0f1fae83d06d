"""Overlap of the faces of cuts in the deformed body: how deep, and where.

Without contact a solution may put two parts of a body into one place. Faces that slide along each
other at a finite rotation have no opposite points left. Therefore points of all faces are located
in the deformed cells of any material: the other side of their cut, or another part of the body.

The deformed body x = X + u is of linear simplices. Cells of a quadratic solution are divided at
their mid-edge nodes, so that faces follow the deformed nodes; between them they are straight.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.cell_tree import (
    CellTree,
    build_cell_tree,
    holding_cells,
    near_points,
    pairs_met,
)
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.mass import shape_functions
from verify.compare.simplices import Simplices, heights, nodes_of_facets, simplices
from verify.errors import UnsupportedSceneError
from verify.geometry.simplices import (
    boundary_facets,
    bounds_of,
    determinants,
    distances,
    unit_normals,
)
from verify.solution import Solution

Ints = NDArray[np.int64]
Array = NDArray[np.float64]


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
        The cell on the other side of a cut; outside, where there is none, the same as `behind`.
    """

    nodes: Ints
    behind: Ints
    across: Ints

    @property
    def on_cut(self) -> NDArray[np.bool_]:
        """Whether each (f,) is the face of a cut."""
        return np.asarray(self.across != self.behind)

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
    tree : CellTree
        Of those that have a volume and are not inside out.
    """

    nodes: Ints
    shape: Simplices
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
    _, behind, opposite = boundary_facets(cells[:, : d + 1])
    nodes, apex = nodes_of_facets(cells[behind], opposite), cells[behind, opposite]
    corners = solution.points[nodes[:, :d]]
    inward = solution.points[apex] - corners[:, 0]
    normals = unit_normals(corners)
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
    nodes = solution.cells[_meet(places[solution.cells], low, high)]
    if solution.order == 2:
        nodes = nodes[:, np.array(_PARTS[solution.dimension])].reshape(-1, solution.dimension + 1)
    shape = simplices(places, nodes)
    upright = ~shape.degenerate & (_turn(places[nodes]) * _turn(solution.points[nodes]) > 0.0)
    lower, upper = bounds_of(shape.corners)
    tree = build_cell_tree(np.where(upright[:, None], lower, np.nan), upper)
    return DeformedCells(nodes, shape, tree)


def _meet(corners: Array, low: Array, high: Array) -> NDArray[np.bool_]:
    """Tell whether boxes around corners (m, k, d) meet the box from `low` to `high` (d,)."""
    lower, upper = bounds_of(corners)
    return np.asarray((lower <= high).all(axis=1) & (upper >= low).all(axis=1))


def _turn(corners: Array) -> Array:
    """Compute the signed volume (m,), up to a factor."""
    return determinants(corners[:, 1:] - corners[:, :1])


def _swapped(d: int, order: int) -> list[int]:
    """Order of a facet's nodes that turns its normal round."""
    corners = [1, 0] if d == 2 else [0, 2, 1]
    if order == 1:
        return corners
    return [*corners, *([2] if d == 2 else [5, 4, 3])]


# A point of a face is looked for so far outside of its own material, over the smallest height of
# its facet; and at most and at least so far, over the size of the body. Round-off of a place is
# 1e-16 of the body, a millionth of the smallest step. Facets of less than `_SMALL` of the body
# have larger ones beside them.
_STEP, _LONGEST, _SMALL = 1e-4, 1e-7, 1e-6
_PULL = 1e-3  # points stand so far from the corners of their facet, over the way to its middle
_INSIDE = 1e-13  # of the body's size: round-off at the border of a cell
# Depths are differences of places in the deformed body: below this share of its size they are
# round-off, and two faces that touch do not overlap.
_RESOLVED = 1e-11


@dataclass(frozen=True)
class Overlap:
    """How far a deformed body covers a place twice.

    Parameters
    ----------
    depth : float
        Largest normal penetration of a face into other material, m; 0 if there is none.
    material, deformed : (d,) arrays or None
        Where the largest depth is: the point of the face before and after the deformation.
    inside_out : int
        Facets of cuts whose cells are inverted in the deformed body: they have no inside, and are
        left out.
    """

    depth: float = 0.0
    material: Array | None = None
    deformed: Array | None = None
    inside_out: int = 0


class OverlapSearch:
    """Overlaps of a solution, at any of its output times.

    Parameters
    ----------
    solution : Solution
        In the plane or in space.

    Raises
    ------
    UnsupportedSceneError
        If it is a membrane in space: lines have no inside.
    """

    def __init__(self, solution: Solution) -> None:
        if solution.cell_dimension < solution.dimension:
            raise UnsupportedSceneError(
                "the edges of a cut in a membrane pass each other in space: they have no inside "
                "that another could be in"
            )
        self.solution = solution
        self._field = SolutionField(solution)
        self._faces = faces_of(solution, self._field)
        self._size = self._field.scale
        self._volume = _turn(self._field.shape.corners)
        cut = self._faces.take(self._faces.on_cut)
        middle = solution.points[cut.nodes].mean(axis=1)
        self._both = [(solution.cells[c], self._hats(middle, c)) for c in (cut.behind, cut.across)]

    def _hats(self, points: Array, cells: Ints) -> Array:
        """Compute shape functions (n, k) of the nodes of given cells (n,) at points (n, d)."""
        shape, solution = self._field.shape, self.solution
        off = points - shape.corners[cells, 0]
        place = np.einsum("nka,na->nk", shape.gradients[cells], off)
        place[:, 0] += 1.0
        return shape_functions(place, solution.dimension, solution.order)

    def _is_glued(self, u: Array) -> NDArray[np.bool_]:
        """Tell whether both sides of facets (f,) move as one: a cut not yet open, or none."""
        glued = self._faces.on_cut
        here, there = (np.einsum("nk,nkd->nd", hats, u[nodes]) for nodes, hats in self._both)
        glued[glued] = np.linalg.norm(there - here, axis=1) <= ROUND_OFF * self._size
        return glued

    def at(self, step: int = -1) -> Overlap:
        """Measure the overlap at an output time, by its number."""
        u = self.solution.displacement[step]
        if not np.isfinite(u).all():
            return Overlap()
        places, faces = self.solution.points + u, self._faces.take(~self._is_glued(u))
        corners = self.solution.cells[faces.behind, : self.solution.dimension + 1]
        lost = self._volume[faces.behind] * _turn(places[corners]) <= 0.0
        turned = int(np.sum(lost & faces.on_cut))
        faces = faces.take(~lost)
        cut = faces.on_cut
        if not cut.any():
            return Overlap(inside_out=turned)
        region = places[faces.nodes[cut]].reshape(-1, places.shape[1])
        margin = _LONGEST * self._size
        low, high = region.min(axis=0) - margin, region.max(axis=0) + margin
        near = _meet(places[faces.nodes], low, high)
        cells = deformed_cells(self.solution, u, low, high)
        return replace(self._overlap(faces.take(near), cells, places), inside_out=turned)

    def _overlap(self, faces: Faces, cells: DeformedCells, places: Array) -> Overlap:
        depth, shares, which = self._depths(faces, cells, places)
        if not len(depth) or depth.max() <= _RESOLVED * self._size:
            return Overlap()
        deep = depth > _RESOLVED * self._size
        nodes, weights = faces.nodes[which[deep]], shares[deep]
        material = np.einsum("nk,nkd->nd", weights, self.solution.points[nodes])
        deformed = np.einsum("nk,nkd->nd", weights, places[nodes])
        worst = int(np.argmax(depth[deep]))
        return Overlap(float(depth.max()), material[worst], deformed[worst])

    def _depths(
        self, faces: Faces, cells: DeformedCells, places: Array
    ) -> tuple[Array, Array, NDArray[np.int64]]:
        """Return penetration (n,) of points of faces, shares (n, d) of corners, and facets (n,)."""
        corners = places[faces.nodes]
        normals = unit_normals(corners)
        height = heights(corners)
        whole = (height > _SMALL * self._size) & np.isfinite(normals).all(axis=1)
        sound = np.flatnonzero(whole)
        normals = np.nan_to_num(normals)
        d = corners.shape[1]
        middle = np.full((1, d), 1 / d)
        pulled = (1 - _PULL) * np.eye(d) + _PULL * middle
        rows = np.concatenate([pulled, middle])
        which = np.repeat(sound, len(rows))
        shares = np.tile(rows, (len(sound), 1))
        points = np.einsum("nk,nkd->nd", shares, corners[which])
        step = np.minimum(_STEP * height[which], _LONGEST * self._size)
        outside = points + step[:, None] * normals[which]
        searched = cells.tree.over(cells.shape.corners, cells.shape.normals)
        held = holding_cells(outside, searched, _INSIDE * self._size, nearest=False)
        inside = held >= 0
        which, shares, points, held = which[inside], shares[inside], points[inside], held[inside]
        step, outside = step[inside], outside[inside]
        if not len(which):
            return np.zeros(0), shares, which
        tree = build_cell_tree(*bounds_of(corners))
        along, leaving = first_exits(outside, -normals[which], tree, corners, normals)
        depth = np.where(np.isfinite(along), along - step, 0.0)
        out = self._ways_out(faces, cells, held, outside)
        depth[out >= 0] = np.minimum(depth, distances(points, corners[out]))[out >= 0]
        # a point of the body's outside counts where it went in through a face of a cut
        cut = faces.on_cut
        depth[~(cut[which] | cut[leaving])] = 0.0
        return np.maximum(depth, 0.0), shares, which

    def _ways_out(
        self, faces: Faces, cells: DeformedCells, held: NDArray[np.int64], points: Array
    ) -> NDArray[np.int64]:
        """Find the facet (n,) nearest to each deformed point inside the cells `held` (n,).

        A ray along a normal may be longer than the way out. Where faces turn by a right angle, as
        at a tip that closes, it misses them. Nearest is told in the material: there a point of a
        cell is on the inner side of the faces of its own part, and of no other.
        """
        shape = cells.shape
        height = shape.heights(points, held)
        # barycentric: height over a facet, over the height of the opposite corner
        shares = height * np.linalg.norm(shape.gradients[held], axis=2)
        places = np.einsum("nk,nkd->nd", shares, self.solution.points[cells.nodes[held]])
        corners = self.solution.points[faces.nodes]
        tree = build_cell_tree(*bounds_of(corners))
        return nearest_before(places, tree, corners, np.nan_to_num(unit_normals(corners)))


# A ray through an edge must not slip between two facets.
_EDGE = 1e-9


def first_exits(
    points: Array, ways: Array, tree: CellTree, facets: Array, normals: Array
) -> tuple[Array, Ints]:
    """Compute distance (n,) to the first facet through which a ray leaves material, and which (n,).

    Facets (f, d, d) through which it enters are passed; infinite and −1 where it leaves nothing.
    `ways` (n, d) and `normals` (f, d), which point out of the material, have length one.
    """
    distance, which = np.full(len(points), np.inf), np.full(len(points), -1)
    slopes = np.where(ways == 0.0, 1e-300, ways)
    bases = np.concatenate([facets[:, 1:] - facets[:, :1], normals[:, None]], axis=1)

    def on_ray(row: Ints, low: Array, high: Array, box: Ints) -> NDArray[np.bool_]:
        first, last = np.zeros(len(row)), np.full(len(row), np.inf)
        with np.errstate(over="ignore"):
            for a in range(points.shape[1]):
                x, slope = points[row, a], slopes[row, a]
                ends = (low[box, a] - x) / slope, (high[box, a] - x) / slope
                first, last = (
                    np.maximum(first, np.minimum(*ends)),
                    np.minimum(last, np.maximum(*ends)),
                )
            return np.asarray(first <= last + 1e-9 * (first + np.abs(last)))

    for row, facet in pairs_met(tree, facets, np.arange(len(points)), on_ray):
        rise = np.einsum("nd,nd->n", normals[facet], ways[row])
        row, facet, rise = row[rise > 0.0], facet[rise > 0.0], rise[rise > 0.0]
        off = facets[facet, 0] - points[row]
        t = np.einsum("nd,nd->n", normals[facet], off) / rise
        hit = (t[:, None] * ways[row] - off)[..., None]
        shares = np.linalg.solve(np.swapaxes(bases[facet], 1, 2), hit)[:, :-1, 0]
        met = (t >= 0.0) & (shares >= -_EDGE).all(axis=1) & (shares.sum(axis=1) <= 1.0 + _EDGE)
        order = np.flatnonzero(met)[np.argsort(-t[met], kind="stable")]
        distance[row[order]], which[row[order]] = t[order], facet[order]  # the last stays
    return distance, which


def nearest_before(points: Array, tree: CellTree, facets: Array, normals: Array) -> Ints:
    """Find the nearest facet (n,) that has a point on its inner side; −1 where none has."""
    found, best = np.full(len(points), -1), np.full(len(points), np.inf)
    farthest = float(np.ptp(np.vstack([points, *facets]), axis=0).sum())
    reach = cKDTree(facets.mean(axis=1)).query(points)[0] + 1e-6 * farthest
    rows = np.arange(len(points))
    while len(rows):
        for row, facet in pairs_met(tree, facets, rows, near_points(points, reach)):
            before = np.einsum("nd,nd->n", normals[facet], points[row] - facets[facet, 0]) < 0.0
            row, facet = row[before], facet[before]
            away = distances(points[row], facets[facet])
            order = np.argsort(-away, kind="stable")
            best[row[order]], found[row[order]] = away[order], facet[order]  # the last stays
        rows = rows[(best[rows] > reach[rows]) & (reach[rows] < farthest)]
        reach[rows] *= 2.0
    return found
