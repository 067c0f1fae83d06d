"""Implicit schemes whose step Newton's method solves to a tolerance: Euler, trapezoidal rule."""

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Floats, SingularStiffnessError, XfemError
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
from verify.xfem.internal_force import Configuration, TangentKind, inside_out
from verify.xfem.linear_solvers import LinearSolver

_HALVINGS = 10
_SLOW = 0.5  # of the residual: what a correction leaves that takes too little off
_JUST = 1e-9  # of a step: more than the round-off of a time summed over some thousand steps
_INEXACT = 1e-6  # residual of conjugate gradients for a correction without a former one
_COARSE, _FINE = 1e-2, 1e-12  # most and least of it
_SPARE = 0.05  # of the residual expected after the correction: conjugate gradients may leave it
_ROUND_OFF = 64.0 * np.finfo(float).eps


class Resistance(NamedTuple):
    """Internal force of a step that ends at a displacement.

    Attributes
    ----------
    displacement : (N, d) float array
    force : (N, d) float array
    configuration : Configuration or None
        Of the end; None if it was not found and is not needed.
    blocks : (B, d, d) float array or None
        Derivative by the displacement where one pass finds both, in the memory of the integrator:
        until the next evaluation, or until a matrix is made of it.
    strain : float or None
        Strain energy at the end, where it was found too, in joules.
    """

    displacement: Floats
    force: Floats
    configuration: Configuration | None
    blocks: Floats | None = None
    strain: float | None = None


class Iterate(NamedTuple):
    """An iterate of Newton's method: a guess of the end of a step, and its residual.

    Attributes
    ----------
    resistance : Resistance
    velocity : (N, d) float array
    forces : StepForces
    residual : (N, d) float array
        In newtons.
    norm, scale : float
        Of the residual, and what it compares to, as accelerations.
    """

    resistance: Resistance
    velocity: Floats
    forces: StepForces
    residual: Floats
    norm: float
    scale: float

    @property
    def displacement(self) -> Floats:
        """(N, d) displacement of the resistance."""
        return self.resistance.displacement


