"""A surface that is not the mesh's own, carried by a cut body: what one sees, or collides with.

Each vertex belongs to the piece that contains it. A facet is split where the cut crosses it
through, that is where the elements on both its edges are split; which vertices are doubled follows
from the pieces, so the surface opens where the material does, and nowhere else. Only facets near
elements that a cut touched are looked at again (thesis 3.2.4, 4.4.2).

`verify.xfem.pieces` divides facets by any number of cuts. For the one that is under way it is done
here: at a step a blade meets a hundred facets, and with so few only the number of calls costs.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from verify.simulator.division import MeshPatch
from verify.simulator.growing_body import Increment
from verify.simulator.moving_surface import MovingSurface
from verify.simulator.places import MaterialPlaces
from verify.simulator.point_numbers import (
    EdgePoints,
    FoundPoints,
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


class DividedFacets(NamedTuple):
    """Parts of triangles.

    Attributes
    ----------
    ends, positions : (z, 2) int and (z, 3) float arrays
        Of the new points: the edge on which each lies, that above the cut first, and where it is.
    ids, at : (q, 3) int and (q, 3, 3) float arrays
        Corners of the parts, in the direction of their facet, and their coordinates in it. New
        points count from the number of those given on.
    source, side : (q,) arrays
        Facet of each part, ascending, and its side of the cut; 0 if the facet is not divided.
    """

    ends: Ints
    positions: Floats
    ids: Ints
    at: Floats
    source: Ints
    side: Sides


def divide_facets(
    facets: Ints, values: Floats, points: Floats, is_cut: Callable[[Floats], Bools]
) -> DividedFacets:
    """Divide triangles by a cut where both places in which it crosses their edges are split.

    Parameters
    ----------
    facets : (f, 3) int array
        Places of their corners in `points`.
    values : (n,) float array
        Level set at the points, exactly zero within round-off.
    points : (n, 3) float array
    is_cut : callable
        Whether the body is split at places (z, 3).
    """
    above = values[facets] >= 0.0
    crossed = np.flatnonzero(above.any(axis=1) & ~above.all(axis=1))
    # the corner alone on its side comes first, then the others in the direction of the facet
    sides = above[crossed]
    alone = np.argmax(sides == (sides.sum(axis=1) == 1)[:, None], axis=1)
    turn = (alone[:, None] + np.arange(3)) % 3
    corners = facets[crossed[:, None], turn]
    positive = sides[np.arange(len(alone)), alone]
    # the points on the edges from that corner to both others, each edge once
    other, first = corners[:, 1:].ravel(), np.repeat(corners[:, 0], 2)
    up = np.repeat(positive, 2)
    edge = np.where(up, first, other) << 32 | np.where(up, other, first)
    edges, point = np.unique(edge, return_inverse=True)
    ends = np.stack([edges >> 32, edges & 0xFFFFFFFF], axis=1)
    high, low = values[ends].T
    share = np.stack([-low / (high - low), high / (high - low)], axis=1)
    places = np.einsum("ze,zei->zi", share, points[ends])
    # where the level set is zero at an end, the point is that end
    new = share[:, 1] > 0.0
    number = np.where(new, len(points) + np.cumsum(new) - 1, ends[:, 0])
    point = point.reshape(-1, 2)
    is_through = is_cut(places)[point].all(axis=1)
    row = np.full(len(facets), -1)
    row[crossed[is_through]] = np.flatnonzero(is_through)
    parts = _divided(facets, row, alone, positive, number[point], share[point])
    return DividedFacets(ends[new], places[new], *parts)


@njit(cache=True)
def _divided(facets, row, alone, positive, points, shares):
    """Write the parts of facets: corners, their coordinates, facet, side of the cut.

    `row` (f,) is the row of a divided facet in the other arrays. They are: its corner alone on its
    side; whether the corner is above the cut; the two points (r, 2) on the edges from it; and the
    shares (r, 2, 2) of the ends of these edges in the points, the end above first.
    """
    most = 3 * len(facets)
    ids, at = np.empty((most, 3), dtype=np.int64), np.zeros((most, 3, 3))
    source, side = np.empty(most, dtype=np.int64), np.zeros(most, dtype=np.int8)
    known, where, count = np.empty(5, dtype=np.int64), np.zeros((5, 3)), 0
    for facet in range(len(facets)):
        r = row[facet]
        if r < 0:
            ids[count], source[count] = facets[facet], facet
            for k in range(3):
                at[count, k, k] = 1.0
            count += 1
            continue
        # corners a, b, c and the points u on ab, v on ac
        where[:] = 0.0
        for k in range(3):
            corner = (alone[r] + k) % 3
            known[k], where[k, corner] = facets[facet, corner], 1.0
        for k in range(2):
            own = shares[r, k, 0 if positive[r] else 1]
            known[3 + k] = points[r, k]
            where[3 + k] = own * where[0] + (1.0 - own) * where[1 + k]
        # as in `verify.xfem.clip`: the diagonal begins at the corner with the lower number
        lower = known[1] < known[2]
        parts = ((0, 3, 4), (3, 1, 4 if lower else 2), (1 if lower else 3, 2, 4))
        for number, part in enumerate(parts):
            one, two, three = known[part[0]], known[part[1]], known[part[2]]
            if one == two or two == three or three == one:
                continue
            for k in range(3):
                ids[count, k], at[count, k] = known[part[k]], where[part[k]]
            source[count] = facet
            side[count] = 1 if positive[r] == (number == 0) else -1
            count += 1
    return ids[:count], at[:count], source[:count], side[:count]


class _Fragments(NamedTuple):
    """Parts of facets: points (q, k), facet, barycentric corners in it, sides of cuts, if whole."""

    ids: Ints
    source: Ints
    at: Floats
    label: Sides
    whole: Bools


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

        They are divided, given the cuts and their level sets (q, cuts) at the vertices; then it is
        found with which pieces the parts move.
        """
        parts = self._fragments(facets, nodes, numbers, values)
        material = parts.at @ self.points[self.facets[parts.source]]
        # where the corners of a whole facet are is known; only which piece that is may be new
        divided = np.flatnonzero(~parts.whole)
        found = self._place_corners(parts.source[divided], material[divided])
        source, known = parts.source, self._corners
        corners = _Corners(known.cell[source], known.weights[source], known.inside[source])
        corners.cell[divided], corners.weights[divided] = found.cell, found.weights
        corners.inside[divided] = found.inside
        self.surface.retire(ranges(self._facet_range[facets]))
        self.surface.add(
            parts.ids, material, corners.weights,
            lambda rows: corners.weights.reshape(-1, corners.weights.shape[2])[rows] != 0.0,
            self._pieces(corners, parts.label), np.zeros(len(parts.ids), dtype=bool),
            self._cutter.body.piece_cells.rows, parts.source, self._facet_range,
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

    def _fragments(self, facets: Ints, nodes: Ints, numbers: Ints, values: Floats) -> _Fragments:
        """Divide facets, bisect them where others are, and say on which sides they lie.

        `values` (q, cuts) are the level sets of the cuts with these `numbers` at the `nodes`.
        """
        several = len(numbers) != 1 or self.facets.shape[1] == 2
        divide = self._divided_by_several if several else self._divided_by_one
        ids, source, at, side = divide(facets, nodes, numbers, values)
        self._edges.add(ids.ravel())
        ids, at, origin = self._edges.bisect(ids, at)
        source = source[origin]
        label = np.zeros((len(ids), self._cutter.body.cut_count), dtype=np.int8)
        label[:, numbers] = side[origin]
        alone = np.bincount(source, minlength=len(facets)) == 1
        is_whole = alone[source] & ~label.any(axis=1)
        return _Fragments(ids, facets[source], at, label, is_whole)

    def _divided_by_one(
        self, facets: Ints, nodes: Ints, numbers: Ints, values: Floats
    ) -> tuple[Ints, Ints, Floats, Sides]:
        """Divide facets by the only cut there is: points, which facet, corners in it, side."""
        corners, local = self.points[nodes], np.searchsorted(nodes, self.facets[facets])
        parts = divide_facets(
            local, values[:, 0], corners, lambda places: self.is_cut(places, int(numbers[0]))
        )
        positions = np.concatenate([corners, parts.positions])
        cut = np.zeros(len(parts.ends), dtype=np.int64)
        found = FoundPoints(positions, values, parts.ends, cut)
        point = self._numbers.number(found, nodes, numbers)
        return point[parts.ids], parts.source, parts.at, parts.side[:, None]

    def _divided_by_several(
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
