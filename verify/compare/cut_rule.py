"""Quadrature on cuts as asked, graded to their ends and fronts; each point has two sides."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import partial
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body
from verify.compare.body_rule import FAMILY, graded_breaks
from verify.compare.cell_tree import morton_order
from verify.compare.sides import distance_to_cut, distance_to_segments, nearest_segments
from verify.compare.simplex_bodies import MembraneBody, SolidBody, SurfaceLines
from verify.compare.simplices import divide, points_in, split_at_level
from verify.geometry.patches import Patch, PlanePatch
from verify.geometry.simplices import bounds_of, measures, unit_rule

Array = NDArray[np.float64]


# Distance of `near` from the cut over the body's size. The direction to it is good to
# round-off over this, 1e-10: enough to tell the two sides of a sliver of 1e-9.
AWAY = 1e-6
_ORDER = 3  # Gauss points per cell
_DEPTH = 1e-4  # size of the cells at ends, relative to the spacing


@dataclass(frozen=True)
class CutRule:
    """Points on the cuts as asked.

    Parameters
    ----------
    points : (n, d) array
    weights : (n,) array
        Lengths (2D) or areas (3D) that the points stand for.
    normals : (n, d) array
        Unit normals into the positive side.
    positive, negative : (n, d) array
        Points close by on either side: `near` for a field.
    """

    points: Array
    weights: Array
    normals: Array
    positive: Array
    negative: Array

    @classmethod
    def beside(cls, points: Array, weights: Array, normals: Array, away: Array | float) -> Self:
        """Make a rule with its sides at distances `away` (n,) along the normals, m."""
        shift = np.multiply(np.reshape(away, (-1, 1)), normals)
        return cls(points, weights, normals, points + shift, points - shift)

    @classmethod
    def joined(cls, rules: Sequence[Self], dimension: int) -> Self:
        """Join rules in space or in the plane, or none at all."""
        empty = np.zeros((0, dimension))
        none = cls(empty, np.zeros(0), empty, empty, empty)
        columns = ([getattr(r, f.name) for r in (none, *rules)] for f in fields(cls))
        return cls(*map(np.concatenate, columns))

    def reordered(self, order: NDArray[np.int64]) -> Self:
        """Return the same points in another order."""
        return type(self)(*(getattr(self, f.name)[order] for f in fields(self)))


def cut_rule(body: Body, spacing: float) -> CutRule:
    """Make a quadrature along all cuts of a body, inside it.

    Parameters
    ----------
    body : Body
    spacing : float
        Largest distance that one Gauss rule covers, m.
    """
    found = []
    for part in body.parts:
        ends = np.array([part.start, part.end])
        singular, tight = np.stack([body.singular] * 2, axis=1), 1e-12 * body.size
        at_end = distance_to_segments(part.piece.point(ends), singular, tight) <= tight
        t, weights, away = along_cut(ends, part.piece.length, at_end, body.size, spacing)
        points = part.piece.point(t)
        found.append(CutRule.beside(points, weights, part.piece.facing(points), away))
    return CutRule.joined(found, 2)


def along_cut(
    ends: Array, length: float, special: NDArray[np.bool_], size: float, spacing: float,
) -> tuple[Array, Array, Array]:  # fmt: skip
    """Make points of a quadrature along a piece of a cut, graded to its special ends.

    Parameters
    ----------
    ends : (2,) array
        Parameters at which the piece starts and ends.
    length : float
        For a parameter that runs from 0 to 1, m.
    special : (2,) bool array
    size : float
        Of the body, m.
    spacing : float
        See `cut_rule`.

    Returns
    -------
    parameters, weights, away : (n,) arrays
        The last is how far from the cut a point beside it shall be, m.
    """
    x, w = unit_rule(_ORDER)
    stops = ends * length
    breaks = graded_breaks(stops, stops[special], spacing, _DEPTH * spacing) / length
    step = np.diff(breaks)
    t = (breaks[:-1, None] + step[:, None] * x).ravel()
    weights = (step[:, None] * length * w).ravel()
    return t, weights, np.repeat(np.maximum(1e-3 * step * length, AWAY * size), _ORDER)


def place_on_cut(body: Body, cut: str, fraction: float) -> CutRule:
    """Take the single point at a fraction of the length of a cut, as a rule of weight 1."""
    pieces = body.cuts[cut]
    lengths = np.array([piece.length for piece in pieces])
    starts = np.concatenate([[0.0], np.cumsum(lengths)])
    where = fraction * starts[-1]
    index = min(int(np.searchsorted(starts[1:], where)), len(pieces) - 1)
    t = np.array([np.clip((where - starts[index]) / lengths[index], 0.0, 1.0)])
    point = pieces[index].point(t)
    return CutRule.beside(point, np.ones(1), pieces[index].facing(point), AWAY * body.size)


_WHOLE = np.array([0.0, 1.0])


def membrane_cut_rule(body: MembraneBody, spacing: float) -> CutRule:
    """Make a quadrature along all cuts of a membrane; as `cut_rule`.

    Parameters
    ----------
    body : MembraneBody
    spacing : float
        Largest distance that one Gauss rule covers, m.
    """
    found = []
    for lines in body.lines.values():
        from_tip = body.tip_distance(lines.ends.reshape(-1, 3), tight := 1e-9 * body.size)
        at_tip = from_tip.reshape(-1, 2) <= tight
        for k, (ends, length) in enumerate(zip(lines.ends, lines.lengths, strict=True)):
            t, weights, away = along_cut(_WHOLE, length, at_tip[k], body.size, spacing)
            points = ends[0] + t[:, None] * (ends[1] - ends[0])
            found.append(_beside(lines, np.full(len(t), k), points, weights, away[:, None]))
    return CutRule.joined(found, 3)


def nearest_on_membrane_cut(body: MembraneBody, cut: str, point: Array) -> CutRule:
    """Take the point of a cut that is nearest to `point` (3,), as a rule of weight 1."""
    lines = body.lines[cut]
    _, foot, which = nearest_segments(point[None], lines.ends)
    return _beside(lines, which, foot, np.ones(1), AWAY * body.size)


def _beside(
    lines: SurfaceLines, which: NDArray[np.int64], points: Array, weights: Array,
    away: Array | float,
) -> CutRule:  # fmt: skip
    """Make a rule on lines `which` (n,): beside an edge of a fold the sides are not opposite."""
    positive, negative = (points + away * ways[which] for ways in (lines.positive, lines.negative))
    return CutRule(points, weights, lines.normals[which], positive, negative)


# Where the border of the body is not straight in a patch's parameters, cells on it are halved
# down to this share of the spacing, and their points outside left out.
_BORDER = 1 / 16
_THIN = 1e-12  # of the body: points as close to a plane are on it
_SURFACE_ORDER = 2  # of the rule in each triangle, see `simplex_rule`


def surface_rule(body: SolidBody, spacing: float, depth: float = 1 / 16) -> CutRule:
    """Make a quadrature on all cuts of a body in space, inside it.

    Parameters
    ----------
    body : SolidBody
    spacing : float
        Size of the cells, m.
    depth : float
        Size of the cells at fronts, relative to the spacing.

    Returns
    -------
    CutRule
        Exact areas for plane polygons; else to the last cells on the body's surface.
    """
    found = []
    for patch in body.patches:
        cells, sizes = _cells(patch, body, spacing, depth)
        uv, weights = points_in(cells, _SURFACE_ORDER)
        away = np.repeat(np.maximum(1e-3 * sizes, AWAY * body.size), len(uv) // max(len(cells), 1))
        points = patch.point(uv)
        if not patch.plane:
            kept = body.inside(points)
            uv, weights, away, points = uv[kept], weights[kept], away[kept], points[kept]
        weights = weights * patch.stretch(uv)
        found.append(CutRule.beside(points, weights, patch.normal(uv), away))
    rule = CutRule.joined(found, 3)
    return rule.reordered(morton_order(rule.points)) if len(rule.points) else rule


def cut_rule_of(body: AnyBody, size: float, k: int = 0) -> CutRule:
    """Make the rule `k` on the cuts for fields on elements of size `size` m; the finest is 0."""
    factor = FAMILY[k]
    if isinstance(body, Body):
        return cut_rule(body, factor * size / 8)
    if isinstance(body, MembraneBody):
        return membrane_cut_rule(body, factor * size / 8)
    return surface_rule(body, factor * size / 3)


def nearest_on_cut(body: SolidBody, cut: str, point: Array) -> CutRule:
    """Take the point of a cut that is nearest to `point` (3,), as a rule of weight 1."""
    _, foot, which = distance_to_cut(body.cuts[cut], point[None])
    normal = body.cuts[cut][which[0]].facing(foot)
    return CutRule.beside(foot, np.ones(1), normal, AWAY * body.size)


def _cells(patch: Patch, body: SolidBody, spacing: float, depth: float) -> tuple[Array, Array]:
    """Divide a patch's parameters inside the body: triangles (m, 3, 2), and sizes (m,) in m."""

    def in_space(cells: Array) -> Array:
        return patch.point(cells.reshape(-1, 2)).reshape(-1, 3, 3)

    def size(cells: Array) -> Array:
        corners = in_space(cells)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(sides.max(axis=1))

    cells, border = patch.cells, np.inf if patch.plane else _BORDER * spacing
    if body.box is not None and patch.plane:
        for end, axis in product((0, 1), range(3)):
            face = partial(_depth, patch, axis, float(body.box[end, axis]), 1 - 2 * end)
            cells, side = split_at_level(cells, face)
            cells = cells[side > 0]
    elif isinstance(patch, PlanePatch):
        cells = _sections(patch, body)
    if patch.plane:
        cells = cells[measures(cells) > 0.0]

    lower, upper = body.corners.min(axis=(0, 1)), body.corners.max(axis=(0, 1))

    def meets_body(some: Array, sizes: Array) -> NDArray[np.bool_]:
        """Tell whether cells may hold a part of the body: by boxes, wider where a patch bulges."""
        margin = np.full(len(some), AWAY * body.size)
        if patch.curvature:  # a chord of a radius at most has its arc within itself
            margin += np.where(sizes * patch.curvature <= 1.0, sizes, np.inf)
        corners = in_space(some)
        low, high = bounds_of(corners)
        low, high = low - margin[:, None], high + margin[:, None]
        return np.asarray(((low <= upper) & (high >= lower)).all(axis=1))

    def wanted(some: Array, _: Array) -> NDArray[np.bool_]:
        sizes = size(some)
        target = np.full(len(some), spacing)
        if len(body.front):
            away = body.tip_distance(patch.point(some.mean(axis=1)), spacing)
            target = np.clip(away, depth * spacing, spacing)
        too_large = sizes > target
        if border < np.inf:
            within = body.inside(in_space(some).reshape(-1, 3)).reshape(-1, 3)
            too_large |= (within.any(axis=1) & ~within.all(axis=1)) & (sizes > border)
            too_large &= meets_body(some, sizes)
        return np.asarray(too_large)

    cells = divide(cells, wanted)
    return cells, size(cells)


