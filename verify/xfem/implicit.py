"""Implicit schemes whose step Newton's method solves to a tolerance: Euler, trapezoidal rule."""

from abc import ABC, abstractmethod

import numpy as np

from verify.xfem.arrays import Floats
from verify.xfem.block_pattern import add_mass, constrain, held_entries
from verify.xfem.body import (
    DynamicBody,
    MotionState,
    RayleighDamping,
    StepFailedError,
    StepForces,
    check_state,
    check_step,
)
from verify.xfem.errors import SingularStiffnessError, XfemError
from verify.xfem.internal_force import TangentKind, inverted_cells
from verify.xfem.linear_solvers import LinearSolver

_HALVINGS = 10
_SLOW = 0.5  # of the residual: what a correction leaves that takes too little off
_JUST = 1e-9  # of a step: more than the round-off of a time that some thousand steps have added up
_INEXACT = 1e-6  # residual that conjugate gradients leave of a correction of which nothing is known
_COARSE, _FINE = 1e-2, 1e-10  # most and least of it
_SPARE = 0.2  # of what is expected to be left anyhow: what conjugate gradients may leave
_ROUND_OFF = 64.0 * np.finfo(float).eps


class NewtonIntegrator(ABC):
    """M (v₁ − v₀)/h = f_ext − f_int − f_visc with v₁ = γ (u₁ − u₀)/h − (γ − 1) v₀, solved for u₁.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    solver : LinearSolver, optional
        For the sparsity of the body; by default the one that its kernels have for steps.

    Attributes
    ----------
    tolerance : float
        Of the residual force, over the largest of the forces that it balances, each force over the
        mass of its node: what hangs on a sliver is solved for like the rest.
    iterations : int
        Allowed per step; if they do not suffice the step fails rather than go on unsolved. Most
        take 2 to 4; where cells that are inside out stand up, it may be 50.
    solves : int
        Linear solves so far.
    """

    rate: float  # γ: 1 for implicit Euler, 2 for schemes centred in the step
    share: float  # derivative of the forces used with respect to those at the end
    weight: float | None = None  # derivative of h² times the inertia by M u₁; None: γ
    tolerance = 1e-10
    iterations = 80

    def __init__(
        self, body: DynamicBody, step_size: float, solver: LinearSolver | None = None
    ) -> None:
        self.body = body
        self.step_size = check_step(step_size)
        self.solves = 0
        space = body.shape[1]
        self._blocks = np.zeros((len(body.pattern.columns), space, space))
        self._solver = body.step_solver(_INEXACT) if solver is None else solver
        self._held = held_entries(body.pattern, body.fixed)
        self._mass_places = body.mass.places(body.pattern)
        # a consistent mass has ε³ on the diagonal for a sliver whose weight is ε²: over the former
        # that weight alone, 1/ε, would be the scale, beside which nothing else is left to solve
        mass = np.maximum(body.mass.matrix.diagonal(), body.mass.weights)
        self._inverse_mass = (1.0 / mass)[:, None]
        self._noise = self._round_off()
        self._factorised: tuple[float, RayleighDamping] | None = None
        self._is_slow = False  # whether the last correction of this step took too little off
        self._left: list[float] = []  # of the residual by each correction of the last step
        self._is_linearised = False  # whether the stiffness of the last evaluation is in the blocks
        self._at, self._found = np.empty(0), np.empty(0)  # last evaluation: where, and the force
        self._start = MotionState(np.empty(body.shape), np.empty(body.shape))

    @abstractmethod
    def _forces(self, displacement: Floats, velocity: Floats, time: float) -> StepForces:
        """Evaluate the forces of a step that ends like this, and leave the rotations there."""

    def _prepare(self) -> None:  # noqa: B027
        """Evaluate what is needed of the start of the step; nothing by default."""

    def _load_at_start(self) -> Floats:
        """External force (N, d) at the start of the step, after what jumps then."""
        return self.body.external(self._start.time + _JUST * self.step_size).copy()

    def _load_at_end(self, time: float) -> Floats:
        """External force (N, d) of a step that ends at a time, before what jumps then."""
        return self.body.external(time - _JUST * self.step_size)

    def _internal(self, displacement: Floats) -> Floats:
        """Return the internal force (N, d); where one pass finds it, also the stiffness."""
        body = self.body
        if not (body.force.has_one_pass and body.force.is_corotational):
            return body.force.evaluate(displacement)[0]
        scale = self._stiffness_share
        # damping wants rotations too, and others may have turned them since
        if scale != self.share or not np.array_equal(self._at, displacement):
            self._found = np.empty(body.shape)
            body.force.linearise(
                body.pattern, displacement, displacement, 0.0, scale, self._found, self._blocks,
                not self._solver.reads_half, self.share,
            )  # fmt: skip
            self._at, self._is_linearised = displacement.copy(), True
        return self._found

    @property
    def _stiffness_share(self) -> float:
        """Of the rotation-fixed tangent, in the matrix of a correction."""
        return self.share * (1.0 + self.rate / self.step_size * self.body.damping.stiffness)

    def _add_stiffness(self, displacement: Floats, kind: TangentKind) -> None:
        """Add the derivative of the internal force of the step to the blocks."""
        force = self.body.force
        force.add_stiffness(self.body.pattern, self._blocks, self.share, kind, displacement)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        self._start = state.copy()
        self._prepare()
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                result = self._solve(state.displacement + self.step_size * state.velocity)
            except StepFailedError:
                # where the predictor has turned cells inside out, start from where they are
                result = self._solve(state.displacement.copy())
        displacement, velocity, forces = result
        state.displacement[:], state.velocity[:] = displacement, velocity
        state.time = self._start.time + self.step_size
        return forces

    def _velocity(self, displacement: Floats) -> Floats:
        velocity = (self.rate / self.step_size) * (displacement - self._start.displacement)
        velocity -= (self.rate - 1.0) * self._start.velocity
        if not self.body.moving:
            # nodes that were caught in flight would go on changing the sign of their velocity
            velocity[self.body.fixed] = 0.0
        return velocity

    def _residual(self, displacement: Floats) -> tuple[Floats, float, StepForces, float]:
        """Residual force (N, d), its norm, the forces, and the scale to which it compares.

        Norms are of accelerations. The forces on a sliver of 1e-12, in space 1e-38 of those on its
        neighbours, would not be seen among these: its unknowns would go anywhere, and step by step
        they would grow until its energy is that of the body.
        """
        velocity = self._velocity(displacement)
        forces = self._forces(displacement, velocity, self._start.time + self.step_size)
        inertia = forces.inertia
        if inertia is None:
            inertia = self.body.mass.apply(velocity - self._start.velocity) / self.step_size
        residual = forces.external - forces.internal - forces.viscous - inertia
        residual[self.body.fixed] = 0.0
        parts = (forces.external, forces.internal, forces.viscous, inertia)
        scale = max(self._size(part) for part in parts)
        return residual, self._size(residual), forces, scale

    @property
    def _weight(self) -> float:
        return self.rate if self.weight is None else self.weight

    def _size(self, force: Floats) -> float:
        return float(np.linalg.norm(self._inverse_mass * force))

    def _solve(self, displacement: Floats) -> tuple[Floats, Floats, StepForces]:
        """Displacement, velocity and forces of the end of the step, from a first guess (N, d)."""
        body = self.body
        prescribed, _ = body.prescribed(self._start.time + self.step_size)
        displacement[body.fixed] = prescribed[body.fixed]
        residual, norm, forces, scale = self._residual(displacement)
        left: list[float] = []
        leaps, self._is_slow = 0, False
        for number in range(self.iterations):
            # round-off of positions, seen through the stiffness
            noise = np.abs(body.force.phantom.node_points + displacement).max() * self._noise
            if self._excess(residual, noise) <= self.tolerance * scale:
                self._left = left
                return displacement, self._velocity(displacement), forces
            aim = self._aim(number, self.tolerance * scale / norm)
            correction = self._correction(displacement, residual, aim)
            nearly = self._excess(residual, 100.0 * noise) <= 1e3 * self.tolerance * scale
            accepted = False
            for halving in range(_HALVINGS):
                trial = displacement + 0.5**halving * correction
                residual, size, forces, scale = self._residual(trial)
                if size < norm:
                    accepted = True
                    break
            if not accepted and nearly:
                _, _, forces, _ = self._residual(displacement)
                return displacement, self._velocity(displacement), forces
            if not accepted:
                # a dead end of the residual, not a root: leap over it
                leaps += 1
                trial = displacement + correction
                residual, size, forces, scale = self._residual(trial)
            left.append(size / norm)
            self._is_slow = not size < _SLOW * norm
            displacement, norm = trial, size
        raise StepFailedError(
            f"{type(self).__name__}: step from t = {self._start.time:.6g} s by "
            f"{self.step_size:.6g} s not solved: residual {norm:.3g} m/s² against forces "
            f"over masses of {scale:.3g} m/s²; expected {self.tolerance:g} of them. "
            f"{self._why(displacement, leaps)}"
        )

    def _aim(self, number: int, enough: float) -> float:
        """Residual that conjugate gradients may leave of a correction: little less than others do.

        A correction leaves a residual because forces are not linear, about as much of it as the
        same correction of the last step (inexact Newton: Eisenstat & Walker, SIAM J. Sci.
        Comput. 17, 1996).

        Parameters
        ----------
        number : int
            Of the correction in the step.
        enough : float
            Share of the residual with which the step is solved.
        """
        expected = self._left[number] if number < len(self._left) else _INEXACT / _SPARE
        return min(max(_FINE, _SPARE * max(expected, enough)), _COARSE)

    def _round_off(self) -> Floats:
        """(N, 1) error of the acceleration of each node for positions of size one, rounded."""
        body = self.body
        self._blocks[:] = 0.0
        body.force.add_stiffness(body.pattern, self._blocks, self.share)
        stiffness = np.abs(self._blocks[body.pattern.diagonal]).max(axis=(1, 2))[:, None]
        return _ROUND_OFF * (self._inverse_mass * stiffness + self._weight / self.step_size**2)

    def _excess(self, residual: Floats, noise: Floats) -> float:
        """Norm of the accelerations that are left, as far as they are more than round-off."""
        left = np.abs(self._inverse_mass * residual) - noise
        return float(np.linalg.norm(np.maximum(left, 0.0)))

    def _why(self, displacement: Floats, leaps: int) -> str:
        """Say what stood in the way of Newton's method."""
        if not np.isfinite(displacement).all():
            return "The iterates left the finite numbers: the step is far too long"
        force = self.body.force
        found = [f"{leaps} of {self.iterations} corrections did not lower the residual"]
        if force.phantom.mesh.dim == force.phantom.mesh.space:
            inverted = inverted_cells(force, displacement)
            if len(inverted) > 0:
                found.append(
                    f"{len(inverted)} of {len(force.phantom.cells)} pieces are inside out, the "
                    f"first number {inverted[0]}, where the force has no continuous stiffness"
                )
        return f"{'; '.join(found)}. A shorter step may help"

    def _correction(
        self, displacement: Floats, residual: Floats, tolerance: float = _INEXACT
    ) -> Floats:
        self.solves += 1
        self._solver.tolerance = tolerance
        try:
            try:
                return self._solved(displacement, residual, "consistent")
            except SingularStiffnessError:
                # the exact one may be indefinite far from equilibrium; that without turns is not
                return self._solved(displacement, residual, "geometric")
        except SingularStiffnessError as failure:
            raise StepFailedError(f"{type(self).__name__}: {failure}") from failure
        except XfemError as failure:
            raise StepFailedError(
                f"{type(self).__name__}: step from t = {self._start.time:.6g} s: {failure}. The "
                "step is too long, or a load is not finite"
            ) from failure

    def _solved(self, displacement: Floats, residual: Floats, kind: TangentKind) -> Floats:
        given = None if self.body.force.is_corotational else (self.step_size, self.body.damping)
        if given is None or given != self._factorised:  # the matrix of linear motion stays
            self._factorised = None
            self._assemble(displacement, kind)
            self._solver.factorize(self._blocks)
            self._factorised = given
        return self._solver.solve(residual)

    def _assemble(self, displacement: Floats, kind: TangentKind) -> None:
        body, h = self.body, self.step_size
        per_velocity = self.share * self.rate / h
        if not self._is_linearised or kind != "consistent":
            self._blocks[:] = 0.0
            self._add_stiffness(displacement, kind)
            if body.damping.stiffness > 0.0:
                body.force.add_stiffness(
                    body.pattern, self._blocks, per_velocity * body.damping.stiffness
                )
        self._is_linearised, self._at = False, np.empty(0)
        factor = self._weight / h**2 + per_velocity * body.damping.mass
        add_mass(self._blocks, self._mass_places, body.mass.entries[2], factor)
        constrain(body.pattern, body.fixed, self._blocks, self._held)


