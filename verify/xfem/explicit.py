"""Explicit schemes: central differences, symplectic Euler, and the forward Euler of the thesis.

Central differences are written in velocity form, so that displacement and velocity belong to the
same instant. All of them are free of any linear solve if the mass is diagonal.
"""

from dataclasses import replace

import numpy as np

from verify.xfem.arrays import Floats
from verify.xfem.body import (
    DynamicBody,
    FreeMass,
    MotionState,
    RayleighDamping,
    StepFailedError,
    StepForces,
    check_state,
    check_step,
    couples_supports,
)
from verify.xfem.errors import XfemError


class _Explicit:
    """Base of the schemes: accelerations of a body, and the end of a step."""

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        """Prepare a body and a step in seconds."""
        self.body = body
        self.step_size = check_step(step_size)
        if body.moving and couples_supports(body):
            raise XfemError(
                "explicit step with moving supports whose nodes the mass couples to free ones; "
                "use the side-wise mass, and hold slivers there on their own or keep them"
            )
        self._mass = FreeMass(body)

    def _acceleration(
        self, displacement: Floats, velocity: Floats, time: float
    ) -> tuple[Floats, StepForces]:
        body = self.body
        at = body.force.configuration(displacement)
        internal, _ = body.force.evaluate_at(at)
        forces = StepForces(internal, body.external(time), body.viscous(velocity, at))
        return self._mass.solve(forces.external - forces.internal - forces.viscous), forces

    def _finish(
        self, state: MotionState, displacement: Floats, velocity: Floats, time: float
    ) -> None:
        if not (np.isfinite(displacement).all() and np.isfinite(velocity).all()):
            raise StepFailedError(
                f"{type(self).__name__}: not finite at t = {time:.6g} s with a step of "
                f"{self.step_size:.6g} s; beyond the critical step?"
            )
        fixed = self.body.fixed
        where, speed = self.body.prescribed(time)
        displacement[fixed], velocity[fixed] = where[fixed], speed[fixed]
        state.displacement[:], state.velocity[:], state.time = displacement, velocity, time


def acceleration_of(body: DynamicBody, state: MotionState) -> Floats:
    """Acceleration (N, d) in m/s² that balances all forces of a state; zero where held.

    Raises
    ------
    XfemError
        If supports move and the mass couples their nodes to free ones, or the state is not one of
        the body.
    """
    check_state(state, body.shape)
    return _Explicit(body, 1.0)._acceleration(state.displacement, state.velocity, state.time)[0]


class CentralDifferences(_Explicit):
    """Central differences (velocity Verlet), second order, symplectic.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds; stable below `verify.xfem.critical_step.critical_step` if linear. Damping
        is taken at the velocity of the start in the first half of a step, at that of its middle in
        the second.

    Examples
    --------
    A piece without supports falls freely:

    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> mass = xfem.side_wise_mass(phantom, 1000.0)
    >>> body = xfem.DynamicBody(force, mass, mass.weight([0.0, -10.0]))
    >>> scheme, state = xfem.CentralDifferences(body, 1e-3), body.rest()
    >>> for _ in range(100):
    ...     forces = scheme.step(state)
    >>> state.displacement[:, 1].round(9).tolist()[:2]
    [-0.05, -0.05]
    """

    def __init__(self, body: DynamicBody, step_size: float) -> None:
        super().__init__(body, step_size)
        self._end: tuple[MotionState, Floats, StepForces] | None = None

    def _start(self, state: MotionState) -> tuple[Floats, StepForces]:
        """Acceleration at the start, reused from the last step if this one continues it."""
        if self._end is not None and self.body.damping == RayleighDamping():
            end, acceleration, forces = self._end
            goes_on = end.time == state.time and np.array_equal(
                end.displacement, state.displacement
            )
            # a load or weight may have been replaced since
            if goes_on and np.array_equal(self.body.external(state.time), forces.external):
                return acceleration, forces
        return self._acceleration(state.displacement, state.velocity, state.time)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        h = self.step_size
        first, before = self._start(state)
        middle = state.velocity + 0.5 * h * first
        displacement = state.displacement + h * middle
        time = state.time + h
        where, _ = self.body.prescribed(time)
        displacement[self.body.fixed] = where[self.body.fixed]
        second, after = self._acceleration(displacement, middle, time)
        self._finish(state, displacement, middle + 0.5 * h * second, time)
        kept = StepForces(after.internal, after.external.copy(), after.viscous)
        self._end = (state.copy(), second, kept)
        return StepForces(
            0.5 * (before.internal + after.internal),
            0.5 * (before.external + after.external),
            0.5 * (before.viscous + after.viscous),
        )


class SymplecticEuler(_Explicit):
    """New velocity first, then the displacement with it: stable up to the critical step.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    """

    _moves_with_new_velocity = True

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        check_state(state, self.body.shape)
        h = self.step_size
        acceleration, forces = self._acceleration(state.displacement, state.velocity, state.time)
        velocity = state.velocity + h * acceleration
        moving = velocity if self._moves_with_new_velocity else state.velocity
        self._finish(state, state.displacement + h * moving, velocity, state.time + h)
        return replace(forces, loaded_at=((0.0, 1.0),))


class ForwardEuler(SymplecticEuler):
    """(2.43–44) as printed: unstable at every step without damping; a negative control.

    Parameters are those of `SymplecticEuler`, with whose velocity before the step it moves.
    """

    _moves_with_new_velocity = False
