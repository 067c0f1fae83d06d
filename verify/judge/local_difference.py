"""Difference of two levels around the place of a point value, not at the place alone.

At one point the difference of two levels is a number of either sign that may be small by
accident: it depends on where in its cell the point lies. Around the point the same error takes
all its values. Its root mean square there has no accidents, and falls in order.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.compare.cut_profile import cut_place
from verify.compare.simplices import points_in
from verify.judge.quantities import Measured
from verify.scene.acceptance import DisplacementQuantity, OpeningQuantity

Array = NDArray[np.float64]


class _Side(NamedTuple):
    """A point, and one near it on the side that is meant; (1, d) arrays, m."""

    point: Array
    near: Array


def local_difference(
    asked: DisplacementQuantity | OpeningQuantity, coarse: Measured, fine: Measured
) -> float:
    """Root mean square of the difference of two levels in what a point value is made of, m.

    Taken over the cells of the coarse level that share a corner with the one that holds the
    point. Nodes are double on the cuts, so that these cells lie on one side. An opening is made
    of two points, one on either side: their mean differences subtract, their variances add.
    """
    sides, direction = _made_of(asked, fine)
    mean, variance = 0.0, 0.0
    for sign, side in zip((1.0, -1.0), sides, strict=False):
        points, weights, near = _around(side, coarse)
        u, v = (one.motion.at(asked.time).displacement(points, near) for one in (coarse, fine))
        difference = (v - u) @ direction
        own = float(weights @ difference)
        mean += sign * own
        variance += float(weights @ (difference - own) ** 2)
    return float(np.sqrt(mean**2 + variance))


def _made_of(
    asked: DisplacementQuantity | OpeningQuantity, fine: Measured
) -> tuple[list[_Side], Array]:
    """Points whose displacements make the value, the positive side first, and along what (d,)."""
    if isinstance(asked, DisplacementQuantity):
        at = np.array([asked.point], dtype=float)
        return [_Side(at, at)], np.eye(at.shape[1])["xyz".index(asked.component)]
    place = asked.at if fine.body.dimension == 2 else asked.point
    assert place is not None  # the scene was checked
    rule = cut_place(fine.body, asked.cut, place)
    sides = [_Side(rule.points, rule.positive), _Side(rule.points, rule.negative)]
    normal = rule.normals[0]
    if asked.component == "normal":
        return sides, normal
    above, below = (fine.motion.at(asked.time).displacement(*side)[0] for side in sides)
    along = (above - below) - ((above - below) @ normal) * normal
    return sides, along / max(float(np.linalg.norm(along)), 1e-300)


def _around(side: _Side, coarse: Measured) -> tuple[Array, Array, Array]:
    """Points (n, d) in the cells around one, weights (n,) that sum to 1, and points near each."""
    corners = coarse.solution.cells[:, : coarse.solution.cell_dimension + 1]
    held = corners[coarse.motion.cells_at(*side)[0]]
    cells = coarse.solution.points[corners[np.isin(corners, held).any(axis=1)]]
    points, weights = points_in(cells, 2)
    near = np.repeat(cells.mean(axis=1), len(points) // len(cells), axis=0)
    return points, weights / weights.sum(), near
