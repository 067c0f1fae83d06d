"""Newton's method for the equilibrium of a cut body, on its potential energy."""

from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.block_pattern import body_pattern, constrain, held_entries
from verify.xfem.errors import SingularStiffnessError
from verify.xfem.internal_force import InternalForce
from verify.xfem.statics import StaticSolver, is_large

_TOLERANCE = 1e-10  # of the residual, over the largest of load, reactions and internal force
_ITERATIONS = 60  # allowed per load step
_HALVINGS = 12
_ROUND_OFF = 256.0 * np.finfo(float).eps
# of membranes, tensions over μ: at first, below which the consistent tangent is tried, the least;
# and the factor by which a full step lets it fall
_TAUT, _SLACK, _LEAST, _FALL = 1.0, 1e-3, 1e-6, 0.1
_ENOUGH = 1e-4  # of the fall of the energy that its slope promises
# of the rotational part of the tangent, the shares that are tried until it is positive definite
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0)
_COLLAPSED = 1e-3  # of the largest stretch
_UNSEEN = 1e-12  # of the energy
_INVERSE_ITERATIONS = 12
_FIRST_WAY_OUT = 0.1  # of the size of the body, along the softest mode
_MOST = 10_000  # iterations of conjugate gradients
_INEXACT = 1e-6  # residual that conjugate gradients leave of a correction: Newton's method goes on


class NotInEquilibriumError(RuntimeError):
    """No equilibrium of a load step was found, or none that a second path agrees with."""


class Place(NamedTuple):
    """An iterate: displacement (N, d) in m, residual (N, d) in N and what both are judged by."""

    displacement: Floats
    residual: Floats
    norm: float  # of the residual, N
    scale: float  # to which the norm compares, N
    energy: float  # potential, J


