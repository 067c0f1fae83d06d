"""Fields whose cut is not exactly the cut as asked: facets of an arc, a snapped cut.

Between the cut as asked and the cut as realised, the cell that holds a point lies on the wrong
side. There the field is continued from the cell behind the realised cut. Where a solver has
no cut at all (ahead of a tip that it moved back), nothing is changed: the field there is what
the solver says it is, and the error is real.
"""

from copy import copy
from typing import Self

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody
from verify.compare.cell_tree import build_cell_tree
from verify.compare.facet_kernels import crossings
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.membrane_body import MembraneBody
from verify.compare.membrane_field import MembraneField
from verify.solution import Solution

__all__ = ["SidedField", "cut_deviation", "field_of"]

Array = NDArray[np.float64]

_ROWS = 2000  # points per block of the distance tables, to bound memory


def field_of(solution: Solution, body: AnyBody) -> "SolutionField | SidedField":
    """Make the field of a solution, with the sides of the cuts of `body` as asked."""
    if isinstance(body, MembraneBody):
        return MembraneField(solution, body)
    field = SolutionField(solution)
    deviation = cut_deviation(solution, body)
    if deviation <= ROUND_OFF * body.size:
        return field
    return SidedField(field, body, deviation)


def cut_deviation(solution: Solution, body: AnyBody) -> float:
    """Largest distance of the realised cut from the cuts as asked, m, beyond tips left out."""
    facets = solution.cut_facets
    if not len(facets) or not body.has_cuts:
        return 0.0
    d = facets.shape[1]
    probes = np.concatenate([*(facets[:, k] for k in range(d)), facets.mean(axis=1)])
    foot, end = body.nearest_on_cuts(probes)
    # a cut that is too long has no other side to be read from
    beside = np.linalg.norm(probes - foot, axis=1)[~end]
    return float(beside.max(initial=0.0))


class SidedField:
    """A solution's field, asked on the sides of the cut as asked.

    Parameters
    ----------
    field : SolutionField
    body : Body or SolidBody
    deviation : float
        Largest distance between the cut as asked and the realised one, m.
    """

    def __init__(self, field: SolutionField, body: AnyBody, deviation: float) -> None:
        self._field, self._body = field, body
        self._reach = 2.0 * deviation
        self._facets = np.ascontiguousarray(field.solution.cut_facets)
        if body.dimension == 3:
            self._tree = build_cell_tree(self._facets.min(axis=1), self._facets.max(axis=1))

    def cells_at(self, points: Array, near: Array | None = None) -> NDArray[np.int64]:
        """Find the cell (n,) whose polynomial is the field at each of `points` (n, d)."""
        points = np.asarray(points, dtype=float)
        side = points if near is None else near
        foot, _ = self._body.nearest_on_cuts(side)
        band = np.flatnonzero(np.linalg.norm(points - foot, axis=1) <= self._reach)
        away = side[band] - foot[band]
        length = np.linalg.norm(away, axis=1)
        band, away, length = band[length > 0], away[length > 0], length[length > 0]
        away /= length[:, None]
        anchors, hit = self._crossings(points[band], away)
        cells = self._field.cells_at(points, near)
        behind = anchors[hit]
        cells[band[hit]] = self._field.cells_at(behind, behind + away[hit] * self._reach)
        return cells

    def in_cells(self, points: Array, cells: NDArray[np.int64]) -> tuple[Array, Array]:
        """Displacement (n, d) and gradient (n, d, d) of the polynomial of each given cell."""
        return self._field.in_cells(points, cells)

    def with_nodal(self, displacement: Array) -> Self:
        """Return the field of other nodal displacements (n, d) on the same mesh."""
        other = copy(self)
        other._field = self._field.with_nodal(displacement)
        return other

    def evaluate(self, points: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Displacement (n, d) and gradient (n, d, d) at `points` (n, d)."""
        return self.in_cells(points, self.cells_at(points, near))

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d) in m at `points` (n, d)."""
        return self.evaluate(points, near)[0]

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d) at `points` (n, d)."""
        return self.evaluate(points, near)[1]

    def _crossings(self, points: Array, away: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Where the way from `points` off the asked cut crosses the realised one, if it does."""
        if self._body.dimension == 2:
            t = self._crossed_segments(points, away)
        else:
            tree = self._tree
            t = crossings(
                np.ascontiguousarray(points), away * self._reach, tree.lower, tree.upper,
                tree.cells, self._facets,
            )  # fmt: skip
        hit = np.isfinite(t)
        return points + np.where(hit, t, 0.0)[:, None] * away * self._reach, hit

    def _crossed_segments(self, points: Array, away: Array) -> Array:
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
        return t
