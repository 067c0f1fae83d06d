"""Quadrature on cuts in space, graded to their fronts; each point has two sides."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import morton_order
from verify.compare.cut_line import AWAY, CutRule
from verify.compare.simplex_rule import points_in
from verify.compare.solid import SolidBody
from verify.compare.splitting import divide, measures, split_at_level
from verify.geometry.patches import Patch

Array = NDArray[np.float64]

# Where the border of the body is not straight in a patch's parameters, cells on it are halved
# down to this share of the spacing, and their points outside left out.
_BORDER = 1 / 16
_ORDER = 2  # of the rule in each triangle, see `simplex_rule`


def surface_rule(body: SolidBody, spacing: float, depth: float = 1 / 16) -> CutRule:
    """Quadrature on all cuts of a body in space, inside it.

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
        Exact areas for plane polygons in a box; else to the last cells on the body's surface.
    """
    found = []
    for patch in body.patches:
        cells, sizes = _cells(patch, body, spacing, depth)
        uv, weights = points_in(cells, _ORDER)
        away = np.repeat(np.maximum(1e-3 * sizes, AWAY * body.size), len(uv) // max(len(cells), 1))
        points = patch.point(uv)
        kept = body.inside(points)
        if body.box is None or not patch.plane:
            uv, weights, away, points = uv[kept], weights[kept], away[kept], points[kept]
        weights = weights * patch.stretch(uv)
        found.append(CutRule.beside(points, weights, patch.normal(uv), away))
    rule = CutRule.joined(found, 3)
    return rule.reordered(morton_order(rule.points)) if len(rule.points) else rule


def nearest_on_cut(body: SolidBody, cut: str, point: Array) -> CutRule:
    """Take the point of a cut that is nearest to `point` (3,), as a rule of weight 1."""
    best: CutRule | None = None
    smallest = np.inf
    for patch in body.cuts[cut]:
        foot, _ = patch.nearest(point[None])
        if (distance := float(np.linalg.norm(foot[0] - point))) < smallest:
            smallest = distance
            step = 1e-3 * body.size  # the level's slope is the normal, also on a cylinder
            ends = [patch.level(foot + s * step * np.eye(3)) for s in (1.0, -1.0)]
            normal = (ends[0] - ends[1])[None]
            normal /= np.linalg.norm(normal)
            best = CutRule.beside(foot, np.ones(1), normal, AWAY * body.size)
    assert best is not None
    return best


def _cells(patch: Patch, body: SolidBody, spacing: float, depth: float) -> tuple[Array, Array]:
    """Triangles (m, 3, 2) of a patch's parameters inside the body, and their sizes (m,) in m."""

    def in_space(cells: Array) -> Array:
        return patch.point(cells.reshape(-1, 2)).reshape(-1, 3, 3)

    def size(cells: Array) -> Array:
        corners = in_space(cells)
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        return np.asarray(sides.max(axis=1))

    cells = patch.cells
    if body.box is not None and patch.plane:
        for axis, end, sign in _faces(body.box):
            face = _depth_below(patch, axis, end, sign)
            cells, side = split_at_level(cells, face)
            cells = cells[side > 0]
    if body.box is not None and patch.plane:
        cells = cells[measures(cells) > 0.0]
        border = np.inf
    else:
        border = _BORDER * spacing

    def wanted(some: Array, _: Array) -> NDArray[np.bool_]:
        sizes = size(some)
        target = np.full(len(some), spacing)
        if len(body.front):
            away = body.tip_distance(patch.point(some.mean(axis=1)))
            target = np.clip(away, depth * spacing, spacing)
        too_large = sizes > target
        if border < np.inf:
            within = body.inside(in_space(some).reshape(-1, 3)).reshape(-1, 3)
            too_large |= (within.any(axis=1) & ~within.all(axis=1)) & (sizes > border)
        return np.asarray(too_large)

    cells = divide(cells, wanted)
    return cells, size(cells)


def _faces(box: Array) -> list[tuple[int, float, float]]:
    """Axis, place and direction inwards of the six faces of a box (2, 3)."""
    return [(a, float(box[k, a]), s) for k, s in ((0, 1.0), (1, -1.0)) for a in range(3)]


def _depth_below(patch: Patch, axis: int, end: float, sign: float) -> Callable[[Array], Array]:
    """Distance from a face of a box, positive inside, as a function of a patch's parameters."""
    return lambda uv: sign * (patch.point(uv)[:, axis] - end)
