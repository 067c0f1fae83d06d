"""Implicit Euler with one linearisation per step: the scheme of real-time simulation.

(M + hC + h²K) Δv = h (f_ext − f_int − C v − h K v) (Baraff & Witkin, SIGGRAPH 1998). K is the
rotation-fixed tangent, of membranes with the geometric stiffness. The matrix is symmetric positive
definite, so that the step always has a solution.
"""

import numpy as np

from verify.xfem.arrays import Floats, Ints, XfemError
from verify.xfem.block_pattern import add_mass, constrain, held_entries
from verify.xfem.body import (
    DynamicBody,
    MotionState,
    StepFailedError,
    StepForces,
    check_no_contact,
    check_state,
    check_step,
)
from verify.xfem.internal_force import Configuration
from verify.xfem.linear_solvers import LinearSolver
from verify.xfem.loads_and_supports import Supports

_EXACT = 1e-10  # residual that conjugate gradients leave of the right-hand side of a step


class RealTimeEuler:
    """Implicit Euler, one linear solve per step.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    solver : LinearSolver, optional
        For the sparsity of the body; by default the one that its kernels have for steps.

    Attributes
    ----------
    blocks : (B, d, d) float array
        Matrix of the last step.
    load : (N, d) float array
        Right-hand side of the last step, in kg m/s.
    """

    def __init__(
        self, body: DynamicBody, step_size: float, solver: LinearSolver | None = None
    ) -> None:
        check_no_contact(body, "the real-time step")
        self.body = body
        self.step_size = check_step(step_size)
        space = body.shape[1]
        self.blocks = np.zeros((len(body.pattern.columns), space, space))
        self.load = np.empty(body.shape)
        self.solver = body.step_solver(_EXACT) if solver is None else solver
        self._places = body.mass.places(body.pattern)
        self._values = body.mass.entries[2]
        self._internal = np.empty(body.shape)
        self._change = np.zeros(body.shape)  # of the velocity, in this step
        self._changes = [np.zeros(body.shape) for _ in range(3)]  # in the last ones, the last first
        self._supported = np.flatnonzero(body.fixed.any(axis=1))
        self._held = held_entries(body.pattern, body.fixed)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        force, h = self.body.force, self.step_size
        external = self.body.external(state.time + h).copy()
        before = state.copy()
        at = self._advance(state) or force.configuration(before.displacement)
        internal = self._internal.copy()
        # f + (h + β) K v₀ was found, f + h K v₁ has acted
        change = h * state.velocity - (h + self.body.damping.stiffness) * before.velocity
        force.add_tangent_product(at, change, 1.0, internal)
        if force.is_membrane:
            force.add_tension_product(at, state.velocity - before.velocity, h, internal)
        viscous = self.body.viscous(state.velocity, at)
        return StepForces(internal, external, viscous, loaded_at=((1.0, 1.0),))

    def advance(self, state: MotionState) -> None:
        """Advance by one step without accounting for the forces: the hot path.

        Raises
        ------
        StepFailedError
            If the solver fails or the result is not finite; the state is left as it was.
        """
        self._advance(state)

    def _advance(self, state: MotionState) -> Configuration | None:
        check_state(state, self.body.shape)
        driven = self._driven(state)
        at = self.linearise(state, bool(driven.any()) or not self.solver.reads_half)
        self._support(driven)
        try:
            self.solver.factorize(self.blocks)
            self._solve()
        except XfemError as failure:
            raise StepFailedError(
                f"RealTimeEuler at t = {state.time:.6g} s: {failure}"
            ) from failure
        if not np.isfinite(self._change).all():
            raise StepFailedError(
                f"RealTimeEuler: not finite after t = {state.time:.6g} s with a step of "
                f"{self.step_size:.6g} s"
            )
        state.velocity += self._change
        state.displacement += self.step_size * state.velocity
        state.time += self.step_size
        return at

    def _solve(self) -> None:
        """Write the change of velocity; iterations start from a parabola through the last three.

        Measured with the bodies of the benchmarks, it saves one iteration in five at steps of a
        millisecond and one in eight at ten. At steps too long for the motion to be smooth it adds
        one in twenty.
        """
        last, before, first = self._changes
        self._change[:] = 3.0 * (last - before) + first
        self.solver.solve(self.load, self._change)
        self._changes.insert(0, self._changes.pop())
        self._changes[0][:] = self._change

    def follow(self, other: "RealTimeEuler", source: Ints) -> None:
        """Go on from the steps of a body before a cut: take over its last changes of velocity.

        Parameters
        ----------
        other : RealTimeEuler
        source : (N,) int array
            Its dof node from which each one here descends.
        """
        self._changes = [change[source] for change in other._changes]
        self.solver.learn(other.solver)

    def linearise(self, state: MotionState, whole: bool = True) -> Configuration | None:
        """Write M + hC + h²K, or its upper half, into `blocks`, the right-hand side into `load`.

        Returns the configuration of the start, unless the kernels do without it.
        """
        body, h = self.body, self.step_size
        damping = body.damping
        implicit = h + damping.stiffness
        at = body.force.linearise(
            body.pattern, state.displacement, state.velocity, implicit, h * implicit,
            self._internal, self.blocks, whole,
        )  # fmt: skip
        if body.force.is_membrane:
            # what tension holds it with across its plane is as stiff as it is thin: implicit too
            assert at is not None
            body.force.add_tension_product(at, state.velocity, h, self._internal)
            body.force.add_stiffness(at, body.pattern, self.blocks, h * h, "tension")
        add_mass(self.blocks, self._places, self._values, 1.0 + h * damping.mass)
        np.subtract(body.external(state.time + h), self._internal, out=self.load)
        if damping.mass > 0.0:
            self.load -= damping.mass * body.mass.apply(state.velocity)
        self.load *= h
        return at

    def _driven(self, state: MotionState) -> Floats:
        """Change of velocity (k, d) with which supported nodes go where they are prescribed."""
        body, nodes = self.body, self._supported
        if isinstance(body.supports, Supports):
            where = body.supports.values
        else:
            where, _ = body.prescribed(state.time + self.step_size)
        change = (where[nodes] - state.displacement[nodes]) / self.step_size - state.velocity[nodes]
        return np.where(body.fixed[nodes], change, 0.0)

    def _support(self, driven: Floats) -> None:
        """Prescribe the change of velocity of fixed components: a load on the others."""
        body, nodes = self.body, self._supported
        if driven.any():
            whole = np.zeros(body.shape)
            whole[nodes] = driven
            resisted = body.pattern.matrix(self.blocks) @ whole.ravel()
            self.load -= resisted.reshape(body.shape)
        constrain(body.pattern, body.fixed, self.blocks, self._held)
        own = np.einsum("nkk->nk", self.blocks[body.pattern.diagonal[nodes]]) * driven
        self.load[nodes] = np.where(body.fixed[nodes], own, self.load[nodes])
