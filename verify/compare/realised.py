"""Fields whose cut is not exactly the cut as asked: facets of an arc, a snapped cut.

Between the cut as asked and the cut as realised, the cell that holds a point lies on the wrong
side. There the field is continued from the nearest cell on the right side of the realised cut,
where that is a matter of facets; beside facets beyond the limit (`RealisedCut`) it stands as it was
stored.
Where a solver has no cut at all (ahead of a tip that it moved back), nothing is changed: the field
there is what the solver says it is, and the error is real.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.body import AnyBody
from verify.compare.cell_sides import sides_of_cells
from verify.compare.cut_deviation import RealisedCut
from verify.compare.locate import ROUND_OFF, SolutionField
from verify.compare.locate_kernels import holding_cells
from verify.compare.membrane_body import MembraneBody
from verify.compare.membrane_field import MembraneField
from verify.compare.sides import asked_sides
from verify.solution import Solution

Array = NDArray[np.float64]


def field_of(
    solution: Solution,
    body: AnyBody,
    step: int = -1,
    deviation: float = 0.0,
    continued: bool | RealisedCut = True,
) -> SolutionField:
    """Make the field of a solution, with the sides of the cuts of `body` as asked.

    `deviation` in m is that of another solution's cut, if the field is asked on that one's sides,
    or what is known of its own. Unless it is `continued`, the field is that of the cell that holds
    a point, whatever its side; with a `RealisedCut`, beside facets beyond the limit (of a membrane
    everywhere, if there are any).
    """
    cut = continued if isinstance(continued, RealisedCut) else None
    if isinstance(body, MembraneBody):
        return MembraneField(solution, body, step, cut.record.continued if cut else bool(continued))
    if not len(solution.cut_facets) or not body.has_cuts or not continued:
        return SolutionField(solution, step)
    return SidedField(solution, body, step, deviation, cut)


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
        same = ROUND_OFF * body.size
        self._reach = 2.0 * max(cut_deviation(solution, body), deviation, same)
        self._sides = sides_of_cells(solution, self.shape, self._cuts, self._reach, same)

    def inner_points(self, cells: NDArray[np.int64]) -> Array:
        """Points (n, d) on the sides of the cuts as asked on which given cells (n,) lie.

        They are the centres; that of a cell between a cut as asked and as realised is on the
        wrong side, and replaced by that of the nearest cell with the same sides that is right.
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
        """Sides (n, c) of the cuts as asked on which `near` lies, of points close to these."""
        side = points if near is None else np.asarray(near, dtype=float)
        reach = self._reach + np.linalg.norm(side - points, axis=1)
        wanted = asked_sides(self._cuts, side, reach, self._size)
        if self._cut is not None:
            rows = np.flatnonzero(wanted.any(axis=1))
            rows = rows[self._cut.beyond_at(points[rows])]
            wanted[rows[self._in_material(points[rows])]] = 0
        return wanted

    def _in_material(self, points: Array) -> NDArray[np.bool_]:
        """Whether points (n, d) lie in a cell: in a hole that a method left nothing is stored."""
        tolerance = ROUND_OFF * self.scale
        height = self.shape.heights(points, holding_cells(points, self._searched, tolerance))
        return np.asarray(height.min(axis=1, initial=np.inf) >= -tolerance)
