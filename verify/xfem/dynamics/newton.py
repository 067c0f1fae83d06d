"""Newton's method for one implicit step, shared by all schemes that solve theirs to the end."""

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import NDArray

from verify.xfem.assembly_kernels import constrain
from verify.xfem.cholesky import Cholesky, SingularStiffnessError
from verify.xfem.corotational import TangentKind
from verify.xfem.dynamics.body import DynamicBody, MotionState
from verify.xfem.dynamics.integrator import (
    StepFailedError,
    StepForces,
    check_state,
    check_step,
)
from verify.xfem.dynamics.linear_solver import LinearSolver

__all__ = ["NewtonIntegrator"]

_Floats = NDArray[np.float64]

_HALVINGS = 10
_ROUND_OFF = 64.0 * np.finfo(float).eps


class NewtonIntegrator(ABC):
    """M (v₁ − v₀)/h = f_ext − f_int − f_visc with v₁ = γ (u₁ − u₀)/h − (γ − 1) v₀, solved for u₁.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    tolerance : float
        Of the residual force, over the largest of the forces that it balances.
    iterations : int
        Allowed per step; if they do not suffice the step fails rather than go on unsolved.
    solver : LinearSolver, optional
        For the sparsity of the body; by default a Cholesky factorisation.

    Attributes
    ----------
    solves : int
        Linear solves so far.
    """

    rate: float  # γ: 1 for implicit Euler, 2 for schemes centred in the step
    share: float  # derivative of the forces used with respect to those at the end

    def __init__(
        self,
        body: DynamicBody,
        step_size: float,
        tolerance: float = 1e-10,
        iterations: int = 30,
        solver: LinearSolver | None = None,
    ) -> None:
        self.body = body
        self.step_size = check_step(step_size)
        self.tolerance, self.iterations = tolerance, iterations
        self.solves = 0
        space = body.shape[1]
        self._blocks = np.zeros((len(body.pattern.columns), space, space))
        self._solver = self._default_solver() if solver is None else solver
        self._mass_places = body.mass.places(body.pattern)
        self._start = MotionState(np.empty(body.shape), np.empty(body.shape))

    def _default_solver(self) -> LinearSolver:
        return Cholesky(self.body.pattern, self.body.shape[1])

    @abstractmethod
    def _forces(self, displacement: _Floats, velocity: _Floats, time: float) -> StepForces:
        """Evaluate the forces of a step that ends like this, and leave the rotations there."""

    def _prepare(self) -> None:  # noqa: B027
        """Evaluate what is needed of the start of the step; nothing by default."""

    def _add_stiffness(self, displacement: _Floats, kind: TangentKind) -> None:
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
                # where the predictor has turned pieces inside out, start from where they are
                result = self._solve(state.displacement.copy())
        displacement, velocity, forces = result
        state.displacement[:], state.velocity[:] = displacement, velocity
        state.time = self._start.time + self.step_size
        return forces

    def _velocity(self, displacement: _Floats) -> _Floats:
        turned = (self.rate / self.step_size) * (displacement - self._start.displacement)
        return turned - (self.rate - 1.0) * self._start.velocity

    def _residual(self, displacement: _Floats) -> tuple[_Floats, StepForces, float]:
        """Residual force (N, d), the forces, and the scale to which it compares."""
        velocity = self._velocity(displacement)
        forces = self._forces(displacement, velocity, self._start.time + self.step_size)
        inertia = self.body.mass.apply(velocity - self._start.velocity) / self.step_size
        residual = forces.external - forces.internal - forces.viscous - inertia
        residual[self.body.fixed] = 0.0
        parts = (forces.external, forces.internal, forces.viscous, inertia)
        return residual, forces, max(float(np.linalg.norm(part)) for part in parts)

    def _solve(self, displacement: _Floats) -> tuple[_Floats, _Floats, StepForces]:
        body = self.body
        prescribed, _ = body.prescribed(self._start.time + self.step_size)
        displacement[body.fixed] = prescribed[body.fixed]
        residual, forces, scale = self._residual(displacement)
        norm = np.linalg.norm(residual)
        floor, leaps = 0.0, 0
        for _ in range(self.iterations):
            if norm <= max(self.tolerance * scale, floor):
                return displacement, self._velocity(displacement), forces
            correction = self._correction(displacement, residual)
            # round-off of positions, seen through the stiffness
            reach = np.abs(body.force.virtual.node_points + displacement).max()
            floor = _ROUND_OFF * np.abs(self._blocks).max() * reach
            accepted = False
            for halving in range(_HALVINGS):
                trial = displacement + 0.5**halving * correction
                residual, forces, scale = self._residual(trial)
                if np.linalg.norm(residual) < norm:
                    accepted = True
                    break
            if not accepted and norm <= max(1e3 * self.tolerance * scale, 1e2 * floor):
                _, forces, _ = self._residual(displacement)
                return displacement, self._velocity(displacement), forces
            if not accepted:
                # a dead end of the residual, not a root: leap over it
                leaps += 1
                trial = displacement + correction
                residual, forces, scale = self._residual(trial)
            displacement, norm = trial, np.linalg.norm(residual)
        raise StepFailedError(
            f"{type(self).__name__}: step from t = {self._start.time:.6g} s by "
            f"{self.step_size:.6g} s not solved: residual {norm:.3g} N against forces of "
            f"{scale:.3g} N; expected {self.tolerance:g} of them. {self._why(displacement, leaps)}"
        )

    def _why(self, displacement: _Floats, leaps: int) -> str:
        """Say what stood in the way of Newton's method."""
        if not np.isfinite(displacement).all():
            return "The iterates left the finite numbers: the step is far too long"
        force = self.body.force
        found = [f"{leaps} of {self.iterations} corrections did not lower the residual"]
        if force.virtual.mesh.dim == force.virtual.mesh.space:
            inverted = force.inverted(displacement)
            if len(inverted) > 0:
                found.append(
                    f"{len(inverted)} of {len(force.virtual.cells)} pieces are inside out, the "
                    f"first number {inverted[0]}, where the force has no continuous stiffness"
                )
        return f"{'; '.join(found)}. A shorter step may help"

    def _correction(self, displacement: _Floats, residual: _Floats) -> _Floats:
        try:
            self._assemble(displacement, "exact")
            self._solver.factorize(self._blocks)
        except SingularStiffnessError:
            # the exact stiffness may be indefinite far from equilibrium; that without turns is not
            self._assemble(displacement, "tensioned")
            try:
                self._solver.factorize(self._blocks)
            except SingularStiffnessError as failure:
                raise StepFailedError(f"{type(self).__name__}: {failure}") from failure
        self.solves += 1
        return self._solver.solve(residual)

    def _assemble(self, displacement: _Floats, kind: TangentKind) -> None:
        body, h = self.body, self.step_size
        self._blocks[:] = 0.0
        self._add_stiffness(displacement, kind)
        per_velocity = self.share * self.rate / h
        if body.damping.stiffness > 0.0:
            body.force.add_stiffness(
                body.pattern, self._blocks, per_velocity * body.damping.stiffness
            )
        factor = self.rate / h**2 + per_velocity * body.damping.mass
        add_mass(self._blocks, self._mass_places, body.mass.entries[2], factor)
        constrain(body.pattern.starts, body.pattern.columns, body.fixed, self._blocks)


def add_mass(blocks: _Floats, places: NDArray[np.int64], values: _Floats, scale: float) -> None:
    """Add `scale` times the mass to the diagonals of its nodal blocks."""
    for component in range(blocks.shape[1]):
        blocks[places, component, component] += scale * values
