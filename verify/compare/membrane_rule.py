"""Quadrature of a cut membrane: on neutral triangles of its surface, and along its cuts."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import build_cell_tree, morton_order
from verify.compare.cut_line import AWAY, CutRule
from verify.compare.membrane_body import MembraneBody
from verify.compare.membrane_cuts import nearest_on_lines
from verify.compare.membrane_kernels import nearest_triangles
from verify.compare.simplex_rule import points_in
from verify.compare.simplices import simplices, triangle_frames
from verify.compare.slabs import Rule, graded_breaks
from verify.compare.volume_rule import volume_cells

__all__ = ["membrane_cut_rule", "membrane_rule", "nearest_on_membrane_cut"]

Array = NDArray[np.float64]


def membrane_rule(
    body: MembraneBody, spacing: float, seed: int = 0, order: int = 2, depth: float = 0.05,
    grading: float = 1.0,
) -> Rule:  # fmt: skip
    """Quadrature of a membrane; as `volume_rule`, with triangles.

    Parameters
    ----------
    body : MembraneBody
    spacing : float
        Size of the cells, m.
    seed : int
        Of the random points at which the triangles of the body are divided.
    order : int
        Of the rule in each triangle, see `simplex_rule`.
    depth : float
        Size of the cells at tips, relative to the spacing.
    grading : float
        Size of the cells near tips, relative to their distance from them.

    Returns
    -------
    Rule
        With frames; exact areas of the body and of each of its parts.
    """
    points, weights = points_in(volume_cells(body, spacing, seed, depth, grading), order)
    kept = np.flatnonzero(weights > 0.0)
    kept = kept[morton_order(points[kept])]
    points = np.ascontiguousarray(points[kept])
    frames = triangle_frames(body.corners)[_triangles_at(body, points)]
    return Rule(points, weights[kept], frames)


def membrane_cut_rule(
    body: MembraneBody, spacing: float, order: int = 3, depth: float = 1e-4
) -> CutRule:
    """Quadrature along all cuts of a membrane, graded to their tips; as `cut_rule`.

    Parameters
    ----------
    body : MembraneBody
    spacing : float
        Largest distance that one Gauss rule covers, m.
    order : int
        Gauss points per cell.
    depth : float
        Size of the cells at tips, relative to `spacing`.
    """
    x, w = np.polynomial.legendre.leggauss(order)
    rows = []
    for lines in body.cuts.values():
        at_tip = body.tip_distance(lines.ends.reshape(-1, 3)).reshape(-1, 2) <= 1e-9 * body.size
        for k, (ends, length) in enumerate(zip(lines.ends, lines.lengths, strict=True)):
            stops = np.array([0.0, length])
            breaks = graded_breaks(stops, stops[at_tip[k]], spacing, depth * spacing) / length
            step = np.diff(breaks)
            t = (breaks[:-1, None] + step[:, None] * 0.5 * (x + 1)).ravel()
            points = ends[0] + t[:, None] * (ends[1] - ends[0])
            weights = (step[:, None] * length * 0.5 * w).ravel()
            away = np.repeat(np.maximum(1e-3 * step * length, AWAY * body.size), order)[:, None]
            rows.append(
                (
                    points, weights, np.tile(lines.normals[k], (len(t), 1)),
                    points + away * lines.positive[k], points + away * lines.negative[k],
                )
            )  # fmt: skip
    if not rows:
        return CutRule(*(np.zeros(shape) for shape in ((0, 3), (0,), (0, 3), (0, 3), (0, 3))))
    return CutRule(*(np.concatenate(column) for column in zip(*rows, strict=True)))


def nearest_on_membrane_cut(body: MembraneBody, cut: str, point: Array) -> CutRule:
    """Take the point of a cut that is nearest to `point` (3,), as a rule of weight 1."""
    lines = body.cuts[cut]
    foot, which = nearest_on_lines(point[None], lines.ends)
    away = AWAY * body.size
    return CutRule(
        foot, np.ones(1), lines.normals[which], foot + away * lines.positive[which],
        foot + away * lines.negative[which],
    )  # fmt: skip


def _triangles_at(body: MembraneBody, points: Array) -> NDArray[np.int64]:
    """Triangle (n,) of the body that each of `points` (n, 3) on it lies in."""
    corners = np.ascontiguousarray(body.corners)
    shape = simplices(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    tree = build_cell_tree(corners.min(axis=1), corners.max(axis=1), surface=True)
    no_sides = [np.zeros((n, 0), dtype=np.int8) for n in (len(points), len(corners))]
    found: NDArray[np.int64] = nearest_triangles(
        points, np.zeros((0, 3)), no_sides[0], tree.lower, tree.upper, tree.cells, corners,
        shape.normals, np.ascontiguousarray(triangle_frames(corners)[:, 2]),
        corners.mean(axis=1), no_sides[1], 1e-10 * body.size,
    )[0]  # fmt: skip
    return found
