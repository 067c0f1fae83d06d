"""Fields on the sides of the cuts as asked, of solutions whose cut deviates from them.

A cut as realised may differ from the cut as asked: facets of an arc, a snapped cut. Between the
two, the cell that holds a point lies on the wrong side. There the field is continued from the
nearest cell on the right side of the realised cut. Facets beyond the limit (`RealisedCut`) are the
exception: beside them the field stays as stored. Where a solver has no cut at all (ahead of a tip
that it moved back), nothing is changed: the error is real.

Sides of cells come from doubled nodes. No coordinate is compared across the cut. A cell with a
facet of the realised cut lies on the side of its opposite corner, and its nodes belong to that
side. From there the side goes on from node to node, never across the cut, because nodes are doubled
there. So a sliver has the right side however thin it is, and so has a corner of the cut. A cell so
tiny that a solver may have left it to the other half takes the side of its nodes.

A point of a membrane belongs to the nearest triangle of the solution: on the same surface, the
triangle that holds it. Two triangulations of one curved surface lie a sagitta apart, and the foot
of a point beside a cut might fall across it. So only triangles on the point's side of the planes of
the cuts count, or ahead of a tip on both.
"""

from collections.abc import Sequence
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.body import AnyBody
from verify.compare.cell_tree import holding_cells
from verify.compare.cut_deviation import RealisedCut
from verify.compare.locate import ROUND_OFF, SolutionField, squares
from verify.compare.sides import AskedCut, asked_sides, distance_to_cut
from verify.compare.simplex_bodies import MembraneBody
from verify.compare.simplices import Simplices, kept_with
from verify.geometry.simplices import unit_normals
from verify.solution import Solution

Ints = NDArray[np.int64]
Bits = NDArray[np.int8]
Sides = NDArray[np.int8]
Array = NDArray[np.float64]


# A facet within 60° of the cut as asked says which side is which. Steeper ones (of a cut that was
# snapped to mesh lines) get their sides from these.
_ALONG = 0.5
# Sine of the angle to a cut that is as doubtful as a distance of the whole deviation.
_STEEP = 0.5
# Facets are asked in the order of how sure it is which cut they realise.
_MARGINS = (1.0, 0.5, 0.2, 0.1, 0.0)
_PLUS, _MINUS, _BOTH = 1, 2, 3
# Height, over the largest beside a facet, of pieces that solvers leave to the other half: 2⁻⁵² of
# the cell has at most 1e-5 of its height, as a tetrahedron.
_TINY = 1e-5


def sides_of_cells(
    solution: Solution, shape: Simplices, cuts: Sequence[AskedCut], reach: float, same: float
) -> NDArray[np.int8]:
    """Compute side (m, c) of each cut on which cells lie: 1, −1; 0 of both, or far from the cut.

    Parameters
    ----------
    solution : Solution
    shape : Simplices
        Of its cells.
    cuts : sequence of pieces of each cut as asked
    reach : float
        How far from the cuts as asked sides are needed, m.
    same : float
        Places of nodes that are closer than this are the same, m.
    """
    nodes = np.ascontiguousarray(solution.cells[:, : shape.corners.shape[1]])
    facets = solution.cut_facets
    cell, corner, facet = _cells_on_facets(solution.points, nodes, facets, same)
    normal = np.nan_to_num(unit_normals(facets))  # 0 of a point
    beside, sure = _beside_facets(shape, cell, corner, facet, facets, normal)
    cut, along, margin = _orientations(facets, normal, cuts, 0.5 * reach, same)
    centre = shape.corners.mean(axis=1)
    radius = np.linalg.norm(shape.corners - centre[:, None], axis=2).max(axis=1)
    sides = np.zeros((len(nodes), len(cuts)), dtype=np.int8)
    for k, pieces in enumerate(cuts):
        known = (cut[facet] == k) & (np.abs(along[facet]) >= _ALONG)
        plus = beside * along[facet] > 0.0
        level = np.min([np.abs(piece.level(centre)) for piece in pieces], axis=0)
        near = level <= reach + radius
        bits = np.zeros(len(nodes), dtype=np.int8)
        at_node = np.zeros(len(solution.points), dtype=np.int8)
        # who doubts, is asked where nobody is surer; tiny cells have first the side of their nodes
        for first, least in product((True, False), _MARGINS):
            ask = known & (margin[facet] >= least) & (bits[cell] == 0) & (sure | (not first))
            asked = np.zeros_like(bits)
            np.bitwise_or.at(asked, cell[ask], np.where(plus[ask], _PLUS, _MINUS).astype(np.int8))
            fresh = np.flatnonzero((asked == _PLUS) | (asked == _MINUS))
            bits[fresh] = asked[fresh]
            _spread(nodes, near, fresh, bits, at_node)
        sides[:, k] = (bits == _PLUS).astype(np.int8) - (bits == _MINUS)
    return sides


