"""Quantities of interest of a scene, measured on one solution or around a place on two.

At one point the difference of two levels is a number of either sign that may be small by
accident: it depends on where in its cell the point lies. Around the point the same error takes
all its values. Its root mean square there has no accidents, and falls in order.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from verify.compare.blade import blade_intensity
from verify.compare.body import AnyBody
from verify.compare.cut_deviation import RealisedCut
from verify.compare.cut_profile import cut_place, opening, point_displacement
from verify.compare.hooke import Law, strain_energy
from verify.compare.locate import Field
from verify.compare.motion import SolutionMotion, step_at
from verify.compare.part_account import part_quantity, part_unit
from verify.compare.simplex_bodies import MembraneBody
from verify.compare.simplices import cells_of, points_in
from verify.judge.resultants import WeakForm, mean_stress, reaction, section
from verify.judge.stress_intensity import Found, solution_intensity
from verify.scene import Scene
from verify.scene.acceptance import (
    DisplacementQuantity,
    FractureQuantity,
    MaximumDisplacementQuantity,
    OpeningQuantity,
    PartQuantity,
    Quantity,
    ReactionQuantity,
    SectionQuantity,
    StressIntensityQuantity,
    StressQuantity,
)
from verify.solution import Solution

_LOOKED_AT = 20_000  # cells


class Measured:
    """A solution with its field, ready to be measured.

    Parameters
    ----------
    solution : Solution
    body : Body or SolidBody
    law : Law
    scene : Scene
    cut : RealisedCut, optional
        Says where its field is continued across that.
    """

    def __init__(
        self, solution: Solution, body: AnyBody, law: Law, scene: Scene,
        cut: RealisedCut | None = None,
    ) -> None:  # fmt: skip
        self.solution, self.body, self.law, self.scene = solution, body, law, scene
        self.cut = cut
        self._factors: Found = {}
        self.motion = SolutionMotion(solution, body, continued=True if cut is None else cut)

    @cached_property
    def weak_form(self) -> WeakForm:
        """Forces at its nodes."""
        return WeakForm(self.scene, self.solution, self.law)

    def continued(self, everywhere: bool) -> SolutionMotion:
        """Field over time with continuation across all of the realised cut, or without any."""
        # sides are asked as far as the cuts are apart; within the limit that is known from facets
        far = self.cut is not None and not self.cut.record.continued
        deviation = self.cut.record.lateral if self.cut is not None and far else 0.0
        return SolutionMotion(self.solution, self.body, deviation, everywhere)

    @property
    def field(self) -> Field:
        """Field at the last output time."""
        return self.motion.at()

    @property
    def coverage(self) -> float:
        """Volume of the cells over that of the body: 1, or something is missing or twice there."""
        shape = cells_of(self.solution)
        return float(shape.volume.sum()) / self.body.measure

    @property
    def outside(self) -> float:
        """Share of the volume of the cells whose centres lie outside the body; 0 of membranes.

        Of many cells, some are looked at.
        """
        if isinstance(self.body, MembraneBody):  # how far it is off its surface is known otherwise
            return 0.0
        shape = cells_of(self.solution)
        some = slice(None, None, 1 + len(shape.volume) // _LOOKED_AT)
        inside, volume = self.body.inside(shape.corners[some].mean(axis=1)), shape.volume[some]
        return float(volume[~inside].sum() / volume.sum())

    def quantity(self, asked: Quantity) -> float:
        """Value of a quantity of interest, in the unit that `unit_of` gives.

        Raises
        ------
        UnsupportedSceneError
            If it cannot be had from this solution, with the reason.
        InputError
            If it is asked for at a time that the solution does not reach.
        """
        if isinstance(asked, FractureQuantity):
            if isinstance(asked, StressIntensityQuantity) and asked.at_blade:
                return blade_intensity(self.scene, self.motion, self.body, asked)
            return solution_intensity(self.scene, self.solution, asked, self._factors)
        if (time := getattr(asked, "time", None)) is not None:
            step_at(self.solution, time)  # a line between two outputs is not its answer
        if isinstance(asked, PartQuantity):
            return part_quantity(self.scene, self.solution, self.motion, self.law, asked)
        if isinstance(asked, ReactionQuantity):
            return reaction(self.weak_form, asked)
        if isinstance(asked, SectionQuantity):
            return section(self.weak_form, asked)
        if isinstance(asked, StressQuantity):
            return mean_stress(self.motion.at(asked.time), self.law, asked)
        if isinstance(asked, MaximumDisplacementQuantity):
            u = self.motion.nodal(asked.time)
            return float(np.linalg.norm(u, axis=1).max())
        if asked.kind == "strain_energy":
            return strain_energy(self.solution, self.law)
        return field_quantity(self.motion.at(asked.time), self.body, asked)


def field_quantity(
    field: Field, body: AnyBody, asked: DisplacementQuantity | OpeningQuantity
) -> float:
    """Value of a displacement or an opening of a field, m."""
    if isinstance(asked, DisplacementQuantity):
        return point_displacement(field, asked.point, asked.component)
    place = asked.at if body.dimension == 2 else asked.point
    assert place is not None  # the scene was checked
    return opening(field, body, asked.cut, place, asked.component)


def unit_of(asked: Quantity, dimension: int) -> str:
    """SI unit of a quantity; energies of plane scenes are per metre of thickness."""
    if isinstance(asked, PartQuantity):
        return part_unit(asked, dimension)
    if isinstance(asked, FractureQuantity):
        return "J/m²" if asked.column < 0 else "Pa √m"
    if isinstance(asked, ReactionQuantity | SectionQuantity):
        return ("N" if asked.of == "force" else "N m") + ("/m" if dimension == 2 else "")
    if isinstance(asked, StressQuantity):
        return "Pa"
    if asked.kind == "strain_energy":
        return "J/m" if dimension == 2 else "J"
    return "m"


Array = NDArray[np.float64]


_Side = tuple[Array, Array]  # a point, and one near it on the side that is meant: (1, d), m


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
        return [(at, at)], np.eye(at.shape[1])["xyz".index(asked.component)]
    place = asked.at if fine.body.dimension == 2 else asked.point
    assert place is not None  # the scene was checked
    rule = cut_place(fine.body, asked.cut, place)
    sides = [(rule.points, rule.positive), (rule.points, rule.negative)]
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
