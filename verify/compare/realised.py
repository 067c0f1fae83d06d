"""Fields whose cut is not exactly the cut as asked: facets of an arc, a snapped cut.

Between the cut as asked and the cut as realised, the cell that holds a point lies on the wrong
side. There the field is continued from the cell behind the realised cut. Where a solver has
no cut at all (ahead of a tip that it moved back), nothing is changed: the field there is what
the solver says it is, and the error is real.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import Body
from verify.compare.locate import ROUND_OFF, Field, SolutionField
from verify.solution import Solution

__all__ = ["SidedField", "cut_deviation", "field_of"]

Array = NDArray[np.float64]

_ROWS = 2000  # points per block of the distance tables, to bound memory


def field_of(solution: Solution, body: Body) -> Field:
    """Make the field of a solution, with the sides of the cuts of `body` as asked."""
    field = SolutionField(solution)
    deviation = cut_deviation(solution, body)
    if deviation <= ROUND_OFF * body.size:
        return field
    return SidedField(field, body, deviation)


def cut_deviation(solution: Solution, body: Body) -> float:
    """Largest distance of the realised cut from the cuts as asked, m, beyond tips left out."""
    facets = solution.cut_facets
    if not len(facets) or not body.parts:
        return 0.0
    probes = np.concatenate([facets[:, 0], facets[:, 1], facets.mean(axis=1)])
    foot = _nearest_on_cuts(probes, body)
    beside = np.linalg.norm(probes - foot, axis=1)
    if len(body.tips):  # a cut that is too long has no other side to be read from
        at_tip = np.linalg.norm(foot[:, None] - body.tips, axis=2).min(axis=1)
        beside = beside[at_tip > ROUND_OFF * body.size]
    return float(beside.max(initial=0.0))


class SidedField:
    """A solution's field, asked on the sides of the cut as asked.

    Parameters
    ----------
    field : SolutionField
    body : Body
    deviation : float
        Largest distance between the cut as asked and the realised one, m.
    """

    def __init__(self, field: SolutionField, body: Body, deviation: float) -> None:
        self._field, self._body = field, body
        self._reach = 2.0 * deviation
        self._facets = field.solution.cut_facets

    def evaluate(self, points: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Displacement (n, d) and gradient (n, d, d) at `points` (n, d)."""
        points = np.asarray(points, dtype=float)
        side = points if near is None else near
        foot = _nearest_on_cuts(side, self._body)
        band = np.flatnonzero(np.linalg.norm(points - foot, axis=1) <= self._reach)
        away = side[band] - foot[band]
        length = np.linalg.norm(away, axis=1)
        band, away, length = band[length > 0], away[length > 0], length[length > 0]
        away /= length[:, None]
        anchors, hit = self._crossings(points[band], away)
        cells = self._field.cells_at(points, near)
        behind = anchors[hit]
        cells[band[hit]] = self._field.cells_at(behind, behind + away[hit] * self._reach)
        return self._field.in_cells(points, cells)

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d) in m at `points` (n, d)."""
        return self.evaluate(points, near)[0]

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d) at `points` (n, d)."""
        return self.evaluate(points, near)[1]

    def _crossings(self, points: Array, away: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the way from `points` off the asked cut crosses the realised one, if it does."""
        a, edge = self._facets[:, 0], self._facets[:, 1] - self._facets[:, 0]
        t = np.full(len(points), -np.inf)
        for first in range(0, len(points), _ROWS):
            rows = slice(first, first + _ROWS)
            offset = a[None] - points[rows, None]
            step = away[rows, None] * self._reach
            det = step[..., 0] * edge[:, 1] - step[..., 1] * edge[:, 0]
            with np.errstate(divide="ignore", invalid="ignore"):
                along = (offset[..., 0] * edge[:, 1] - offset[..., 1] * edge[:, 0]) / det
                on = (offset[..., 0] * step[..., 1] - offset[..., 1] * step[..., 0]) / det
            met = (along >= -1e-9) & (along <= 1) & (on >= -1e-9) & (on <= 1 + 1e-9)
            t[rows] = np.where(met, along, -np.inf).max(axis=1, initial=-np.inf)
        hit = np.isfinite(t)
        return points + np.where(hit, t, 0.0)[:, None] * away * self._reach, hit


def _nearest_on_cuts(points: Array, body: Body) -> Array:
    best = np.full(len(points), np.inf)
    foot = np.array(points, copy=True)
    for pieces in body.cuts.values():
        for piece in pieces:
            candidate = piece.point(piece.nearest(points))
            distance = np.linalg.norm(points - candidate, axis=1)
            closer = distance < best
            foot[closer], best[closer] = candidate[closer], distance[closer]
    return foot
