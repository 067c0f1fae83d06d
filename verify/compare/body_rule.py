"""Quadrature of a cut body, split by the cuts and graded to their ends.

In the plane it is exact: thin parallel slabs have their borders through every corner, every end and
every crossing. Inside a slab no two curves cross, so they are ordered from left to right. The
strips between them are trapezoids with (perhaps curved) sides. Nothing is clipped, no sliver is
special: a strip of width 1e-12 is a trapezoid of width 1e-12. The slabs are turned away from the
axes and diagonals: their points do not fall in step with the lines of a structured mesh. They are
turned away from the cuts, too, so that strips are not sheared.

In space neutral simplices are split by the cuts. A box is divided by a grid of its own, whose
planes are shifted at random (with a fixed seed); the simplices of a mesh file are divided at random
points. Plane cuts split them exactly; a cylinder splits them along its linear interpolant in
tetrahedra so small that the sagitta is a thirtieth of the spacing. The side of a point is then up
to the evaluated field; the rest is in the integration error.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import factorial

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body
from verify.compare.cell_tree import morton_order
from verify.compare.locate import Field, squares
from verify.compare.simplex_bodies import SimplexBody
from verify.compare.simplices import (
    KUHN,
    bisect,
    heights,
    in_frames,
    kept_with,
    points_in,
    split_at_level,
)
from verify.compiled import njit
from verify.geometry.curves import Arc, Piece, Segment
from verify.geometry.patches import Patch
from verify.geometry.simplices import bounds_of, measures, unit_rule

Array = NDArray[np.float64]


# Of the body's size: a piece of the body that is thinner has no place that is surely inside.
ROUND_OFF = 1e-13


@dataclass(frozen=True)
class Rule:
    """A quadrature rule of a body.

    Parameters
    ----------
    points : (n, d) array
        Inside, on no cut.
    weights : (n,) array
    frames : (n, 3, 3) array, optional
        Of a membrane: two tangents and the normal at each point, as rows.
    """

    points: Array
    weights: Array
    frames: Array | None = None

    @cached_property
    def extent(self) -> float:
        """Largest distance of two of the points along an axis, m."""
        return max(float(np.ptp(column)) for column in self.points.T)

    def gradient(self, field: Field) -> Array:
        """Evaluate the gradient (n, d, d) of a field; of a membrane (n, 3, 2), see `in_frames`."""
        gradient = field.gradient(self.points, self.points)
        return gradient if self.frames is None else in_frames(gradient, self.frames)


def area_rule(
    body: Body,
    spacing: float,
    angle: float = 0.5535,
    order: int = 2,
    depth: float = 1e-2,
    grading: float = 1.0,
) -> Rule:
    """Make a quadrature of a body, split by its cuts and graded to its singular points.

    Parameters
    ----------
    body : Body
    spacing : float
        Size of the cells, m.
    angle : float
        Direction of the slabs, rad.
    order : int
        Gauss points per cell and direction.
    depth : float
        Size of the cells at singular points, relative to `spacing`.
    grading : float
        Size of the cells around tips, relative to their distance from them; 1 around other
        singular points.

    Returns
    -------
    Rule
        Exact areas of the body and, for straight cuts, of each of its parts.
    """
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    pieces = [(piece.rotated(turn), True) for piece in body.edges]
    pieces += [
        (_part(part.piece, part.start, part.end).rotated(turn), False) for part in body.parts
    ]
    rows = np.array([row for piece, outline in pieces for row in _monotone(piece, outline)])
    singular, tips = body.singular @ turn.T, body.tips @ turn.T
    ends, (middle, radius) = rows[:, :2], rows[:, 5:7].T[..., None]
    with np.errstate(divide="ignore", invalid="ignore"):
        reached = np.where(rows[:, 3:4] > 0.0, (ends - middle) / radius, 0.0)
    poles = (middle + radius * np.sign(reached))[np.abs(reached) >= 0.95]
    ys = graded_breaks(ends.ravel(), singular[:, 1], spacing, depth * spacing)
    ys = graded_breaks(ys, tips[:, 1], spacing, depth * spacing, grading)
    if len(poles):  # x(y) is like a square root at a pole of an arc, or close beyond it
        ys = graded_breaks(ys, poles, spacing, 1e-4 * spacing)
    corners = body.corners @ turn.T
    span = np.array([corners[:, 0].min(), corners[:, 0].max()])
    xs = graded_breaks(span, singular[:, 0], spacing, depth * spacing)
    xs = graded_breaks(xs, tips[:, 0], spacing, depth * spacing, grading)
    strips = _strips(rows, ys, xs, ROUND_OFF * body.size)
    points, weights = _in_strips(rows, ys, xs, strips, *unit_rule(order), *unit_rule(max(order, 6)))
    return Rule(points @ turn, weights)


@kept_with
def slab_angles(body: Body) -> tuple[float, float, float]:
    """Choose three slab directions, rad in [0, π), the best first.

    Each is at the largest possible angle to the cuts and to the lines of structured meshes, and at
    least 10° from the two others.
    """
    straight = [part.piece for part in body.parts if isinstance(part.piece, Segment)]
    edges = np.array([piece.end - piece.start for piece in straight]).reshape(-1, 2)
    avoided = np.concatenate([np.arange(4) * np.pi / 4, np.arctan2(edges[:, 1], edges[:, 0])])
    # 0.0123: no candidate has a simple tangent
    candidates = np.arange(0.0123, np.pi, np.pi / 180)
    apart = np.abs(np.sin(candidates[:, None] - avoided)).min(axis=1)
    chosen: list[float] = []
    for angle in candidates[np.argsort(-apart, kind="stable")]:
        if all(abs(np.sin(angle - other)) > np.sin(np.deg2rad(10)) for other in chosen):
            chosen.append(float(angle))
    return chosen[0], chosen[1], chosen[2]


def graded_breaks(
    breaks: Array, singular: Array, spacing: float, smallest: float, grading: float = 1.0
) -> Array:
    """Sort break points, with gaps of at most `spacing` that halve towards `singular` points.

    A gap is at most `grading` times as long as its distance to the nearest singular point, or
    `smallest`.
    """
    # equal up to round-off is equal: a singular point must be a break to the last bit, or the
    # gaps beside it are not refined; and a gap of one bit would hold a point on the tip itself
    within = (singular >= breaks.min()) & (singular <= breaks.max())
    base = np.unique(np.concatenate([breaks, singular[within]]))
    same = 16 * np.finfo(float).eps * np.abs(base).max()
    base = base[np.concatenate([[True], np.diff(base) > same])]
    if len(singular):
        nearest = base[np.abs(singular[:, None] - base).argmin(axis=1)]
        singular = np.where(np.abs(singular - nearest) <= 4 * same, nearest, singular)
    count = np.ceil(np.diff(base) / spacing).astype(np.int64)
    last = np.cumsum(count)
    step, start = np.repeat(np.diff(base) / count, count), np.repeat(base[:-1], count)
    low = start + (np.arange(last[-1]) - np.repeat(last - count, count)) * step
    open_cells, done = np.column_stack([low, np.append(low[1:], base[-1])]), [base]
    while len(open_cells):
        done.append(open_cells.ravel())
        if not len(singular):
            break
        low, high = open_cells.T
        away = np.maximum(low - singular[:, None], singular[:, None] - high).min(axis=0)
        split = high - low > np.maximum(grading * away, smallest) * (1 + 1e-9)
        low, high = open_cells[split].T
        middle = 0.5 * (low + high)
        open_cells = np.vstack([np.column_stack([low, middle]), np.column_stack([middle, high])])
    return np.unique(np.concatenate(done))


def _part(piece: Piece, start: float, end: float) -> Piece:
    if isinstance(piece, Segment):
        a, b = piece.point(np.array([start, end]))
        return Segment(a, b)
    angle = piece.start_angle + start * piece.sweep
    return Arc(piece.centre, piece.radius, angle, (end - start) * piece.sweep)


def _monotone(piece: Piece, outline: bool) -> list[list[float]]:
    """Divide a piece into curves with x as a function of y, as kernels take them.

    A row has the lowest and the highest y, and whether it is of the outline. A segment has 0 and
    its ends, an arc 1, its centre, its radius, and 1 on the right, −1 on the left.
    """
    if isinstance(piece, Segment):
        low, high = sorted((float(piece.start[1]), float(piece.end[1])))
        row = [low, high, float(outline), 0.0, *piece.start, *piece.end]
        return [row] if high > low else []
    # split at the poles, at odd multiples of a quarter turn
    first = np.ceil((piece.start_angle - np.pi / 2) / np.pi)
    stop = piece.start_angle + piece.sweep
    angles = [piece.start_angle]
    while (pole := np.pi / 2 + first * np.pi) < stop:
        if pole > piece.start_angle:
            angles.append(pole)
        first += 1
    angles.append(stop)
    found = []
    for a, b in pairwise(angles):
        ys = sorted(piece.centre[1] + piece.radius * np.sin([a, b]))
        bulge = 1.0 if np.cos(0.5 * (a + b)) > 0 else -1.0
        if ys[1] > ys[0]:
            found.append([*ys, float(outline), 1.0, *piece.centre, piece.radius, bulge])
    return found


@njit(cache=True)
def _x(curve, y):
    a, b, c, d = curve[4:]
    if curve[3] == 0.0:
        t = (y - b) / (d - b)
        return (1 - t) * a + t * c
    height = (y - b) / c
    return a + d * c * np.sqrt(max((1 - height) * (1 + height), 0.0))


@njit(inline="always")
def _below(values, x, or_equal):
    """Count the sorted values below one; `np.searchsorted` takes much longer to compile."""
    low, high = 0, len(values)
    while low < high:
        middle = (low + high) // 2
        if values[middle] < x or (or_equal and values[middle] == x):
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _strips(curves, ys, columns, thinnest):
    """Give the strips of the body between two curves in slabs, one a row.

    A row has the slab, the curves on the left and on the right, and the first and the last of the
    columns between. A strip thinner than `thinnest`, in m, is round-off: its points would be on
    the cut.
    """
    found, filled = np.empty((len(ys), 5), dtype=np.int64), 0
    here = np.empty(len(curves), dtype=np.int64)
    at = np.empty(len(curves))
    for slab in range(len(ys) - 1):
        middle, count = 0.5 * (ys[slab] + ys[slab + 1]), 0
        for c in range(len(curves)):
            if curves[c, 0] < middle < curves[c, 1]:
                x, k = _x(curves[c], middle), count
                while k > 0 and at[k - 1] > x:
                    at[k], here[k] = at[k - 1], here[k - 1]
                    k -= 1
                at[k], here[k] = x, c
                count += 1
        inside = False
        for k in range(count - 1):
            inside ^= curves[here[k], 2] != 0.0
            if inside and at[k + 1] - at[k] > thinnest:
                first = _below(columns, at[k] + thinnest, True)
                last = max(first, _below(columns, at[k + 1] - thinnest, False))
                if filled == len(found):
                    found = np.concatenate((found, np.empty_like(found)))
                found[filled] = slab, here[k], here[k + 1], first, last
                filled += 1
    return found[:filled]


@njit(cache=True)
def _in_strips(curves, ys, columns, strips, u, wu, v, wv):
    """Make points (n, 2) and weights (n,) of strips, with more points (v) of curved ones."""
    count = 0
    for _, left, right, first, last in strips:
        curved = curves[left, 3] + curves[right, 3] > 0.0
        count += (len(v) if curved else len(u)) * (last - first + 1) * len(u)
    points, weights, n = np.empty((count, 2)), np.empty(count), 0
    for slab, left, right, first, last in strips:
        curved = curves[left, 3] + curves[right, 3] > 0.0
        heights, shares = (v, wv) if curved else (u, wu)
        low, high = ys[slab], ys[slab + 1]
        middle = 0.5 * (low + high)
        m0, m1 = _x(curves[left], middle), _x(curves[right], middle)
        breaks = np.zeros((last - first + 2, 1))
        breaks[1:-1, 0], breaks[-1] = (columns[first:last] - m0) / (m1 - m0), 1.0
        steps = breaks[1:] - breaks[:-1]
        across, parts = (breaks[:-1] + steps * u).ravel(), (steps * wu).ravel()
        for i in range(len(heights)):
            y, end = low + (high - low) * heights[i], n + len(across)
            x0 = _x(curves[left], y)
            width = _x(curves[right], y) - x0
            points[n:end, 0], points[n:end, 1] = x0 + width * across, y
            weights[n:end] = (high - low) * shares[i] * width * parts
            n = end
    return points, weights


# Kuhn's tetrahedra keep their orientation as long as no node moves by a sixth of the spacing.
_SHAKE = 0.15
_DIAGONAL = 3**0.5


def body_rule(
    body: SimplexBody, spacing: float, seed: int = 0, order: int = 2, depth: float = 0.25,
    grading: float = 1.0,
) -> Rule:  # fmt: skip
    """Make a quadrature of a solid or of a membrane.

    Parameters
    ----------
    body : SimplexBody
    spacing : float
        Size of the cells, m.
    seed : int
        Of the random shifts.
    order : int
        Of the rule in each simplex, see `simplex_rule`.
    depth : float
        Size of the cells at fronts, relative to the spacing.
    grading : float
        Size of the cells near fronts, relative to their distance from them.

    Returns
    -------
    Rule
        Exact measures of the body and, for plane cuts, of each of its parts; of a membrane with
        frames.
    """
    cells = _cells(body, spacing, seed, depth, grading)
    # the points of a piece that is round-off would be on the cut
    points, weights = points_in(cells[_thick(cells, ROUND_OFF * body.size)], order)
    kept = morton_order(points)
    points = np.ascontiguousarray(points[kept])
    return Rule(points, weights[kept], body.frames_at(points))


def _thick(cells: Array, least: float) -> NDArray[np.bool_]:
    """Tell whether simplices (m, k + 1, d) are higher than `least`, m."""
    k = cells.shape[1] - 1
    low, high = bounds_of(cells)
    reach = np.sqrt(squares(high - low))  # of any face: no more than its power k − 1
    thick = k * measures(cells) > least * reach ** (k - 1)
    thin = np.flatnonzero(~thick)
    thick[thin] = heights(cells[thin]) > least
    return np.asarray(thick)


def _cells(body: SimplexBody, spacing: float, seed: int, depth: float, grading: float) -> Array:
    """Make the simplices (m, k + 1, 3) of the quadrature."""
    random = np.random.default_rng(seed)
    if body.box is not None:
        cells = _shaken_grid(body.box, spacing, random)
    else:
        cells = _divided(body.corners, random)
        # grid cells have diagonals of √3 spacings; elements of a file are as small as they are
        cells = bisect(cells, lambda c: np.full(len(c), _DIAGONAL * spacing))
    if len(body.front):

        def near_front(c: Array) -> Array:
            away = body.tip_distance(c.mean(axis=1), spacing / grading)
            return _DIAGONAL * np.clip(grading * away, depth * spacing, spacing)

        cells = bisect(cells, near_front)
    for patch in body.patches:
        cells = _split(cells, patch, spacing)
    return cells


def _split(cells: Array, patch: Patch, spacing: float) -> Array:
    """Divide the cells that a patch may pass through."""
    lower, upper = patch.bounds()
    margin = 1e-9 * float(np.linalg.norm(upper - lower))

    def reached(c: Array) -> NDArray[np.bool_]:
        low, high = bounds_of(c)
        return np.asarray(((low <= upper + margin) & (high >= lower - margin)).all(axis=1))

    here = reached(cells)
    rest, cells = cells[~here], cells[here]
    if patch.curvature:
        limit = (8 / 30 * spacing / patch.curvature) ** 0.5  # sagitta: limit² · curvature / 8

        def fine(c: Array) -> Array:
            low, high = bounds_of(c)
            longest = np.linalg.norm(high - low, axis=1)
            met = np.abs(patch.level(c.mean(axis=1))) < longest
            return np.where(met & reached(c), limit, np.inf)

        cells = bisect(cells, fine)
    return np.concatenate([rest, split_at_level(cells, patch.level)[0]])


def _shaken_grid(box: Array, spacing: float, random: np.random.Generator) -> Array:
    """Make Kuhn tetrahedra (m, 4, 3) of a grid on a box whose inner nodes are moved."""
    shape = np.maximum(1, np.ceil((box[1] - box[0]) / spacing).astype(int))
    nodes = np.stack(np.meshgrid(*(np.arange(n + 1.0) for n in shape), indexing="ij"), axis=-1)
    shift = random.uniform(-_SHAKE, _SHAKE, nodes.shape)
    for axis, n in enumerate(shape):  # nodes on a face stay on it
        shift[(nodes[..., axis] == 0) | (nodes[..., axis] == n), axis] = 0.0
    grid = np.meshgrid(*(np.arange(n) for n in shape), indexing="ij")
    first = np.stack([i.ravel() for i in grid], axis=1)
    points = box[0] + (nodes + shift) / shape * (box[1] - box[0])
    at = np.moveaxis(KUHN.astype(int)[:, None] + first[:, None], 3, 0)
    return points[tuple(at)].reshape(-1, 4, 3)


def _divided(corners: Array, random: np.random.Generator) -> Array:
    """Divide each of (m, k, 3) simplices at a random point inside: (k m, k, 3)."""
    count = corners.shape[1]
    weight = random.dirichlet(np.full(count, 8.0), len(corners))
    inner = np.einsum("mk,mka->ma", weight, corners)
    parts = np.tile(corners, (count, 1, 1, 1))
    parts[range(count), :, range(count)] = inner
    return parts.reshape(-1, *corners.shape[1:])


# spacings over the wanted one, without small common multiples
FAMILY = (1.0, 1.31, 1.73)
# The few elements at a tip hold most of the error; finer cells around it make the integration
# error of the energy norm there three to ten times smaller for twice the points.
_GRADING = 0.3
_MOST = 150_000  # cells in space before grading: bounds memory and time


def rule_of(body: AnyBody, size: float, k: int) -> Rule:
    """Make the rule `k` of a body for fields on elements of size `size` m; the finest is 0."""
    factor = FAMILY[k]
    if isinstance(body, Body):
        return area_rule(body, factor * size / 3, slab_angles(body)[k], grading=_GRADING)
    d = body.cell_dimension
    spacing = max(size / 3, (factorial(d) * body.measure / _MOST) ** (1 / d))
    # a front takes many more cells than a tip
    depth, grading = (0.05, _GRADING) if d == 2 else (0.25, 1.0)
    return body_rule(body, factor * spacing, k, depth=depth, grading=grading)


def rules(body: AnyBody, size: float, count: int = 3) -> list[Rule]:
    """Compute rules of a body for fields on elements of size `size` m, the finest first."""
    return [rule_of(body, size, k) for k in range(count)]