class ImplicitEuler(NewtonIntegrator):
    """Implicit Euler (2.45–46), solved to the tolerance.

    It dissipates: a mode of frequency ω loses half of its energy in about ln 2/(ω² h), whatever its
    amplitude. Parameters are those of `NewtonIntegrator`.
    """

    rate = 1.0
    share = 1.0

    def _forces(self, displacement: Floats, velocity: Floats, time: float) -> StepForces:
        internal = self._internal(displacement)
        return StepForces(internal, self._load_at_end(time), self.body.viscous(velocity))


class Trapezoidal(NewtonIntegrator):
    """Trapezoidal rule: Newmark's method with β = ¼, γ = ½.

    It keeps the energy of linear motion exactly and that of small nonlinear motion well, and is not
    unconditionally stable at large amplitudes. Parameters are those of `NewtonIntegrator`.
    """

    rate = 2.0
    share = 0.5

    def _prepare(self) -> None:
        start = self._start
        internal = self._internal(start.displacement)
        viscous = self.body.viscous(start.velocity)
        self._before = StepForces(internal, self._load_at_start(), viscous)

    def _forces(self, displacement: Floats, velocity: Floats, time: float) -> StepForces:
        internal = self._internal(displacement)
        return StepForces(
            0.5 * (self._before.internal + internal),
            0.5 * (self._before.external + self._load_at_end(time)),
            0.5 * (self._before.viscous + self.body.viscous(velocity)),
        )
