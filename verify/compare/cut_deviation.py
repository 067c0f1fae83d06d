"""Deviation of a realised cut from the cut as asked, and the realised cut as geometry.

Deviations, lateral and at the ends, are measured from the facets of the realised cut and the cuts
as asked alone, cut by cut: a facet belongs to the cut that it is nearest to. A point whose nearest
point is a free end lies beyond it: there a part of the cut is missing, or too much. All other
distances are lateral deviations. As geometry a realised cut is polylines in the plane, triangles in
space.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import reduce
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.body import AnyBody, Body
from verify.compare.cut_rule import CutRule, cut_rule_of
from verify.compare.locate import ROUND_OFF, nearest_of_triangles, squares
from verify.compare.sides import distance_to_cut, distance_to_segments, nearest_segments
from verify.compare.simplex_bodies import MembraneBody, SolidBody, deep_inside
from verify.compare.simplices import cells_of, heights, points_in
from verify.geometry.curves import Arc
from verify.geometry.simplices import boundary_facets, places_of
from verify.result import CutRecord
from verify.solution import Solution

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

Flags = NDArray[np.bool_]

# Over the longest edge D of an element: largest error of the linear interpolant of the distance
# from an arc of radius 2D (docs/theory/judgement.md, "Where the cut is").
LIMIT = {2: 1 / 12, 3: 3 / 32}
_ORDER = {2: 8, 3: 3}  # of the rule on segments and on triangles
# Of its distance from a point of the realised cut: a place this close to that cut was cut there.
_AT = 0.1
_STEP = 1e-6  # of sizes: a place this far inside a body is inside it, a thinner facet none


@dataclass(frozen=True)
class RealisedCut:
    """A realised cut, and how far it is from the cut as asked.

    Parameters
    ----------
    record : CutRecord
        Without swept surfaces.
    facets : (f, k, d) array
    beyond : (f,) bool array
        Facets at which the lateral deviation is above the limit.
    """

    record: CutRecord
    facets: Array
    beyond: Flags

    def beyond_at(self, points: Array) -> Flags:
        """Tell whether the facets nearest to points (n, d) lie beyond the limit (n,)."""
        if self.record.continued or not len(points):
            return np.zeros(len(points), dtype=bool)
        return np.asarray(
            self.beyond[_nearest_facets(points, self.facets, _STEP * self.record.element)[2]]
        )


def realised_cut(solution: Solution, body: AnyBody, rule: CutRule) -> RealisedCut:
    """Measure the realised cut of a body with cuts.

    Parameters
    ----------
    solution : Solution
    body : Body, SolidBody or MembraneBody
    rule : CutRule
        On its cuts as asked. Between its points nothing is seen.
    """
    same = ROUND_OFF * body.size
    _, number = welded(solution.cut_facets, same)
    distinct = (np.diff(np.sort(number, axis=1), axis=1) > 0).all(axis=1)
    facets = solution.cut_facets[distinct]
    probes = np.concatenate([facets, facets.mean(axis=1, keepdims=True)], axis=1)
    mine, theirs = _of_cuts(body, rule.points[:, None], same), _of_cuts(body, probes, same)
    d, element = solution.cell_dimension, _element(solution, facets)
    limit = LIMIT[d] * element
    forth, back, missing, surplus = [0.0], [0.0], 0.0, 0.0
    beyond = np.zeros(len(facets), dtype=bool)
    for k, cut in enumerate(body.cuts):
        rows = np.flatnonzero(theirs[k])
        points, weights, own = rule.points[mine[k]], rule.weights[mine[k]], facets[rows]
        away, end, nearest = _to_realised(points, rule.normals[mine[k]], own, body, same)
        missing += float(weights[end].sum())
        forth.append(float(away[~end].max(initial=0.0)))
        if not len(rows):
            continue
        beyond[rows[nearest[~end & (away > limit)]]] = True

        points, weights = points_in(own, _ORDER[facets.shape[1]])
        of_facet = np.repeat(rows, len(points) // max(len(rows), 1))
        of_facet = np.concatenate([of_facet, np.repeat(rows, probes.shape[1])])
        points = np.concatenate([points, probes[rows].reshape(-1, points.shape[1])])
        away, foot, end = _to_asked(points, body, cut, same)
        far = np.flatnonzero(~end & (away > limit))
        if len(far) and _ends_aside(own, body, cut, limit, same):
            # beside a place where the cut was made as asked it was made once more
            there = _to_realised(foot[far], None, own, body, same)[0]
            end[far] = there <= _AT * away[far]
        surplus += float(weights[end[: len(weights)]].sum())
        back.append(float(away[~end].max(initial=0.0)))
        beyond[of_facet[~end & (away > limit)]] = True
    found = max(forth), max(back), missing, surplus, 0.0, element, limit, _radius(body)
    return RealisedCut(CutRecord(d, *found), facets, beyond)


def continued_where(
    solution: Solution, body: AnyBody, record: CutRecord | None
) -> bool | RealisedCut:
    """Tell where a field is continued across its realised cut, of which the record is known."""
    if record is None or record.continued:
        return True
    return realised_cut(solution, body, cut_rule_of(body, record.element))


def welded(facets: Array, reach: float) -> tuple[Array, NDArray[np.int64]]:
    """Merge corners of facets (f, k, d) within `reach` m: corners (c, d), and numbers (f, k)."""
    points = facets.reshape(-1, facets.shape[-1])
    _, first, number = np.unique(places_of(points, reach), return_index=True, return_inverse=True)
    return points[first], number.reshape(facets.shape[:2]).astype(np.int64)


def _of_cuts(body: AnyBody, places: Array, same: float) -> Flags:
    """Tell whether groups of places (g, p, d) belong to each cut (c, g): the nearest one."""
    if len(body.cuts) == 1:
        return np.ones((1, len(places)), dtype=bool)
    flat = places.reshape(-1, places.shape[2])
    away = [distance_to_cut(pieces, flat)[0] for pieces in body.cuts.values()]
    farthest = np.array(away).reshape(len(away), *places.shape[:2]).max(axis=2)
    return np.asarray(farthest <= farthest.min(axis=0) + same)


def _to_realised(
    points: Array, normals: Array | None, facets: Array, body: AnyBody, same: float
) -> tuple[Array, Flags, Ints]:
    """Measure points to facets: distances (n,), whether facets end there (n,), the nearest (n,)."""
    if not len(facets):
        nowhere = np.full(len(points), np.inf), np.ones(len(points), dtype=bool)
        return *nowhere, np.zeros(len(points), dtype=np.int64)
    free = _free_faces(facets, body, same)
    away, foot, nearest = _nearest_facets(points, facets, same)
    to_face = free if facets.shape[1] == 3 else np.repeat(free, 2, axis=1)
    end = distance_to_segments(points, to_face, away.max(initial=0.0) + same) <= away + same
    if isinstance(body, MembraneBody) and normals is not None:  # the surfaces may be apart
        away = np.abs(np.sum((points - foot) * normals, axis=1))
    return away, end, nearest


def _to_asked(points: Array, body: AnyBody, cut: str, same: float) -> tuple[Array, Array, Flags]:
    """Measure points to a cut as asked: distances (n,), feet (n, d), whether it ends there (n,)."""
    if isinstance(body, SolidBody):
        found = [patch.nearest(points) for patch in body.cuts[cut]]
        feet, rim = (np.array(column) for column in zip(*found, strict=True))
        each = np.linalg.norm(points - feet, axis=2)
        away, foot = each.min(axis=0), feet[each.argmin(axis=0), np.arange(len(points))]
        nearest = each <= away + same
        # an edge that two patches share is no end
        return away, foot, (nearest & rim).any(axis=0) & (nearest.sum(axis=0) == 1)
    if isinstance(body, MembraneBody):
        ends = body.lines[cut].ends
        away, foot, _ = nearest_segments(points, ends)
    else:
        ends = np.array([piece.point(np.array([0.0, 1.0])) for piece in body.cuts[cut]])
        away, foot, _ = distance_to_cut(body.cuts[cut], points)
    free = np.repeat(_free_faces(ends, body, same), 2, axis=1)
    end = distance_to_segments(points, free, away.max(initial=0.0) + same) <= away + same
    if isinstance(body, MembraneBody):  # the surfaces may be apart
        away = distance_to_cut(body.cuts[cut], points)[0]
    return away, foot, end


def _ends_aside(facets: Array, body: AnyBody, cut: str, limit: float, same: float) -> bool:
    """Tell whether facets end freely beside the middle of a cut as asked."""
    free = _free_faces(facets, body, same).mean(axis=1)
    away, _, end = _to_asked(free, body, cut, same)
    return bool((~end & (away > limit)).any())


def _free_faces(facets: Array, body: AnyBody, same: float) -> Array:
    """Find ends (e, 1, d) or edges (e, 2, 3) inside a body that one facet alone has."""
    corners, number = welded(facets, same)
    free = corners[boundary_facets(number)[0]]
    if isinstance(body, MembraneBody):
        return np.asarray(free)
    return np.asarray(free[deep_inside(free.mean(axis=1), body.inside, _STEP * body.size)])


def _nearest_facets(points: Array, facets: Array, same: float) -> tuple[Array, Array, Ints]:
    """Return distances (n,) of points (n, d), feet (n, d) on segments, and nearest facets (n,)."""
    if facets.shape[1] == 2:
        return nearest_segments(points, facets)
    thick = np.flatnonzero(heights(facets) > same)
    found, away = nearest_of_triangles(points, facets[thick], same)
    return away, points, thick[found]


def _element(solution: Solution, facets: Array) -> float:
    """Find the longest edge of cells within their diameter of the facets, or of all, m."""
    corners = cells_of(solution).corners
    ends = combinations(np.moveaxis(corners, 1, 0), 2)
    longest = np.sqrt(reduce(np.maximum, [squares(b - a) for a, b in ends]))
    if not len(facets):
        return float(longest.max())
    places = np.concatenate([*np.swapaxes(facets, 0, 1), facets.mean(axis=1)])
    reach = float(longest.max()) * (1.0 + 1e-9)  # most cells are farther off
    away, _ = cKDTree(places).query(corners.mean(axis=1), distance_upper_bound=reach)
    return float(longest[away <= longest].max(initial=0.0))


def _radius(body: AnyBody) -> float | None:
    """Compute the least radius of curvature of the cuts of a body, m; None if nothing is curved."""
    if isinstance(body, Body):
        found = [part.piece.radius for part in body.parts if isinstance(part.piece, Arc)]
    else:
        found = [1.0 / patch.curvature for patch in body.patches if patch.curvature]
    return min(found, default=None)


_SAME = 1e-10  # of the size of the cut: corners of segments this close are one
_CLOSE = 1e-6  # the same of triangles, and the least height of one over its longest edge
_STRAIGHT = 1e-9


def polylines_of(facets: Array) -> list[Array]:
    """Join segments (f, 2, 2) to polylines, split where more than two of them meet.

    Corners on a straight line are left out. A closed line begins and ends in the same corner.
    """
    corners, number = _welded(facets, _SAME)
    ends = [(int(a), int(b)) for a, b in number]
    beside: dict[int, set[int]] = defaultdict(set)
    for a, b in ends:
        if a != b:
            beside[a].add(b)
            beside[b].add(a)
    unused = {frozenset((a, b)) for a, b in ends if a != b}
    starts = [node for node in beside if len(beside[node]) != 2] + list(beside)
    lines = []
    for start in starts:
        for step in sorted(beside[start]):
            if frozenset((start, step)) not in unused:
                continue
            line = [start, step]
            unused.discard(frozenset(line))
            while len(beside[line[-1]]) == 2 and line[-1] != start:
                onwards = next(iter(beside[line[-1]] - {line[-2]}))
                edge = frozenset((line[-1], onwards))
                if edge not in unused:
                    break
                unused.discard(edge)
                line.append(onwards)
            lines.append(_without_straight(corners[line]))
    return lines


def triangles_of(facets: Array) -> Array:
    """Select the triangles (f, 3, 3) that have an area, with corners side by side made one.

    A cut that passes within 1e-6 of its size of a node leaves slivers there, of which a scene
    makes no polygons; a conforming mesh has a node on such a cut anyway.
    """
    corners, number = _welded(facets, _CLOSE)
    triangles = corners[number]
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(triangles[heights(triangles) > _CLOSE * longest])


def _welded(facets: Array, tolerance: float) -> tuple[Array, NDArray[np.int64]]:
    """Merge corners within `tolerance` of the cut's size: corners (c, d), and numbers (f, k)."""
    points = facets.reshape(-1, facets.shape[-1])
    return welded(facets, tolerance * float(np.ptp(points, axis=0).max()) if len(points) else 0.0)


def _without_straight(line: Array) -> Array:
    step = np.diff(line, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    turn = np.abs(step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0])
    keep = np.concatenate([[True], turn > _STRAIGHT, [True]])
    return np.asarray(line[keep])
