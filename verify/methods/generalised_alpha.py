"""Generalised-α: second order, with a dissipation of high frequencies that is chosen.

J. Chung, G. M. Hulbert: A time integration algorithm for structural dynamics with improved
numerical dissipation: the generalized-α method, J. Appl. Mech. 60 (1993) 371–375.
"""

from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Floats, XfemError
from verify.xfem.body import (
    DynamicBody,
    MotionState,
    RayleighDamping,
    StepForces,
    check_no_contact,
)
from verify.xfem.implicit import NewtonIntegrator, Resistance
from verify.xfem.linear_solvers import LinearSolver

_JUMP = 1e-6  # of a load: it jumps if it changes by more within 1e-9 of a step


class _End(NamedTuple):
    """The end of a step, and what it was computed with."""

    state: MotionState
    external: Floats
    damping: RayleighDamping
    step_size: float


class GeneralisedAlpha(NewtonIntegrator):
    """M a_α + f_visc + f_int = f_ext with a_α = (1 − α_m) a₁ + α_m a₀, forces alike with α_f.

    Displacement and velocity are Newmark's. Let ρ be the spectral radius at infinite frequency.
    Then α_m = (2ρ − 1)/(ρ + 1) and α_f = ρ/(ρ + 1); β = ¼ (1 − α_m + α_f)² and γ = ½ − α_m + α_f.

    The scheme keeps its acceleration from step to step; it does not balance the forces of an
    instant. It does so at the start, after a jump of the load, and where state, load, damping or
    step have been changed in between. With damping of the stiffness, balance is limited to modes
    that the step resolves.

    Parameters as for `NewtonIntegrator`, and

    spectral_radius : float
        ρ from 0 (three steps extinguish what they do not resolve) to 1 (dissipates nothing of
        linear motion: the trapezoidal rule in midpoint form).

    Attributes
    ----------
    acceleration : (N, d) float array
        Of the scheme, at the end of the last step, in m/s².

    Raises
    ------
    XfemError
        If ρ is outside 0…1, or the step is not positive and finite.
    """

    def __init__(
        self,
        body: DynamicBody,
        step_size: float,
        solver: LinearSolver | None = None,
        spectral_radius: float = 0.8,
    ) -> None:
        rho = spectral_radius
        if not 0.0 <= rho <= 1.0:
            raise XfemError(f"spectral radius {rho:g}; expected 0 to 1")
        self.alpha_m, self.alpha_f = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
        self.beta = 0.25 * (1.0 - self.alpha_m + self.alpha_f) ** 2
        self.gamma = 0.5 - self.alpha_m + self.alpha_f
        self.rate, self.share = self.gamma / self.beta, 1.0 - self.alpha_f
        self.weight = (1.0 - self.alpha_m) / self.beta
        check_no_contact(body, "generalised-α")
        super().__init__(body, step_size, solver)
        self.acceleration = np.zeros(body.shape)
        self._last: _End | None = None

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        forces = super().step(state)
        self.acceleration = self._acceleration_after(state.displacement)
        load = self._load_at_end(state.time).copy()
        self._last = _End(state.copy(), load, self.body.damping, self.step_size)
        return forces

    def _prepare(self) -> None:
        start, body = self._start, self.body
        before, external = self._resistance_at_start(), self._load_at_start()
        viscous = body.viscous(start.velocity, before.configuration)
        self._before = StepForces(before.force, external, viscous)
        if not self._goes_on(external):
            self.acceleration = self._balanced(before)

    def _goes_on(self, external: Floats) -> bool:
        """Tell whether the step begins where the last one ended, under the same conditions."""
        end, start = self._last, self._start
        if (
            end is None
            or end.state.time != start.time
            or end.damping != self.body.damping
            or end.step_size != self.step_size
            or not np.array_equal(end.state.displacement, start.displacement)
            or not np.array_equal(end.state.velocity, start.velocity)
        ):
            return False
        largest = max(np.abs(external).max(), np.abs(end.external).max())
        return bool(np.abs(external - end.external).max() <= _JUMP * largest)

    def _balanced(self, resistance: Resistance) -> Floats:
        """Compute the acceleration that balances the forces of the start; supports say their own.

        With damping c of the stiffness a mode out of balance would start with c/m v. If c Δt ≫ m,
        that throws it by Δt² c/m v. The matrix of the step then replaces the mass. In a resolved
        mode both agree to O(Δt); in others the acceleration is bounded by v/Δt.
        """
        body, start, before = self.body, self._start, self._before
        held = np.zeros(body.shape)
        if (known := body.held_acceleration(start.time)) is not None:
            held = known
        elif body.moving:
            later, now = (body.prescribed(start.time + h)[1] for h in (self.step_size, 0.0))
            held[body.fixed] = ((later - now) / self.step_size)[body.fixed]
        forces = before.external - before.internal - before.viscous - body.mass.apply(held)
        if body.damping.stiffness == 0.0 or self.alpha_m == self.alpha_f:
            return held + body.free_mass.solve(forces)
        forces[body.fixed] = 0.0
        found = self._correction(resistance, forces)
        return held + (1.0 - self.alpha_m) / (self.beta * self.step_size**2) * found

    def _acceleration_after(self, displacement: Floats) -> Floats:
        h, start, a = self.step_size, self._start, self.acceleration
        found = (displacement - start.displacement - h * start.velocity) / (h**2 * self.beta)
        found -= (0.5 / self.beta - 1.0) * a
        if not self.body.moving:
            found[self.body.fixed] = 0.0
        return found

    def _velocity(self, displacement: Floats) -> Floats:
        after = self._acceleration_after(displacement)
        change = (1.0 - self.gamma) * self.acceleration + self.gamma * after
        velocity = self._start.velocity + self.step_size * change
        if not self.body.moving:
            velocity[self.body.fixed] = 0.0
        return velocity

    def _forces(self, end: Resistance, velocity: Floats, time: float) -> StepForces:
        body, before = self.body, self._before
        new, old = 1.0 - self.alpha_f, self.alpha_f
        after = self._acceleration_after(end.displacement)
        middle = (1.0 - self.alpha_m) * after + self.alpha_m * self.acceleration
        if not body.moving:  # nodes that are caught in flight stop within the step
            middle[body.fixed] = -self._start.velocity[body.fixed] / self.step_size
        return StepForces(
            new * end.force + old * before.internal,
            new * self._load_at_end(time) + old * before.external,
            new * body.viscous(velocity, end.configuration) + old * before.viscous,
            body.mass.apply(middle),
            ((0.0, old), (1.0, new)),
        )