def _cells_on_facets(
    points: Array, nodes: Ints, facets: Array, same: float
) -> tuple[Ints, Ints, Ints]:
    """Find cells (k,) with a facet of cut, the corner (k,) opposite to it, and that facet (k,)."""
    d = facets.shape[1]
    places, of_corner = np.unique(facets.reshape(-1, facets.shape[2]), axis=0, return_inverse=True)
    low, high = places.min(axis=0) - same, places.max(axis=0) + same
    inside = np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))
    _, found = cKDTree(places).query(points[inside], distance_upper_bound=same)
    place = np.full(len(points), -1)
    place[inside] = np.where(found < len(places), found, -1)
    key_of_facet = np.sort(of_corner.reshape(-1, d), axis=1)

    at = place[nodes]
    some = np.flatnonzero((at >= 0).sum(axis=1) >= d)
    rows, corners, keys = [some[:0]], [some[:0]], [key_of_facet[:0]]
    for opposite in range(nodes.shape[1]):
        key = np.sort(np.delete(at[some], opposite, axis=1), axis=1)
        on = key[:, 0] >= 0
        rows.append(some[on])
        corners.append(np.full(on.sum(), opposite))
        keys.append(key[on])
    row, corner, key = (np.concatenate(column) for column in (rows, corners, keys))
    _, number = np.unique(np.vstack([key_of_facet, key]), axis=0, return_inverse=True)
    facet_of = np.full(number.max(initial=-1) + 1, -1)
    facet_of[number[: len(facets)]] = np.arange(len(facets))
    facet = facet_of[number[len(facets) :]]
    kept = facet >= 0
    return row[kept], corner[kept], facet[kept]