class NewtonIntegrator(ABC):
    """M (v₁ − v₀)/h = f_ext − f_int − f_visc with v₁ = γ (u₁ − u₀)/h − (γ − 1) v₀, solved for u₁.

    Let r be the residual, K_R the rotation-fixed and K_C the consistent tangent at the end, and s
    the `share` of the forces there. Damping is α M + β K_R. A correction Δu₁ solves A Δu₁ = r,

        A = (γ/h² + s α γ/h) M + s (1 + β γ/h) K_R + s (K_C − K_R).

    ``step`` calls ``_newton``. That evaluates r by ``_iterate`` (``_resistance``, ``_forces``), and
    solves by ``_correction`` (``_linear_solve``, which makes A by ``_assemble``).

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
        mass of its node, or its share of the volumes around it if that is more: what hangs on a
        sliver is solved for like the rest.
    iterations : int
        Allowed per step; if they do not suffice the step fails rather than go on unsolved. Most
        take 2 to 4; where cells that are inside out stand up, it may be 50.
    solves : int
        Linear solves so far.
    """

    rate: float  # γ: 1 for implicit Euler, 2 for schemes centred in the step
    share: float  # derivative of the forces used with respect to those at the end
    # derivative of h² times the inertia by M u₁; None: γ. It and `StepForces.inertia` are set by
    # schemes whose inertia is not M (v₁ − v₀)/h, as `verify.methods.generalised_alpha`
    weight: float | None = None
    tolerance = 1e-10
    iterations = 80

    def __init__(
        self, body: DynamicBody, step_size: float, solver: LinearSolver | None = None
    ) -> None:
        self.body = body
        self.step_size = check_step(step_size)
        self.solves = 0
        space = body.shape[1]
        # after `_assemble` A with the supports; after an evaluation in one pass the stiffness in A,
        # without mass and supports; after any other evaluation nothing of use
        self._blocks = np.zeros((len(body.pattern.columns), space, space))
        self._solver = body.step_solver(_INEXACT) if solver is None else solver
        self._held = held_entries(body.pattern, body.fixed)
        self._mass_places = body.mass.places(body.pattern)
        # at a node far from a sliver of size ε a consistent mass has ε⁴ on the diagonal and the
        # weight ε³ where its stiffness is ε²: over the former these, 1/ε and more, would be the
        # scale, beside which nothing else is left to solve. Over its share of volumes they are not
        mass = np.maximum(body.mass.matrix.diagonal(), body.mass.weights)
        inverse = 1.0 / np.maximum(mass, self._shared_mass())
        self._inverse_mass = np.repeat(inverse, space).reshape(body.shape)
        self._noise = self._round_off()
        self._factorised: tuple[float, RayleighDamping, bytes] | None = None
        self._left: list[float] = []  # of the residual by each correction of the last step
        self._again = False  # whether the matrix of the last correction serves for the next
        self._rate = 0.0  # share of the residual that one left when it last did
        self._loads: dict[float, Floats] = {}  # external forces in this step, by their time
        self._end: Resistance | None = None  # of the last step
        self._mean_velocity = np.zeros(body.shape)  # in it
        self._speed = np.zeros(body.shape)  # of the supports at the end of the step
        self._start = MotionState(np.empty(body.shape), np.empty(body.shape))

    @abstractmethod
    def _forces(self, end: Resistance, velocity: Floats, time: float) -> StepForces:
        """Return the forces in the balance of a step with this end."""

    def _prepare(self) -> None:  # noqa: B027
        """Evaluate the start of the step, if the scheme needs it; by default it does not."""

    def _load_at_start(self) -> Floats:
        """Compute the external force (N, d) at the start of the step, after what jumps then."""
        return self.body.external(self._start.time + _JUST * self.step_size).copy()

    def _load_at_end(self, time: float) -> Floats:
        """Compute external force (N, d) of a step that ends at a time, before what jumps then."""
        return self._load(time - _JUST * self.step_size)

    def _load(self, time: float) -> Floats:
        """Compute the external force (N, d) at a time once in a step."""
        if time not in self._loads:
            self._loads[time] = self.body.external(time)
        return self._loads[time]

    def _resistance(self, displacement: Floats) -> Resistance:
        """Evaluate the internal force of a step that ends there."""
        body, force = self.body, self.body.force
        if not (force.has_one_pass and force.is_corotational):
            at = force.configuration(displacement)
            found, strain = force.evaluate_at(at)
            return Resistance(displacement, found, at, strain=strain)
        found = np.empty(body.shape)
        force.linearise(
            body.pattern, displacement, displacement, 0.0, self._stiffness_share, found,
            self._blocks, not self._solver.reads_half, self.share,
        )  # fmt: skip
        return self._by_one_pass(displacement, found)

    def _by_one_pass(self, displacement: Floats, force: Floats) -> Resistance:
        """Return a force whose derivative is in the blocks; damping needs rotations too."""
        damped = self.body.damping.stiffness > 0.0
        at = self.body.force.configuration(displacement) if damped else None
        return Resistance(displacement, force, at, self._blocks)

    def _resistance_at_start(self) -> Resistance:
        """Take the resistance at the end of the last step, if this one goes on from there."""
        start, end = self._start.displacement, self._end
        if end is None or not np.array_equal(end.displacement, start):
            return self._resistance(start)
        if self.body.damping.stiffness > 0.0:  # which may be new
            return end._replace(configuration=self._configuration(end))
        return end

    @property
    def _stiffness_share(self) -> float:
        """Factor s (1 + β γ/h) of the rotation-fixed tangent in the matrix of a correction."""
        return self.share * (1.0 + self.rate / self.step_size * self.body.damping.stiffness)

    def _configuration(self, end: Resistance) -> Configuration:
        found = end.configuration
        return self.body.force.configuration(end.displacement) if found is None else found

    def _add_stiffness(self, end: Resistance, kind: TangentKind) -> None:
        """Add the derivative of the internal force of the step to the blocks."""
        at, pattern = self._configuration(end), self.body.pattern
        self.body.force.add_stiffness(at, pattern, self._blocks, self.share, kind)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        self._start, self._again = state.copy(), False
        self._loads.clear()
        self._prepare()
        velocity = state.velocity
        # velocities of slivers, which have hardly any mass to keep them, ring from step to step:
        # they would throw them off. A step like the last one is as near where the motion is smooth
        if self._end is not None and np.array_equal(self._end.displacement, state.displacement):
            velocity = self._mean_velocity
        with np.errstate(over="ignore", invalid="ignore"):
            try:
                end = self._newton(state.displacement + self.step_size * velocity)
            except StepFailedError:
                # where the predictor has turned cells inside out, start from where they are
                end = self._newton(state.displacement.copy())
        change = end.displacement - self._start.displacement
        self._mean_velocity = change / self.step_size
        state.displacement[:], state.velocity[:] = end.displacement, end.velocity
        state.time = self._start.time + self.step_size
        self._end = end.resistance._replace(blocks=None)
        return replace(end.forces, strain=end.resistance.strain)

    def _velocity(self, displacement: Floats) -> Floats:
        velocity = (self.rate / self.step_size) * (displacement - self._start.displacement)
        velocity -= (self.rate - 1.0) * self._start.velocity
        # nodes that were caught in flight would go on changing the sign of their velocity
        velocity[self.body.fixed] = self._speed[self.body.fixed]
        return velocity

    def _iterate(self, displacement: Floats) -> Iterate:
        """Evaluate the equation of a step that ends at a displacement (N, d).

        Norms are of accelerations. Forces on a sliver of share 1e-12 are in space 1e-38 of the
        forces on its neighbours. A norm of forces would not see them: the unknowns of the sliver
        would grow step by step, until its energy is as large as the body's.
        """
        velocity, end = self._velocity(displacement), self._resistance(displacement)
        forces = self._forces(end, velocity, self._start.time + self.step_size)
        if self.body.contact is not None:
            # alike in every scheme: the work of that force is at least its energy
            pressed = self.body.contact.force_of_step(self._start.displacement, displacement)
            forces = replace(forces, internal=forces.internal + pressed)
        inertia = forces.inertia
        if inertia is None:
            inertia = self.body.mass.apply(velocity - self._start.velocity) / self.step_size
        residual = forces.external - forces.internal - forces.viscous - inertia
        residual[self.body.fixed] = 0.0
        parts = (forces.external, forces.internal, forces.viscous, inertia)
        scale = max(self._size(part) for part in parts)
        return Iterate(end, velocity, forces, residual, self._size(residual), scale)

    @property
    def _weight(self) -> float:
        return self.rate if self.weight is None else self.weight

    def _size(self, force: Floats) -> float:
        acceleration = self._inverse_mass * force
        return float(np.sqrt(np.vdot(acceleration, acceleration)))

    def _newton(self, displacement: Floats) -> Iterate:
        """End of the step, from a first guess (N, d).

        At each correction `now` is the iterate evaluated last, so its blocks are valid.
        """
        body = self.body
        prescribed, self._speed = body.prescribed(self._start.time + self.step_size)
        displacement[body.fixed] = prescribed[body.fixed]
        now, is_slow = self._iterate(displacement), False
        left: list[float] = []
        leaps = 0
        for number in range(self.iterations):
            if np.isnan(now.norm):  # inside out, where the energy is infinite
                break
            goal = self.tolerance * now.scale
            # round-off of positions, seen through the stiffness
            reach = np.abs(body.force.phantom.node_points + now.displacement).max()
            noise = reach * self._noise
            if self._excess(now.residual, noise) <= goal:
                self._left = left
                return now
            # a matrix of before leaves twice what it left, or more: kept where that will do
            self._again = bool(left) and max(2.0 * left[-1], self._rate) * now.norm <= goal
            aim = self._aim(number, goal / now.norm)
            correction = self._correction(now.resistance, now.residual, aim, is_slow)
            for halving in range(_HALVINGS):
                trial = self._iterate(now.displacement + 0.5**halving * correction)
                if trial.norm < now.norm:
                    break
            else:
                # within what round-off may keep from falling
                if self._excess(now.residual, 100.0 * noise) <= 1e3 * goal:
                    # once more, as schemes keep what the last evaluation found
                    return self._iterate(now.displacement)
                # a dead end of the residual, not a root: leap over it
                leaps += 1
                trial = self._iterate(now.displacement + correction)
            left.append(trial.norm / now.norm)
            self._rate = left[-1] if self._again else self._rate
            is_slow = not trial.norm < _SLOW * now.norm
            now = trial
        raise StepFailedError(
            f"{type(self).__name__}: step from t = {self._start.time:.6g} s by "
            f"{self.step_size:.6g} s not solved: residual {now.norm:.3g} m/s² against forces "
            f"over masses of {now.scale:.3g} m/s²; expected {self.tolerance:g} of them. "
            f"{self._why(now.displacement, leaps)}"
        )

    def _aim(self, number: int, enough: float) -> float:
        """Choose the residual that conjugate gradients may leave of a correction.

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
        body = self.body
        if not body.force.is_corotational and body.contact is None:
            expected = 0.0  # forces are linear: one correction will do
        else:
            expected = self._left[number] if number < len(self._left) else _INEXACT / _SPARE
        return min(max(_FINE, _SPARE * max(expected, enough)), _COARSE)

    def _shared_mass(self) -> Floats:
        """Share the mass of the body among the corners of its pieces, by their volumes: (N,)."""
        body, v = self.body, self.body.force.phantom
        each = np.repeat(v.volumes / v.cells.shape[1], v.cells.shape[1])
        shared = v.restrict(np.bincount(v.cells.ravel(), each)[:, None])[:, 0]
        return np.asarray(body.mass.weights.sum() / shared.sum() * shared)

    def _round_off(self) -> Floats:
        """Bound the error (N, d) of the acceleration of each node, for positions of size one."""
        body = self.body
        self._blocks[:] = 0.0
        rest = body.force.configuration(np.zeros(body.shape))
        body.force.add_stiffness(rest, body.pattern, self._blocks, self.share)
        if body.contact is not None:
            body.contact.add_stiffness(body.pattern, self._blocks, True)
        stiffness = np.abs(self._blocks[body.pattern.diagonal]).max(axis=(1, 2))[:, None]
        return _ROUND_OFF * (self._inverse_mass * stiffness + self._weight / self.step_size**2)

    def _excess(self, residual: Floats, noise: Floats) -> float:
        """Return the norm of accelerations beyond round-off: ‖(|M⁻¹ r| − noise)₊‖."""
        left = np.abs(self._inverse_mass * residual) - noise
        return float(np.linalg.norm(np.maximum(left, 0.0)))

    def _why(self, displacement: Floats, leaps: int) -> str:
        """Explain why Newton's method failed."""
        if not np.isfinite(displacement).all():
            return "The iterates left the finite numbers: the step is far too long"
        force = self.body.force
        found = [f"{leaps} of {self.iterations} corrections did not lower the residual"]
        if inverted := inside_out(force, displacement):
            found.append(inverted)
        return f"{'; '.join(found)}. A shorter step may help"

    def _correction(
        self, end: Resistance, residual: Floats, tolerance: float = _INEXACT, is_slow: bool = False
    ) -> Floats:
        """Solve for the correction (N, d) of an end of the step by its residual.

        Parameters
        ----------
        end : Resistance
        residual : (N, d) float array
        tolerance : float
            Residual that conjugate gradients may leave.
        is_slow : bool
            Whether the last correction of this step took too little off.
        """
        self.solves += 1
        self._solver.tolerance = tolerance
        try:
            try:
                return self._linear_solve(end, residual, "consistent", is_slow)
            except SingularStiffnessError:
                # K_C may be indefinite far from equilibrium, the rotation-fixed K_R never is
                end = end._replace(blocks=None)
                return self._linear_solve(end, residual, "geometric", is_slow)
        except SingularStiffnessError as failure:
            raise StepFailedError(f"{type(self).__name__}: {failure}") from failure
        except XfemError as failure:
            raise StepFailedError(
                f"{type(self).__name__}: step from t = {self._start.time:.6g} s: {failure}. The "
                "step is too long, or a load is not finite"
            ) from failure

    def _linear_solve(
        self, end: Resistance, residual: Floats, kind: TangentKind, is_slow: bool
    ) -> Floats:
        given, contact = None, self.body.contact
        if not self.body.force.is_corotational:
            closed = b"" if contact is None else contact.touching(end.displacement).tobytes()
            given = (self.step_size, self.body.damping, closed)
        kept = self._again and not self._solver.is_iterative
        if not kept and (given is None or given != self._factorised):  # else K is the last one
            self._factorised = None
            self._assemble(end, kind)
            self._solver.factorize(self._blocks)
            self._factorised = given
        return self._solver.solve(residual)

    def _assemble(self, end: Resistance, kind: TangentKind) -> None:
        """Fill the blocks with A of the class, with supports; what one pass has found is there."""
        body, h = self.body, self.step_size
        per_velocity = self.share * self.rate / h
        if end.blocks is None:
            self._blocks[:] = 0.0
            self._add_stiffness(end, kind)
            if body.damping.stiffness > 0.0:
                scale, at = per_velocity * body.damping.stiffness, self._configuration(end)
                body.force.add_stiffness(at, body.pattern, self._blocks, scale)
        if body.contact is not None:
            body.contact.add_stiffness_of_step(
                body.pattern, self._blocks, self._start.displacement, end.displacement
            )
        factor = self._weight / h**2 + per_velocity * body.damping.mass
        add_mass(self._blocks, self._mass_places, body.mass.entries[2], factor)
        constrain(body.pattern, body.fixed, self._blocks, self._held)


