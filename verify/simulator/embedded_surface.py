"""A surface that is not the mesh's own, carried by a cut body: what one sees, or collides with.

Each vertex belongs to the piece that contains it. A facet is split where the cut crosses it
through, that is where the elements on both its edges are split; which vertices are doubled follows
from the pieces, so the surface opens where the material does, and nowhere else. Only facets near
elements that a cut touched are looked at again (thesis 3.2.4, 4.4.2).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.simulator.division import MeshPatch
from verify.simulator.growing_body import Increment
from verify.simulator.moving_surface import MovingSurface
from verify.simulator.places import MaterialPlaces
from verify.simulator.point_numbers import (
    EdgePoints,
    PointNumbers,
    distinct,
    of_lists,
    ranges,
)
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.arrays import Bools, Floats, Ints, Sides, XfemError
from verify.xfem.pieces import ROUND_OFF, split_cells

_INWARDS = 1e-5  # how far from a corner to the centre of its facet its piece is looked up
_SNAP = 1e-12  # barycentric coordinates below that are zero: the vertex is on the face


class _Corners(NamedTuple):
    """Find the cell (q, k) of each corner of facets; coordinates of it and a place inside."""

    cell: Ints
    weights: Floats
    inside: Floats


class _SurfaceCut:
    """A cut as a surface sees it: it is where the body is split."""

    def __init__(self, nodes: Floats, values: Floats, cut: int, embedded: "EmbeddedSurface"):
        self._nodes, self._values, self._cut, self._embedded = nodes, values, cut, embedded

    def level_set(self, points: Floats) -> Floats:
        """Return the realised level set at the vertices; zero points are exactly on the cut."""
        return self._values if points is self._nodes else np.zeros(len(points))

    def depth(self, points: Floats) -> Floats:
        """Return infinity where the body is split, minus infinity where it is not."""
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
        Its first v vertices are the given ones; copies follow.

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
        self._places = MaterialPlaces(mesh, cutter.interior)
        self._vertex_cell, self._vertex_at = self._places.cells_of(self.points)
        self._numbers = PointNumbers(len(self.points), mesh.space)
        self._edges = EdgePoints(self.points, self._numbers)
        # cells near each facet, and facets near each cell, as (first of each, all)
        facet, cell = self._facets_and_cells()
        self._around = np.searchsorted(facet, np.arange(len(self.facets) + 1)), cell
        order = np.argsort(cell, kind="stable")
        cells = np.arange(len(mesh.cells) + 1)
        self._near = np.searchsorted(cell[order], cells), facet[order]
        every = np.arange(len(self.facets))
        self._corners = self._place_corners(every, self.points[self.facets])
        self._facet_range = np.zeros((len(self.facets), 2), dtype=np.int64)
        nodes = distinct(self.facets)
        self._replace(every, nodes, *self._values(nodes))

    def update(self, increment: Increment | None) -> None:
        """Follow a cut."""
        if increment is None:
            return
        is_near = np.zeros(len(self.facets), dtype=bool)
        is_near[of_lists(*self._near, increment.moved)] = True
        near = np.flatnonzero(is_near)
        nodes = distinct(self.facets[near])
        numbers, values = self._values(nodes)
        # a facet on one side of all cuts, in cells that are as they were, stays as it is
        moved = increment.moved
        cell = self._corners.cell[near]
        place = np.minimum(np.searchsorted(moved, cell), len(moved) - 1)
        level = values[np.searchsorted(nodes, self.facets[near])]
        both = ~((level > 0.0).all(axis=1) | (level < 0.0).all(axis=1)).all(axis=1)
        concerned = near[(moved[place] == cell).any(axis=1) | both]
        if len(concerned):
            self._replace(concerned, nodes, numbers, values)

    def is_cut(self, places: Floats, cut: int) -> Bools:
        """Tell whether the element at each material place (q, s) is split by a cut."""
        place, cell = self._places.holding(places)
        found = np.zeros(len(places), dtype=bool)
        found[place[self._cutter.body.split_by(cell, cut)]] = True
        return found

    def _facets_and_cells(self) -> tuple[Ints, Ints]:
        """Find the facet, ascending, and cell of all pairs that are near each other.

        They are if their boxes meet, or if a vertex of the facet belongs to the cell. Outside the
        mesh boxes count up to twice the distance of the next one, as in `places`.
        """
        corners, size = self.points[self.facets], self.facets.shape[1]
        outside = np.maximum(0.0, self._places.gap(self._vertex_cell, self.points))
        reach = (self._places.reach + 2.0 * outside[self.facets].max(axis=1))[:, None]
        starts, cells = self._cutter.interior.meeting(
            corners.min(axis=1) - reach, corners.max(axis=1) + reach
        )
        every = np.arange(len(self.facets))
        facet = np.concatenate([np.repeat(every, np.diff(starts)), np.repeat(every, size)])
        cells = np.concatenate([cells, self._vertex_cell[self.facets].ravel()])
        pairs = distinct(facet * len(self._cutter.mesh.cells) + cells)
        return np.divmod(pairs, len(self._cutter.mesh.cells))

    def _place_corners(self, facets: Ints, places: Floats) -> _Corners:
        """Find cells for the corners (q, k, s) of parts of facets, a little inside of each part."""
        count, size, space = places.shape
        inside = (1.0 - _INWARDS) * places + _INWARDS * places.mean(axis=1, keepdims=True)
        facet, (starts, near) = np.repeat(facets, size), self._around
        bounds = np.stack([starts[facet], starts[facet + 1]], axis=1)
        cell, at = self._places.cells_of(inside.reshape(-1, space), (bounds, near))
        weights = self._places.barycentric(cell, places.reshape(-1, space))
        weights[np.abs(weights) <= _SNAP] = 0.0
        weights /= weights.sum(axis=1, keepdims=True)
        shape = (count, size, weights.shape[1])
        return _Corners(cell.reshape(count, size), weights.reshape(shape), at.reshape(shape))

    def _replace(self, facets: Ints, nodes: Ints, numbers: Ints, values: Floats) -> None:
        """Put the parts of some facets in the place of what there is of these.

        They are divided by the cuts with these `numbers`, whose level sets at the `nodes` are
        `values` (q, cuts), and bisected where others are. Then it is found with which pieces they
        move.
        """
        ids, source, at, side = self._divided(facets, nodes, numbers, values)
        self._edges.add(ids.ravel())
        ids, at, origin = self._edges.bisect(ids, at)
        source = source[origin]
        label = np.zeros((len(ids), self._cutter.body.cut_count), dtype=np.int8)
        label[:, numbers] = side[origin]
        alone = np.bincount(source, minlength=len(facets)) == 1
        # where the corners of a whole facet are is known; only which piece that is may be new
        divided = np.flatnonzero(~alone[source] | label.any(axis=1))
        source, known = facets[source], self._corners
        material = at @ self.points[self.facets[source]]
        found = self._place_corners(source[divided], material[divided])
        corners = _Corners(known.cell[source], known.weights[source], known.inside[source])
        corners.cell[divided], corners.weights[divided] = found.cell, found.weights
        corners.inside[divided] = found.inside
        self.surface.retire(ranges(self._facet_range[facets]))
        self.surface.add(
            ids, material, corners.weights,
            lambda rows: corners.weights.reshape(-1, corners.weights.shape[2])[rows] != 0.0,
            self._pieces(corners, label), np.zeros(len(ids), dtype=bool),
            self._cutter.body.piece_cells.rows, source, self._facet_range,
        )  # fmt: skip

    def _pieces(self, corners: _Corners, label: Sides) -> Ints:
        """Find piece (q, k) of each corner of parts of facets, from its cell and the place inside.

        `label` (q, cuts) are the sides on which the cuts that split a facet have left it; on which
        side of the others a corner is, the level sets tell.
        """
        cells, cutter = corners.cell.ravel(), self._cutter
        at = corners.inside.reshape(len(cells), -1)
        level = np.einsum("qa,qac->qc", at, cutter.level_sets[cutter.mesh.cells[cells]])
        known = np.repeat(label, corners.cell.shape[1], axis=0)
        side = np.where(known != 0, known, np.where(level >= 0.0, 1, -1))
        found, agree = np.full(len(cells), -1), np.full(len(cells), np.iinfo(np.int64).min)
        for rows, pieces in cutter.body.pieces.in_turn(cells):
            stored = cutter.body.piece_label.rows[pieces]
            # of all pieces the right one agrees with every cut; else the nearest to it
            points = np.where(stored == side[rows], 1, -1000)
            points[stored == 0] = 0
            total = points.sum(axis=1)
            better = total > agree[rows]
            found[rows[better]], agree[rows[better]] = pieces[better], total[better]
        return found.reshape(corners.cell.shape)

    def _divided(
        self, facets: Ints, nodes: Ints, numbers: Ints, values: Floats
    ) -> tuple[Ints, Ints, Floats, Sides]:
        """Divide facets by any number of cuts, as elements are."""
        local = np.searchsorted(nodes, self.facets[facets])
        patch = MeshPatch(self.points, self._cutter.mesh.extent, facets, nodes, local)
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

    def _values(self, vertices: Ints) -> tuple[Ints, Floats]:
        """Cuts between vertices, or through one, and their realised level sets (q, cuts) there."""
        strokes = [stroke for stroke in self._cutter.strokes if stroke.has_begun]
        cells, at = self._cutter.mesh.cells[self._vertex_cell[vertices]], self._vertex_at[vertices]
        nodes = distinct(cells)
        numbers, columns = [], []
        for stroke in strokes:
            stroke.level_sets(nodes)
            values = (at * stroke.values[cells]).sum(axis=1)
            values[np.abs(values) <= self._snap] = 0.0
            # one that may still be led elsewhere: what it met before is asked again
            led = stroke is strokes[-1] and stroke.opens is None
            if led or ((values >= 0.0).any() and (values <= 0.0).any()):
                numbers.append(stroke.number)
                columns.append(values)
        found = np.stack(columns, axis=1) if columns else np.empty((len(vertices), 0))
        return np.array(numbers, dtype=np.int64), found


def _check(points: Floats, facets: Ints, space: int) -> None:
    if points.ndim != 2 or points.shape[1] != space or not np.isfinite(points).all():
        raise XfemError(f"surface points of shape {points.shape}; expected finite (v, {space})")
    if facets.ndim != 2 or facets.shape[1] != space or len(facets) == 0:
        raise XfemError(f"surface facets of shape {facets.shape}; expected (f, {space}), f > 0")
    if facets.min() < 0 or facets.max() >= len(points):
        raise XfemError(f"a surface facet has a vertex outside 0..{len(points) - 1}")
    if (np.diff(np.sort(facets, axis=1), axis=1) == 0).any():
        raise XfemError("a surface facet has a vertex twice")