def _beside_facets(
    shape: Simplices, cell: Ints, corner: Ints, facet: Ints, facets: Array, normal: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Find the side (k,) of a facet's own normal of its cells: of two cells, opposite sides.

    Which are sure of it (k,) is also returned. A solver may leave a piece within round-off of its
    cell to the other half: of its facet it then lies on the wrong side, and its nodes tell.
    """
    off = shape.corners[cell, corner] - facets[facet, 0]
    height = np.sum(off * normal[facet], axis=1)
    # the higher of the two is sure of its side; the other may be as thin as round-off
    order = np.lexsort([-np.abs(height), facet])
    first = np.diff(facet[order], prepend=-1) != 0
    start = np.flatnonzero(first)[np.cumsum(first) - 1]
    leader = np.sign(height[order[start]])
    side = np.empty(len(height))
    side[order] = np.where(first, leader, -leader)
    return side, np.abs(height) > _TINY * np.abs(height).max(initial=0.0)


def _orientations(
    facets: Array, normal: Array, cuts: Sequence[AskedCut], deviation: float, step: float
) -> tuple[Ints, Array, Array]:
    """Cut (f,) that each facet realises, the cosine (f,) between their normals, and the margin.

    At a crossing a facet may be shorter than the cut's deviation and near to both cuts: then its
    direction counts as well. The margin is by how much it is less doubtful than another cut.
    """
    probes = np.concatenate([facets, facets.mean(axis=1, keepdims=True)], axis=1)
    count, each, d = probes.shape
    cosine, doubt = np.zeros((2, len(cuts), count))
    shift = 1e4 * step * normal  # the level is a distance: its slope is a cosine
    for k, pieces in enumerate(cuts):
        away, _, nearest = distance_to_cut(pieces, probes.reshape(-1, d))
        for number, piece in enumerate(pieces):
            at = np.flatnonzero(nearest.reshape(count, each)[:, -1] == number)
            centre = probes[at, -1]
            rise = piece.level(centre + shift[at]) - piece.level(centre - shift[at])
            cosine[k, at] = rise / (2e4 * step)
        farthest = away.reshape(count, each).max(axis=1)
        doubt[k] = (farthest / deviation) ** 2 + (1.0 - cosine[k] ** 2) / _STEEP**2
    cut = doubt.argmin(axis=0)
    if len(cuts) == 1:
        return cut, cosine[0], np.full(count, np.inf)
    margin = np.diff(np.partition(doubt, 1, axis=0)[:2], axis=0)[0]
    return cut, cosine[cut, np.arange(count)], margin


def _spread(nodes: Ints, near: NDArray[np.bool_], fresh: Ints, bits: Bits, at_node: Bits) -> None:
    """Hand the `bits` (m,) of `fresh` cells on to those `near` without any, by common nodes."""
    open_ = np.flatnonzero(near & (bits == 0))
    while len(fresh):
        given = np.zeros_like(at_node)
        np.bitwise_or.at(given, nodes[fresh], bits[fresh, None])
        given[at_node != 0] = 0  # a layer at a time: the first stays
        at_node |= given
        open_ = open_[bits[open_] == 0]
        sides, both = np.zeros(len(open_), dtype=np.int8), np.zeros(len(open_), dtype=bool)
        for met in at_node[nodes[open_].T]:
            sides |= np.where(met == _BOTH, 0, met)
            both |= met == _BOTH
        sides[(sides == 0) & both] = _BOTH  # at a tip: neither, from there on
        fresh = open_[sides != 0]
        bits[fresh] = sides[sides != 0]


# A triangle of which less than this share reaches across a plane is on one side of it: meshes that
# conform to a cut may let it pass through a node that is so close.
_ACROSS = 1e-4


class MembraneField(SolutionField):
    """Evaluate a solution of a membrane, on the sides of the cuts of its body.

    Parameters
    ----------
    solution : Solution
    body : MembraneBody
    step : int
        Output time that is evaluated; default the last.
    sided : bool
        Whether points are evaluated on their sides of the cuts.

    Attributes
    ----------
    off_surface : float
        Largest distance of the corners and centres of the body's triangles from the solution's
        surface, m.
    """

    def __init__(
        self, solution: Solution, body: MembraneBody, step: int = -1, sided: bool = True
    ) -> None:
        super().__init__(solution, step)
        self._patches = body.patches if sided else []
        level = [patch.level(self.shape.corners.reshape(-1, 3)) for patch in self._patches]
        self._sides = _sides_of(np.array(level).reshape(len(level), len(self.shape.corners), 3))
        probes = np.concatenate([body.corners.reshape(-1, 3), body.corners.mean(axis=1)])
        self.off_surface = float(self._on_surface(probes)[1].max())

    def _wanted(self, points: Array, near: Array | None) -> Sides:
        """Find the sides (n, p) of planes that points lie on; on a plane, the side of `near`."""
        wanted = np.zeros((len(points), len(self._patches)), dtype=np.int8)
        for k, patch in enumerate(self._patches):
            level = patch.level(points)
            on = np.abs(level) <= ROUND_OFF * self.scale
            towards = 0.0 if near is None else patch.level(near) - level
            wanted[:, k] = np.sign(np.where(on, towards, level))
        return wanted


def _sides_of(level: Array) -> Sides:
    """Tell sides (m, p) of planes of triangles, by the levels (p, m, 3) of their corners."""
    low, high = level.min(axis=2), level.max(axis=2)
    both = np.minimum(-low, high) > _ACROSS * (high - low)
    return np.ascontiguousarray(np.where(both, 0, np.sign(low + high)).T.astype(np.int8))


def field_of(
    solution: Solution,
    body: AnyBody,
    step: int = -1,
    deviation: float = 0.0,
    continued: bool | RealisedCut = True,
) -> SolutionField:
    """Make the field of a solution, with the sides of the cuts of `body` as asked.

    `deviation` in m belongs to another solution's cut, if the field is asked on the sides of that
    cut, or is known of its own. Unless it is `continued`, the cell that holds a point gives the
    field, whatever its side. With a `RealisedCut` this is so beside facets beyond the limit (of a
    membrane everywhere, if there are any).
    """
    cut = continued if isinstance(continued, RealisedCut) else None
    if isinstance(body, MembraneBody):
        return MembraneField(solution, body, step, cut.record.continued if cut else bool(continued))
    if not len(solution.cut_facets) or not body.has_cuts or not continued:
        return SolutionField(solution, step)
    return SidedField(solution, body, step, deviation, cut)


def cut_deviation(solution: Solution, body: AnyBody) -> float:
    """Measure the largest distance of the realised cut from the cuts as asked, m, tips apart."""
    facets = solution.cut_facets
    if not len(facets) or not body.has_cuts:
        return 0.0
    d = facets.shape[1]
    probes = np.concatenate([*(facets[:, k] for k in range(d)), facets.mean(axis=1)])
    foot, end = body.nearest_on_cuts(probes)
    # a cut that is too long has no other side to be read from
    beside = np.linalg.norm(probes - foot, axis=1)[~end]
    return float(beside.max(initial=0.0))


@kept_with
def _known_sides(solution: Solution) -> dict[tuple[int, float], tuple[Any, float, Sides]]:
    """Keep the reach and the sides of cells, with the cuts that they belong to, by deviation."""
    return {}


class SidedField(SolutionField):
    """A solution's field, asked on the sides of the cuts as asked.

    Parameters
    ----------
    solution : Solution
        With a realised cut.
    body : Body or SolidBody
        With cuts.
    step : int
        Output time that is evaluated; default the last.
    deviation : float
        How far from the cuts as asked sides matter at least, m.
    cut : RealisedCut, optional
        Beside its facets beyond the limit sides do not count.
    """

    def __init__(
        self,
        solution: Solution,
        body: AnyBody,
        step: int = -1,
        deviation: float = 0.0,
        cut: RealisedCut | None = None,
    ) -> None:
        super().__init__(solution, step)
        self._cut = cut
        self._cuts, self._size = list(body.cuts.values()), body.size
        same, known = ROUND_OFF * body.size, _known_sides(solution)
        if (key := (id(body.cuts), deviation)) not in known:
            reach = 2.0 * max(cut_deviation(solution, body), deviation, same)
            sides = sides_of_cells(solution, self.shape, self._cuts, reach, same)
            known[key] = body.cuts, reach, sides
        _, self._reach, self._sides = known[key]

    def inner_points(self, cells: NDArray[np.int64]) -> Array:
        """Find points (n, d) on the sides of the cuts as asked on which given cells (n,) lie.

        They are the centres of the cells. A cell between a cut as asked and as realised has its
        centre on the wrong side: the centre of the nearest cell that is right replaces it.
        """
        reach = np.full(len(self._centres), self._reach)
        asked = asked_sides(self._cuts, self._centres, reach, self._size)
        right = (asked * self._sides >= 0).all(axis=1)
        if self._cut is not None:
            right |= self._cut.beyond_at(self._centres)
        at = np.array(cells, copy=True)
        wrong = np.flatnonzero(~right[at])
        for sides in np.unique(self._sides[at[wrong]], axis=0):
            rows = wrong[(self._sides[at[wrong]] == sides).all(axis=1)]
            same = np.flatnonzero(right & (self._sides == sides).all(axis=1))
            if len(same):
                tree = cKDTree(self._centres[same])
                at[rows] = same[tree.query(self._centres[at[rows]])[1]]
        return np.asarray(self._centres[at])

    def _wanted(self, points: Array, near: Array | None) -> NDArray[np.int8]:
        """Find sides (n, c) of the cuts as asked on which `near` lies, of points close to these."""
        side = points if near is None else np.asarray(near, dtype=float)
        reach = np.broadcast_to(self._reach, len(points))
        if side is not points:
            reach = reach + np.sqrt(squares(side - points))
        wanted = asked_sides(self._cuts, side, reach, self._size)
        if self._cut is not None:
            rows = np.flatnonzero(wanted.any(axis=1))
            rows = rows[self._cut.beyond_at(points[rows])]
            wanted[rows[self._in_material(points[rows])]] = 0
        return wanted

    def _in_material(self, points: Array) -> NDArray[np.bool_]:
        """Tell whether points (n, d) lie in a cell, and not in a hole that a method left."""
        tolerance = ROUND_OFF * self.scale
        return holding_cells(points, self._searched, tolerance, nearest=False) >= 0