class ImplicitEuler(NewtonIntegrator):
    """Implicit Euler (2.45–46), solved to the tolerance.

    It dissipates: a mode of frequency ω loses half of its energy in about ln 2/(ω² h), whatever its
    amplitude. Parameters as for `NewtonIntegrator`.
    """

    rate = 1.0
    share = 1.0

    def _forces(self, end: Resistance, velocity: Floats, time: float) -> StepForces:
        viscous = self.body.viscous(velocity, end.configuration)
        return StepForces(end.force, self._load_at_end(time), viscous, loaded_at=((1.0, 1.0),))


class Trapezoidal(NewtonIntegrator):
    """Trapezoidal rule: Newmark's method with β = ¼, γ = ½.

    It keeps the energy of linear motion exactly and of small nonlinear motion well. At large
    amplitudes it is not unconditionally stable. Parameters as for `NewtonIntegrator`.
    """

    rate = 2.0
    share = 0.5

    def _prepare(self) -> None:
        start = self._start
        before = self._resistance_at_start()
        viscous = self.body.viscous(start.velocity, before.configuration)
        self._before = StepForces(before.force, self._load_at_start(), viscous)

    def _forces(self, end: Resistance, velocity: Floats, time: float) -> StepForces:
        return StepForces(
            0.5 * (self._before.internal + end.force),
            0.5 * (self._before.external + self._load_at_end(time)),
            0.5 * (self._before.viscous + self.body.viscous(velocity, end.configuration)),
        )
