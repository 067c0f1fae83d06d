"""Newton's method for the equilibrium of a cut body, on its potential energy.

Its matrix is K_ρ = K_R + ρ (K_C − K_R), of the rotation-fixed and the consistent tangent; ρ, the
`rotational` of arguments here, falls along `SHARES` until K_ρ is positive definite. A correction is
then taken by a share, that of the line search.
"""

from typing import NamedTuple

import numpy as np
from scipy.sparse import bsr_array

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.block_pattern import body_pattern, constrain, held_entries
from verify.xfem.errors import SingularStiffnessError
from verify.xfem.internal_force import InternalForce
from verify.xfem.statics import StaticSolver

ROUND_OFF = 256.0 * np.finfo(float).eps  # of positions, seen through the stiffness
UNSEEN = 1e-12  # of the energy: a fall that round-off hides
SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)  # of the rotational tangent, until it is positive definite
_TOLERANCE = 1e-10  # of the residual, over the largest of load, reactions and internal force
_ITERATIONS = 60  # allowed per load step
_HALVINGS = 12  # of a correction
_ENOUGH = 1e-4  # of the fall of the energy that its slope promises (Armijo)
_INEXACT = 1e-6  # residual that conjugate gradients leave of a correction: Newton's method goes on


class NotInEquilibriumError(RuntimeError):
    """No equilibrium of a load step was found, or none that a second path agrees with."""


class Place(NamedTuple):
    """An iterate of Newton's method: displacement (N, d) in m, residual (N, d) in N, measures."""

    displacement: Floats
    residual: Floats
    norm: float  # of the residual, N
    scale: float  # to which the norm compares, N
    energy: float  # potential, J


