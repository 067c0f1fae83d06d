"""Quadrature along the cuts of a membrane, graded to their tips; each point has two sides."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.cut_line import AWAY, CutRule, along_cut
from verify.compare.membrane_body import MembraneBody
from verify.compare.membrane_cuts import SurfaceLines, nearest_on_lines

Array = NDArray[np.float64]
_WHOLE = np.array([0.0, 1.0])


def membrane_cut_rule(
    body: MembraneBody, spacing: float, order: int = 3, depth: float = 1e-4
) -> CutRule:
    """Quadrature along all cuts of a membrane; as `cut_rule`.

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
    found = []
    for lines in body.lines.values():
        at_tip = body.tip_distance(lines.ends.reshape(-1, 3)).reshape(-1, 2) <= 1e-9 * body.size
        for k, (ends, length) in enumerate(zip(lines.ends, lines.lengths, strict=True)):
            t, weights, away = along_cut(
                _WHOLE, length, at_tip[k], body.size, spacing, order, depth
            )
            points = ends[0] + t[:, None] * (ends[1] - ends[0])
            found.append(_beside(lines, np.full(len(t), k), points, weights, away[:, None]))
    return CutRule.joined(found, 3)


def nearest_on_membrane_cut(body: MembraneBody, cut: str, point: Array) -> CutRule:
    """Take the point of a cut that is nearest to `point` (3,), as a rule of weight 1."""
    lines = body.lines[cut]
    foot, which = nearest_on_lines(point[None], lines.ends)
    return _beside(lines, which, foot, np.ones(1), AWAY * body.size)


def _beside(
    lines: SurfaceLines, which: NDArray[np.int64], points: Array, weights: Array,
    away: Array | float,
) -> CutRule:  # fmt: skip
    """Rule on the lines `which` (n,): beside an edge of a fold the two sides are not opposite."""
    positive, negative = (points + away * ways[which] for ways in (lines.positive, lines.negative))
    return CutRule(points, weights, lines.normals[which], positive, negative)
