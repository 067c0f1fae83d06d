"""A surface that is not the mesh's own, carried by a cut body: what one sees, or collides with.

Each vertex belongs to the piece that contains it. A facet is split where the cut crosses it
through, that is where the elements on both its edges are split; which vertices are doubled follows
from the pieces, so the surface opens where the material does, and nowhere else. Only facets near
elements that a cut touched are looked at again (thesis 3.2.4, 4.4.2).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.accelerated.resumable import MANY, Resumable, finished
from verify.simulator.arrays.distinct import (
    distinct,
    distinct_in_lists,
    distinct_in_rows,
    ranges,
)
from verify.simulator.cutting.growing_body import Increment
from verify.simulator.cutting.patch import MeshPatch
from verify.simulator.cutting.point_numbers import FoundPoints, PointNumbers
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.cut_elements import ElementTree, NearCells, cut_elements
from verify.simulator.mapping.cut_facet_kernels import divide_facets
from verify.simulator.mapping.edge_points import EdgePoints
from verify.simulator.mapping.locate_kernels import (
    corner_cells,
    corner_pieces,
    cut_at,
    locate_many,
    place_parts,
)
from verify.simulator.mapping.moving_surface import MovingSurface
from verify.simulator.mapping.near_facet_kernels import concerned_facets, levels_at
from verify.xfem.errors import XfemError
from verify.xfem.pieces import ROUND_OFF, split_cells

__all__ = ["EmbeddedSurface"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class _Fragments(NamedTuple):
    """Parts of facets: points (q, k), facet, barycentric corners in it, sides, if whole."""

    ids: _Ints
    source: _Ints
    at: _Floats
    label: NDArray[np.int8]
    whole: NDArray[np.bool_]


class _SurfaceCut:
    """A cut as a surface sees it: it is where the body is split."""

    def __init__(self, nodes: _Floats, values: _Floats, cut: int, embedded: "EmbeddedSurface"):
        self._nodes, self._values, self._cut, self._embedded = nodes, values, cut, embedded

    def level_set(self, points: _Floats) -> _Floats:
        """Realised level set at the vertices; zero points are on the cut by construction."""
        return self._values if points is self._nodes else np.zeros(len(points))

    def depth(self, points: _Floats) -> _Floats:
        """Infinite where the body is split, minus that where it is not."""
        return np.where(self._embedded.is_cut(points, self._cut), np.inf, -np.inf)


class EmbeddedSurface:
    """A triangulated surface (in the plane: a polyline) in or near a body.

    Parameters
    ----------
    cutter : SemiProgressiveCutter
        Holds the body and its strokes; it may have been used already.
    points : (v, s) array_like
        In the material frame, in metres. A vertex outside the mesh moves with the element to
        which it is nearest.
    facets : (f, s) array_like of int
        Triangles; segments in the plane.

    Attributes
    ----------
    surface : MovingSurface
        Its first v vertices are those given, as far as they have not been doubled.

    Raises
    ------
    XfemError
        If shapes, indices or numbers are wrong.
    """

    def __init__(self, cutter: SemiProgressiveCutter, points: ArrayLike, facets: ArrayLike) -> None:
        mesh = cutter.mesh
        self.points = np.ascontiguousarray(points, dtype=float)
        self.facets = np.ascontiguousarray(facets, dtype=np.int64)
        _check(self.points, self.facets, mesh.space)
        self.surface = MovingSurface(mesh.dim + 1, mesh.space, self.facets.shape[1])
        self._cutter, self._snap = cutter, ROUND_OFF * mesh.extent
        tree = cutter.interior
        self._tree = ElementTree(
            1e-9 * mesh.extent, tree.low, tree.high, tree.order, mesh.cells, mesh.points,
            mesh.gradients,
        )  # fmt: skip
        self._vertex_cell, self._vertex_at = locate_many(self.points, self._tree)
        self._numbers = PointNumbers(len(self.points), mesh.space)
        self._edges = EdgePoints(self.points, self._numbers)
        leaf, count = np.argsort(tree.order), len(tree.order)
        boxes = tree.low[count + leaf], tree.high[count + leaf]
        self._near, around = self._facets_near_cells(boxes)
        self._around = NearCells(*around, *boxes)
        every = np.arange(len(self.facets))
        own, corners = self._vertex_cell[self.facets], (*self.facets.shape, mesh.dim + 1)
        self._corners = np.empty_like(own), np.empty(corners), np.empty(corners)
        corner_cells(
            every, self.points[self.facets], every, own, self._around, self._tree, *self._corners
        )
        self._facet_range = np.zeros((len(self.facets), 2), dtype=np.int64)
        most = max(len(self.points), len(self.facets), len(mesh.points))
        self._place, self._is_moved = np.full(most, -1), np.zeros(len(mesh.cells), dtype=bool)
        nodes = distinct(self.facets)
        finished(self._replacing(every, nodes, *self._values(nodes), many=False))

    def update(self, increment: Increment | None) -> None:
        """Follow a cut."""
        if increment is not None:
            finished(self.following(increment))

    def following(self, increment: Increment) -> Resumable[None]:
        """Follow a cut in pieces; the body must not be cut again in between."""
        near = np.sort(distinct_in_lists(*self._near, increment.moved, self._place))
        if len(near) == 0:
            return
        nodes = np.sort(distinct_in_rows(self.facets, near, self._place))
        numbers, values = self._values(nodes)
        # a facet on one side of all cuts, in cells that are as they were, stays as it is
        concerned = concerned_facets(
            near, self.facets, nodes, values, increment.moved, self._corners[0], self._is_moved,
            self._place,
        )  # fmt: skip
        if len(concerned):
            many = len(increment.cells) > MANY
            yield from self._replacing(concerned, nodes, numbers, values, many)

    def parts_of(self, given: _Ints) -> _Ints:
        """Facets in use that are parts of some given ones, in the order of these."""
        return ranges(self._facet_range.take(given, axis=0))

    def is_cut(self, places: _Floats, cut: int) -> NDArray[np.bool_]:
        """Whether the element at each material place (q, s) is split by a cut."""
        return cut_at(places, cut, self._tree, cut_elements(self._cutter.body))

    def _facets_near_cells(
        self, boxes: tuple[_Floats, _Floats]
    ) -> tuple[tuple[_Ints, _Ints], tuple[_Ints, _Ints]]:
        """Facets near each cell, and cells near each facet, as (first of each, all).

        They are near if their boxes meet, or if a vertex of the facet belongs to the cell. Outside
        the mesh `locate` looks up to twice as far as it is to the next box: so does this.
        """
        tree = self._cutter.interior
        cells, facets = [], []
        corners = self.points[self.facets]
        floor, ceiling = (box[self._vertex_cell] for box in boxes)
        outside = np.maximum(floor - self.points, self.points - ceiling).max(axis=1, initial=0.0)
        reach = self._tree.reach + 2.0 * outside[self.facets].max(axis=1)
        for f, (low, high) in enumerate(zip(corners.min(axis=1), corners.max(axis=1), strict=True)):
            near = np.union1d(
                tree.meeting_box(low - reach[f], high + reach[f]), self._vertex_cell[self.facets[f]]
            )
            cells.append(near)
            facets.append(np.full(len(near), f))
        cell, facet = np.concatenate(cells), np.concatenate(facets)
        order = np.argsort(cell, kind="stable")
        counts = np.bincount(cell, minlength=len(self._cutter.mesh.cells))
        around = np.cumsum([0, *map(len, cells)])
        return (np.concatenate([[0], np.cumsum(counts)]), facet[order]), (around, cell)

    def _replacing(
        self, facets: _Ints, nodes: _Ints, numbers: _Ints, values: _Floats, many: bool
    ) -> Resumable[None]:
        """Put the parts of some facets in the place of what there is of these.

        They are divided, given the cuts and their level sets (q, cuts) at the vertices; then it is
        found with which pieces the parts move.
        """
        body = self._cutter.body
        several = len(numbers) > 1 or self.facets.shape[1] == 2
        divide = self._divided_by_several if several else self._divided_by_one
        divided = divide(facets, nodes, numbers, values)
        yield
        ids, source, at, label, whole = self._fragments(facets, numbers, *divided)
        if many:
            yield
        # where the corners of a whole facet are is known; only which piece that is may be new
        material, cell, weights, inside = place_parts(
            self.points, self.facets, source, at, whole, self._corners, self._around, self._tree
        )
        yield
        piece = corner_pieces(cell, inside, label, self._cutter.level_sets, cut_elements(body))
        self.surface.retire(ranges(self._facet_range[facets]))
        self.surface.add(
            ids, material, weights, weights != 0.0, piece, np.zeros(len(ids), dtype=bool),
            body.piece_cells.rows, source, self._facet_range,
        )  # fmt: skip

    def _fragments(
        self,
        facets: _Ints,
        numbers: _Ints,
        ids: _Ints,
        source: _Ints,
        at: _Floats,
        side: NDArray[np.int8],
    ) -> "_Fragments":
        """Bisect divided facets where others are, and say on which sides of the cuts they lie."""
        self._edges.add(ids.ravel())
        ids, at, origin = self._edges.bisect(ids, at)
        source, side = source[origin], side[origin]
        label = np.zeros((len(ids), self._cutter.body.cut_count), dtype=np.int8)
        label[:, numbers] = side
        alone = np.bincount(source, minlength=len(facets)) == 1
        is_whole = alone[source] & ~side.any(axis=1)
        return _Fragments(ids, facets[source], at, label, is_whole)

    def _divided_by_one(
        self, facets: _Ints, nodes: _Ints, numbers: _Ints, values: _Floats
    ) -> tuple[_Ints, _Ints, _Floats, NDArray[np.int8]]:
        """Divide facets by the only cut there is: points, which facet, corners in it, side."""
        if len(numbers) == 0:
            at = np.tile(np.eye(3), (len(facets), 1, 1))
            return self.facets[facets], np.arange(len(facets)), at, np.zeros((len(facets), 0), "i1")
        corners = self.points[nodes]
        ends, positions, ids, at, source, side = divide_facets(
            np.searchsorted(nodes, self.facets[facets]), values[:, 0], corners, numbers[0],
            self._tree, cut_elements(self._cutter.body),
        )  # fmt: skip
        positions = np.concatenate([corners, positions])
        found = FoundPoints(positions, values, ends, np.zeros(len(ends), dtype=np.int64))
        return self._numbers.number(found, nodes, numbers)[ids], source, at, side[:, None]

    def _divided_by_several(
        self, facets: _Ints, nodes: _Ints, numbers: _Ints, values: _Floats
    ) -> tuple[_Ints, _Ints, _Floats, NDArray[np.int8]]:
        """Divide facets by any number of cuts, as elements are."""
        patch = self._patch(facets, nodes)
        cuts = [
            _SurfaceCut(patch.points, values[:, k], int(cut), self) for k, cut in enumerate(numbers)
        ]
        parts = split_cells(patch, cuts)
        solid = np.flatnonzero(parts.simplices.fraction > 0.0)
        unsplit = np.ones(len(facets), dtype=bool)
        unsplit[parts.parent] = False
        whole = np.flatnonzero(unsplit)
        size = self.facets.shape[1]
        point = self._numbers.number(parts.points, nodes, numbers)
        ids = np.concatenate([self.facets[facets[whole]], point[parts.simplices.points[solid]]])
        eye = np.broadcast_to(np.eye(size), (len(whole), size, size))
        at = np.concatenate([eye, parts.simplices.barycentric[solid]])
        source = np.concatenate([whole, parts.parent[parts.simplices.piece[solid]]])
        side = np.zeros((len(ids), len(numbers)), dtype=np.int8)
        side[len(whole) :] = parts.label[parts.simplices.piece[solid]]
        # sub-simplices come in the order of their numbers; facets keep their direction
        wrong = np.linalg.det(at) < 0.0
        ids[wrong, 0], ids[wrong, 1] = ids[wrong, 1], ids[wrong, 0].copy()
        at[wrong, 0], at[wrong, 1] = at[wrong, 1], at[wrong, 0].copy()
        order = np.argsort(source, kind="stable")
        return ids[order], source[order], at[order], side[order]

    def _patch(self, facets: _Ints, nodes: _Ints) -> MeshPatch:
        local = np.searchsorted(nodes, self.facets[facets])
        extent = self._cutter.mesh.extent
        across = np.full((len(facets), self.facets.shape[1]), -1)
        return MeshPatch(self.points, extent, facets, nodes, local, across)

    def _values(self, vertices: _Ints) -> tuple[_Ints, _Floats]:
        """Cuts between vertices, or through one, and their realised level sets (q, cuts) there."""
        cells = self._cutter.mesh.cells
        strokes = [stroke for stroke in self._cutter.strokes if stroke.front >= 0.0]
        nodes = distinct_in_rows(cells, self._vertex_cell.take(vertices), self._place)
        numbers, columns = [], []
        for stroke in strokes:
            stroke.level_sets(nodes)
            values, crossed = levels_at(
                vertices, self._vertex_cell, self._vertex_at, cells, stroke.values, self._snap
            )
            # the last stroke may still be led elsewhere: what it met before is asked again
            if crossed or stroke is strokes[-1]:
                numbers.append(stroke.number)
                columns.append(values)
        found = np.stack(columns, axis=1) if columns else np.empty((len(vertices), 0))
        return np.array(numbers, dtype=np.int64), found


def _check(points: _Floats, facets: _Ints, space: int) -> None:
    if points.ndim != 2 or points.shape[1] != space or not np.isfinite(points).all():
        raise XfemError(f"surface points of shape {points.shape}; expected finite (v, {space})")
    if facets.ndim != 2 or facets.shape[1] != space or len(facets) == 0:
        raise XfemError(f"surface facets of shape {facets.shape}; expected (f, {space}), f > 0")
    if facets.min() < 0 or facets.max() >= len(points):
        raise XfemError(f"a surface facet has a vertex outside 0..{len(points) - 1}")
    if (np.diff(np.sort(facets, axis=1), axis=1) == 0).any():
        raise XfemError("a surface facet has a vertex twice")