class Newton:
    """Newton's method of one load step, with a line search on the potential energy.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array

    Attributes
    ----------
    force, fixed
        As given.
    """

    def __init__(self, force: InternalForce, fixed: Bools) -> None:
        self.force, self.fixed = force, fixed
        self._pattern = body_pattern(force.phantom, force.couplings)
        space = fixed.shape[1]
        self._blocks = np.zeros((len(self._pattern.columns), space, space))
        self._internal = np.empty(fixed.shape)
        self._held = held_entries(self._pattern, fixed)
        self._solver = StaticSolver(force, self._pattern, fixed, _INEXACT)

    @property
    def solvers(self) -> frozenset[str]:
        """What has solved the linear systems, of "direct" and "iterative"."""
        return frozenset(self._solver.used)

    @property
    def largest_stiffness(self) -> float:
        """Largest entry of the tangent assembled last, in N/m; with supports if it was inverted."""
        return float(np.abs(self._blocks).max(initial=0.0))

    def solve(self, displacement: Floats, change: Floats, load: Floats) -> tuple[Floats, int]:
        """Equilibrium after a change of the fixed components, and the solves that it took.

        The first correction, for the load and the change, is taken whole. Of the others, a whole
        one by K_C counts if the residual falls; else the energy must fall.

        Parameters
        ----------
        displacement, change : (N, d) float array
            Where the load step starts; what the supports add, zero at free components. In metres.
        load : (N, d) float array
            At the end of the load step, in newtons.

        Raises
        ------
        NotInEquilibriumError
            If the iterations do not suffice, or no correction leads on.
        SingularStiffnessError
            If even the tangent with rotations held is not positive definite.
        """
        start = self.place(displacement, load)
        place = self.place(displacement + self._spread(start, change), load)
        count = 1
        while not self._is_small(place):
            if count == _ITERATIONS or not np.isfinite(place.norm):
                raise self._failure(place, f"after {count} iterations")
            place = self._next(place, load)
            count += 1
        return place.displacement, count

    def _failure(self, place: Place, where: str) -> NotInEquilibriumError:
        return NotInEquilibriumError(
            f"residual {place.norm:.3g} N against forces of {place.scale:.3g} N {where}; "
            f"expected {_TOLERANCE:g} of them. {self._why(place)}"
        )

    def _why(self, place: Place) -> str:
        """Explain why the iterations failed, where cells that have collapsed are the reason."""
        collapsed = collapsed_cells(self.force, place.displacement)
        if len(collapsed) == 0:
            return "More load steps may help"
        return (
            f"{len(collapsed)} of {len(self.force.phantom.cells)} pieces have collapsed, the "
            f"first number {collapsed[0]}: the force is not continuous there (a strip is so thin "
            "at a stretch of 1 + 1/ν), so that there may be no equilibrium"
        )

    def place(self, displacement: Floats, load: Floats) -> Place:
        """Evaluate the equilibrium of a displacement (N, d) under a load (N, d)."""
        internal, energy = self.force.evaluate(displacement)
        scale = max(float(np.linalg.norm(internal)), float(np.linalg.norm(load)))
        potential = energy - float(np.vdot(load, displacement))
        residual = np.where(self.fixed, 0.0, load - internal)
        return Place(displacement, residual, float(np.linalg.norm(residual)), scale, potential)

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Respond linearly to a prescribed change, and to the residual at the start."""
        try:
            return self._solve(start, change, 1.0)
        except SingularStiffnessError:
            return self._solve(start, change, 0.0)

    def _next(self, place: Place, load: Floats) -> Place:
        """Take a correction that lowers the residual, else part of one that lowers the energy."""
        leap = None
        for rotational in SHARES:
            try:
                correction = self._solve(place, None, rotational)
            except SingularStiffnessError:
                if rotational == 0.0:
                    raise
                continue
            if rotational == 1.0:
                trial = self.place(place.displacement + correction, load)
                if trial.norm < place.norm:
                    return trial
                leap = trial
            share = self._share_downhill(place, correction, load)
            if share > 0.0:
                return self.place(place.displacement + share * correction, load)
        if leap is None:
            raise self._failure(place, "where no correction lowers the potential energy")
        # no energy falls, as in round-off or beside a collapsed cell, whose force jumps: go on from
        # the whole correction by K_C, although its residual is larger
        return leap

    def _share_downhill(self, place: Place, correction: Floats, load: Floats) -> float:
        """Share of a correction that lowers the potential energy as its slope says; 0 if none."""
        fall = float(np.vdot(place.residual, correction))
        for halving in range(_HALVINGS):
            share = 0.5**halving
            trial = self.place(place.displacement + share * correction, load)
            # below the round-off of the energy
            unseen = share * fall < UNSEEN * abs(place.energy)
            falls = trial.energy <= place.energy - _ENOUGH * share * fall
            if falls or (unseen and trial.norm < place.norm):
                return share
        return 0.0

    def _is_small(self, place: Place) -> bool:
        """Whether a residual is within the tolerance, or what round-off of positions leaves."""
        reach = np.abs(self.force.phantom.node_points + place.displacement).max()
        round_off = ROUND_OFF * self.largest_stiffness * reach
        return place.norm <= max(_TOLERANCE * place.scale, round_off)

    def _solve(
        self, place: Place, change: Floats | None, rotational: float, least: float = 0.0
    ) -> Floats:
        """Correct for the residual r, and for a change c of the fixed components.

        The free components of K_ρ (δ + c) are r; those of c and the fixed ones of δ are zero.
        """
        matrix = self.linearise(place.displacement, rotational, least)
        load = place.residual.copy()  # the product comes before `inverse`, which spoils the matrix
        if change is not None:
            load -= (matrix @ change.ravel()).reshape(change.shape)
            load[self.fixed] = 0.0
        correction = self.inverse().solve(load)
        return correction if change is None else correction + change

    def linearise(self, displacement: Floats, rotational: float, least: float = 0.0) -> bsr_array:
        """Assemble the tangent K_ρ (N d, N d) at a displacement, without supports.

        It is in the memory of this object: until the next call, or until `inverse` constrains it.

        Parameters
        ----------
        displacement : (N, d) float array
        rotational : float
            Share of what the consistent tangent has beyond the rotation-fixed one.
        least : float
            Without the rotational part membranes have their geometric stiffness, of a tension that
            is this at least, over μ.
        """
        force, pattern, blocks, at = self.force, self._pattern, self._blocks, displacement
        force.linearise(pattern, at, at, 0.0, 1.0, self._internal, blocks, rotational=rotational)
        if rotational == 0.0 and force.is_membrane:
            found = force.configuration(displacement)
            force.add_stiffness(found, pattern, blocks, 1.0, "tension", least)
        return pattern.matrix(blocks)

    def inverse(self) -> StaticSolver:
        """Factorise the tangent that was assembled last, with the supports.

        Raises
        ------
        SingularStiffnessError
            If the tangent is found not to be positive definite, here or when it solves.
        """
        constrain(self._pattern, self.fixed, self._blocks, self._held)
        self._solver.factorize(self._blocks)
        return self._solver


def collapsed_cells(force: InternalForce, displacement: Floats, ratio: float = 1e-3) -> Ints:
    """Pieces (k,) whose rotation, and with it the force, is not unique, or nearly so.

    That is where the two principal stretches of a plane cell cancel (of an inverted cell the
    smallest is negative), where the two smallest do in space, and where a membrane has shrunk
    to a line.

    Parameters
    ----------
    force : InternalForce
    displacement : (N, d) float array
    ratio : float
        Of what is left to the largest stretch, below which a cell counts.
    """
    F = force.deformation(displacement)
    stretches = np.linalg.svd(F, compute_uv=False)
    left = stretches[:, 1]
    if not force.is_membrane:
        left = np.abs(stretches[:, -2] + np.sign(np.linalg.det(F)) * stretches[:, -1])
    return np.flatnonzero(left <= ratio * stretches[:, 0])