class Newton:
    """Newton's method of one load step, and the stability of what it finds.

    Parameters
    ----------
    force : InternalForce
    fixed : (N, d) bool array
    """

    def __init__(self, force: InternalForce, fixed: Bools) -> None:
        self._force, self._fixed = force, fixed
        self._pattern = body_pattern(force.phantom, force.couplings)
        space = fixed.shape[1]
        self._blocks = np.zeros((len(self._pattern.columns), space, space))
        self._internal = np.empty(fixed.shape)
        self._held = held_entries(self._pattern, fixed)
        limit = _MOST if is_large(force.phantom) else 0
        self._solver = StaticSolver(force, self._pattern, fixed, _INEXACT, limit)

    @property
    def solvers(self) -> frozenset[str]:
        """What has solved the linear systems, of "direct" and "iterative"."""
        return frozenset(self._solver.used)

    @property
    def largest_stiffness(self) -> float:
        """Largest entry of the stiffness that was assembled last."""
        return float(np.abs(self._blocks).max(initial=0.0))

    def solve(self, displacement: Floats, change: Floats, load: Floats) -> tuple[Floats, int]:
        """Equilibrium after a change of the fixed components, and the solves that it took.

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
        """Say what stood in the way, as far as it can be seen."""
        collapsed = collapsed_cells(self._force, place.displacement, _COLLAPSED)
        if len(collapsed) == 0:
            return "More load steps may help"
        return (
            f"{len(collapsed)} of {len(self._force.phantom.cells)} pieces have collapsed, the "
            f"first number {collapsed[0]}: the force is not continuous there (a strip is so thin "
            "at a stretch of 1 + 1/ν), so that there may be no equilibrium"
        )

    def place(self, displacement: Floats, load: Floats) -> Place:
        """Judge a displacement (N, d) under a load (N, d)."""
        internal, energy = self._force.evaluate(displacement)
        scale = max(float(np.linalg.norm(internal)), float(np.linalg.norm(load)))
        potential = energy - float(np.vdot(load, displacement))
        residual = np.where(self._fixed, 0.0, load - internal)
        return Place(displacement, residual, float(np.linalg.norm(residual)), scale, potential)

    def is_stable(self, displacement: Floats) -> bool:
        """Whether the consistent tangent at a displacement (N, d) is positive definite.

        A factorisation without pivoting exists only then; conjugate gradients, from forces in all
        directions, meet a negative curvature among the first extreme ones that they find.
        """
        self._assemble(displacement, 1.0)
        constrain(self._pattern, self._fixed, self._blocks, self._held)
        try:
            self._solved(self._random_force())
        except SingularStiffnessError:
            return False
        return True

    def way_out(self, place: Place, load: Floats) -> Place | None:
        """Place of less potential energy along the softest mode of an unstable equilibrium.

        None if the curvature is not negative there: the stiffness is then singular, not indefinite.
        """
        mode = self._softest_mode(place.displacement)
        if mode is None:
            return None
        reach = float(np.ptp(self._force.phantom.mesh.points, axis=0).max())
        for halving in range(2 * _HALVINGS):
            step = _FIRST_WAY_OUT * 0.5**halving * reach * mode
            trials = [self.place(place.displacement + sign * step, load) for sign in (1.0, -1.0)]
            best = min(trials, key=lambda trial: trial.energy)
            if best.energy < place.energy - _UNSEEN * abs(place.energy):
                return best
        return None

    def _softest_mode(self, displacement: Floats) -> Floats | None:
        """Mode (N, d) of negative curvature, its largest entry one; None if there is none."""
        for rotational in _SHARES[1:]:
            self._assemble(displacement, rotational)
            constrain(self._pattern, self._fixed, self._blocks, self._held)
            mode = self._random_force()
            try:
                for _ in range(_INVERSE_ITERATIONS):
                    mode = self._solved(mode)
                    mode[self._fixed] = 0.0
                    mode /= np.abs(mode).max()
            except SingularStiffnessError:
                continue
            self._assemble(displacement, 1.0)
            curvature = mode.ravel() @ (self._pattern.matrix(self._blocks) @ mode.ravel())
            if curvature < 0.0:
                return mode
        return None

    def _random_force(self) -> Floats:
        forces = np.random.default_rng(0).standard_normal(self._fixed.shape)
        return np.where(self._fixed, 0.0, forces)

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Spread the prescribed change with the stiffness before it."""
        try:
            return self._solve(start, change, 1.0)
        except SingularStiffnessError:
            return self._solve(start, change, 0.0)

    def _next(self, place: Place, load: Floats) -> Place:
        """Place with a smaller residual; if that is not a correction away, one further down."""
        leap = None
        for rotational in _SHARES:
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
        return leap  # beside a cell whose force jumps, or in round-off

    def _share_downhill(self, place: Place, correction: Floats, load: Floats) -> float:
        """Share of a correction that lowers the potential energy as its slope says; 0 if none."""
        fall = float(np.vdot(place.residual, correction))
        for halving in range(_HALVINGS):
            share = 0.5**halving
            trial = self.place(place.displacement + share * correction, load)
            # below the round-off of the energy
            unseen = share * fall < _UNSEEN * abs(place.energy)
            falls = trial.energy <= place.energy - _ENOUGH * share * fall
            if falls or (unseen and trial.norm < place.norm):
                return share
        return 0.0

    def _is_small(self, place: Place) -> bool:
        """Whether a residual is within the tolerance, or what round-off of positions leaves."""
        reach = np.abs(self._force.phantom.node_points + place.displacement).max()
        round_off = _ROUND_OFF * self.largest_stiffness * reach
        return place.norm <= max(_TOLERANCE * place.scale, round_off)

    def _solve(
        self, place: Place, change: Floats | None, rotational: float, least: float = 0.0
    ) -> Floats:
        """Solve for a change of the fixed components, or for the residual; see `_assemble`."""
        pattern, blocks = self._pattern, self._blocks
        self._assemble(place.displacement, rotational, least)
        load = place.residual.copy()
        if change is not None:
            load -= (pattern.matrix(blocks) @ change.ravel()).reshape(change.shape)
            load[self._fixed] = 0.0
        constrain(pattern, self._fixed, blocks, self._held)
        correction = self._solved(load)
        return correction if change is None else correction + change

    def _assemble(self, displacement: Floats, rotational: float, least: float = 0.0) -> None:
        """Fill the blocks with the tangent at a displacement.

        `rotational` is the share of what the consistent tangent has beyond the rotation-fixed one.
        Without it membranes have their geometric stiffness, the tension being `least` at least.
        """
        force, pattern, blocks = self._force, self._pattern, self._blocks
        at = displacement
        force.linearise(pattern, at, at, 0.0, 1.0, self._internal, blocks, rotational=rotational)
        if rotational == 0.0 and force.is_membrane:
            found = force.configuration(displacement)
            force.add_stiffness(found, pattern, blocks, 1.0, "tension", least)

    def _solved(self, load: Floats) -> Floats:
        """Solve with the blocks.

        Raises
        ------
        SingularStiffnessError
            If the tangent is found not to be positive definite.
        """
        self._solver.factorize(self._blocks)
        return self._solver.solve(load)


class Descent(Newton):
    """Down the potential energy of a membrane, which has next to no stiffness where it is slack.

    Tangents, not forces, are those of a tension that is at least so much; it falls as long as full
    steps lower the energy. The consistent tangent follows where it is positive definite.
    """

    _least = _TAUT

    def _spread(self, start: Place, change: Floats) -> Floats:
        """Let what is prescribed happen; how far the rest goes with it, the energy says later."""
        self._least = _TAUT
        return self._solve(start, change, 0.0, self._least)

    def _next(self, place: Place, load: Floats) -> Place:
        """Place further down; the same one with more tension if no way leads there."""
        correction = self._downhill(place)
        share = self._share_downhill(place, correction, load)
        if share == 0.0:
            self._least = max(self._least, _SLACK) / _FALL
            return place
        self._least *= _FALL if share == 1.0 else 1.0
        return self.place(place.displacement + share * correction, load)

    def _downhill(self, place: Place) -> Floats:
        """Correction along which the energy falls."""
        if self._least < _SLACK:
            try:
                return self._solve(place, None, 1.0)
            except SingularStiffnessError:
                pass
        return self._solve(place, None, 0.0, max(self._least, _LEAST))


def collapsed_cells(force: InternalForce, displacement: Floats, ratio: float) -> Ints:
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