def _sections(patch: PlanePatch, body: SolidBody) -> Array:
    """Divide a plane patch's parameters: one or two triangles (m, 3, 2) per tetrahedron on it."""
    thin = _THIN * body.size
    levels = patch.level(body.corners.reshape(-1, 3)).reshape(-1, 4)
    crossed = body.corners[(levels.max(axis=1) > thin) & (levels.min(axis=1) <= thin)]
    halves, side = split_at_level(crossed, patch.level)
    halves = halves[side > 0]
    levels = patch.level(halves.reshape(-1, 3)).reshape(-1, 4)
    order = np.argsort(levels, axis=1)
    on = (np.sort(levels, axis=1)[:, :3] <= thin).all(axis=1) & (levels.max(axis=1) > thin)
    faces = np.take_along_axis(halves[on], order[on, :3, None], axis=1)
    flat = (faces - patch.origin) @ patch.axes[:2].T
    found = [flat[:0]]
    for triangle in patch.cells:
        beside = (flat.max(axis=1) < triangle.min(axis=0)) | (
            flat.min(axis=1) > triangle.max(axis=0)
        )
        inner = flat[~beside.any(axis=1)]
        turn = np.sign(np.linalg.det(triangle[1:] - triangle[0]))
        for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
            inward = turn * np.array([a[1] - b[1], b[0] - a[0]])
            inner, inside = split_at_level(inner, partial(_height, a, inward))
            inner = inner[inside > 0]
        found.append(inner)
    return np.concatenate(found)


def _height(corner: Array, inward: Array, places: Array) -> Array:
    """Return heights (n,) of places (n, 2) over an edge at a corner, positive inwards."""
    return np.asarray((places - corner) @ inward)


def _depth(patch: Patch, axis: int, face: float, inward: int, uv: Array) -> Array:
    """Return distances (n,) from a face of a box, positive inwards, by a patch's parameters."""
    return np.asarray(inward * (patch.point(uv)[:, axis] - face))
