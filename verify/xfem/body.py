"""Body in motion: elasticity, mass, damping, supports and loads of a cut body, and its state.

Each scheme advances M (v₁ − v₀) = h (f_ext − f_int − f_visc + reactions), and chooses at which
instants it takes the forces. Some replace the left-hand side by an inertia of their own. A step
returns its forces, so that the energy balance closes for every scheme.
"""

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    NotConvergedError,
    SingularStiffnessError,
    XfemError,
    check_floats,
    finite_array,
)
from verify.xfem.block_pattern import BlockPattern, add_mass, constrain
from verify.xfem.internal_force import Configuration, InternalForce, Kinematics
from verify.xfem.linear_solvers import LinearSolver
from verify.xfem.loads_and_supports import Supports, check_fixed
from verify.xfem.mass import Mass

_LARGE = 1500  # nodes of a solid, beyond which conjugate gradients are quicker for one solution
_ROUND_OFF = 1e-16  # of scaled forces, that they leave
_LIMIT = 100  # iterations, of which 20 are usual and 50 are seen beside close cuts


@dataclass
class MotionState:
    """State of motion; integrators change it in place.

    Attributes
    ----------
    displacement, velocity : (N, d) float array
        Of the dof nodes, in m and m/s.
    time : float
        In seconds.
    """

    displacement: Floats
    velocity: Floats
    time: float = 0.0

    def copy(self) -> "MotionState":
        """Return an independent copy."""
        return MotionState(self.displacement.copy(), self.velocity.copy(), self.time)


@dataclass(frozen=True)
class RayleighDamping:
    """C = α M + β K, K the rotation-fixed tangent of the moment, so that β damps no rotation.

    Attributes
    ----------
    mass : float
        α in 1/s.
    stiffness : float
        β in seconds.

    Raises
    ------
    XfemError
        If one is negative or not finite.
    """

    mass: float = 0.0
    stiffness: float = 0.0

    def __post_init__(self) -> None:
        for name, value in (("α", self.mass), ("β", self.stiffness)):
            if not (np.isfinite(value) and value >= 0.0):
                raise XfemError(f"Rayleigh damping {name} = {value:g}; expected at least 0")


@dataclass(frozen=True)
class MovingSupports:
    """Components with a prescribed motion.

    Attributes
    ----------
    fixed : (N, d) bool array
    motion : callable
        Displacement and velocity, (N, d) each, at a time; read where fixed.
    acceleration : callable, optional
        (N, d) at a time, after what jumps then; read where fixed. A mass that couples nodes hands
        it on to free ones.
    after : callable, optional
        Velocity (N, d) at a time after what jumps then, where `motion` has the one before; read
        where fixed.
    """

    fixed: Bools
    motion: Callable[[float], tuple[Floats, Floats]]
    acceleration: Callable[[float], Floats] | None = None
    after: Callable[[float], Floats] | None = None

    def at(self, time: float) -> tuple[Floats, Floats]:
        """Evaluate the prescribed displacement and velocity (N, d).

        Raises
        ------
        XfemError
            If one has a wrong shape, or is not finite where it is read.
        """
        displacement, velocity = self.motion(time)
        for name, value in (("displacement", displacement), ("velocity", velocity)):
            if np.shape(value) != self.fixed.shape:
                raise XfemError(
                    f"prescribed {name} of shape {np.shape(value)}; expected {self.fixed.shape}"
                )
            if not np.isfinite(value[self.fixed]).all():
                raise XfemError(f"the prescribed {name} is not finite at t={time:g}")
        return displacement, velocity


class Contact(Protocol):
    """Faces of a body that touch; see `verify.xfem.closing.ClosingFaces`.

    Attributes
    ----------
    kinematics : {"corotational", "linear"}
    couplings : (k, 2) int array
        Dof nodes that contact couples.
    """

    kinematics: Kinematics

    @property
    def couplings(self) -> Ints: ...  # noqa: D102

    def energy(self, displacement: Floats) -> float:
        """Compute the energy in joules at a displacement (N, d)."""
        ...

    def force_of_step(self, before: Floats, after: Floats) -> Floats:
        """Compute the force (N, d) of a step between two displacements, in newtons.

        Its work is at least the change of the energy, and it turns nothing.
        """
        ...

    def touching(self, displacement: Floats) -> Bools:
        """Tell whether faces press on each other, (f, q)."""
        ...

    def add_stiffness(self, pattern: BlockPattern, blocks: Floats, touching: Bools | bool) -> None:
        """Add the second derivative of the energy at rest to nodal blocks."""
        ...

    def add_stiffness_of_step(
        self, pattern: BlockPattern, blocks: Floats, before: Floats, after: Floats
    ) -> None:
        """Add the derivative of the force of a step by its end, or one near it, to nodal blocks."""
        ...


@dataclass
class DynamicBody:
    """M ü + C u̇ + f_int(u) = weight + load(t), with supports.

    Parameters
    ----------
    force : InternalForce
    mass : Mass
    weight : (N, d) float array, optional
        Dead load with the potential −weight·u, e.g. `Mass.weight(gravity)`, in newtons.
    load : callable, optional
        Further nodal forces (N, d) at a time.
    supports : Supports or MovingSupports, optional
        Without it the body is free.
    damping : RayleighDamping
    tie : callable, optional
        Nodal forces (N, d) at a time that still hold what a cut has parted; see
        `verify.xfem.release`. Their work has an entry of its own.
    contact : Contact, optional
        Of the same kinematics; its energy counts as strain energy.

    Attributes
    ----------
    shape : tuple of int
        (N, d), of displacements, velocities and forces.
    fixed : (N, d) bool array
        Of the supports.
    moving : bool
        Whether the supports are `MovingSupports`.
    pattern : BlockPattern
        Sparsity of stiffness and mass together.

    Raises
    ------
    XfemError
        If a shape does not match the body, or a membrane is to be linear: nothing would resist
        across its plane.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> force = xfem.InternalForce(phantom, xfem.isotropic(1e4, 0.3, "plane strain"))
    >>> mass = xfem.side_wise_mass(phantom, 1000.0)
    >>> body = xfem.DynamicBody(force, mass, mass.weight([0.0, -9.8]))
    >>> body.rest().velocity.shape, body.external(0.0).sum(axis=0).round(9).tolist()
    ((35, 2), [0.0, -9800.0])
    """

    force: InternalForce
    mass: Mass
    weight: Floats | None = None
    load: Callable[[float], Floats] | None = None
    supports: Supports | MovingSupports | None = None
    damping: RayleighDamping = field(default_factory=RayleighDamping)
    tie: Callable[[float], Floats] | None = None
    contact: Contact | None = None

    def __post_init__(self) -> None:
        phantom = self.force.phantom
        if self.force.is_membrane and not self.force.is_corotational:
            raise XfemError("linear kinematics of a membrane in motion; expected corotational")
        self.shape: tuple[int, int] = (phantom.node_count, phantom.mesh.space)
        if len(self.mass.weights) != self.shape[0]:
            raise XfemError(
                f"mass of {len(self.mass.weights)} dof nodes; the body has {self.shape[0]}"
            )
        given = np.zeros(self.shape) if self.weight is None else self.weight
        self.weight = finite_array(given, "weight", self.shape)
        if self.load is not None and not callable(self.load):
            raise XfemError("the load is no function of time; a dead load is a weight")
        if not isinstance(self.damping, RayleighDamping):
            raise XfemError(f"damping {self.damping!r}; expected RayleighDamping")
        if self.supports is None:
            self.supports = Supports.none(phantom)
        pairs = self.force.couplings
        if self.contact is not None:
            if self.contact.kinematics != self.force.kinematics or pairs is not None:
                raise XfemError(
                    f"contact of {self.contact.kinematics} kinematics with a force of "
                    f"{self.force.kinematics} kinematics or a penalty; expected the same, and none"
                )
            pairs = self.contact.couplings
        self.pattern = self.mass.pattern(phantom, pairs)
        self._hold(self.supports)

    def __setattr__(self, name: str, value: object) -> None:
        """Let load, weight and damping be replaced, but not supports, force and mass.

        Raises
        ------
        XfemError
            If supports, force or mass of a finished body are assigned.
        """
        if name in ("supports", "force", "mass") and "fixed" in self.__dict__:
            raise XfemError(
                f"the {name} of a body cannot be replaced; use held_by for other supports, or make "
                "another body"
            )
        super().__setattr__(name, value)

    def held_by(self, supports: Supports | MovingSupports) -> "DynamicBody":
        """Return this body with other supports; the rest, sparsity included, is shared.

        Raises
        ------
        XfemError
            If they are not of the shape of the body.
        """
        other = copy(self)
        other._hold(supports)
        return other

    def near(self, nodes: Ints) -> "DynamicBody":
        """Return a body whose forces are right at some dof nodes; see `InternalForce.near`."""
        other = copy(self)
        other.__dict__["force"] = self.force.near(nodes)
        return other

    def _hold(self, supports: Supports | MovingSupports) -> None:
        check_fixed(supports.fixed, self.shape)
        if isinstance(supports, Supports):
            finite_array(supports.values, "supports: values", self.shape)
        self.__dict__["supports"], self.fixed = supports, supports.fixed
        self.__dict__.pop("free_mass", None)
        self.moving = isinstance(supports, MovingSupports)

    @cached_property
    def free_mass(self) -> "FreeMass":
        """Inverse of the mass of the free components."""
        return FreeMass(self)

    def step_solver(self, tolerance: float) -> LinearSolver:
        """Make the linear solver of implicit steps; the tolerance is for iterative ones."""
        phantom, held = self.force.phantom, self.fixed.all(axis=1)
        solid = phantom.mesh.dim == 3
        return self.force.kernels.step(self.pattern, self.shape[1], held, solid, tolerance)

    def rest(self) -> MotionState:
        """Make the undeformed state at rest at time 0; supports prescribe their components."""
        state = MotionState(np.zeros(self.shape), np.zeros(self.shape))
        displacement, velocity = self.prescribed(0.0)
        state.displacement[self.fixed] = displacement[self.fixed]
        state.velocity[self.fixed] = velocity[self.fixed]
        return state

    def prescribed(self, time: float) -> tuple[Floats, Floats]:
        """Compute the displacement and velocity (N, d) of the supports at a time."""
        if isinstance(self.supports, MovingSupports):
            return self.supports.at(time)
        assert self.supports is not None
        return self.supports.values, np.zeros(self.shape)

    def held_acceleration(self, time: float) -> Floats | None:
        """Compute the acceleration (N, d) of supports that move, zero where free; None if unknown.

        Supports that stand still have none, and None too.
        """
        supports = self.supports
        if not isinstance(supports, MovingSupports) or supports.acceleration is None:
            return None
        return np.where(self.fixed, supports.acceleration(time), 0.0)

    def taken_up(self, state: MotionState) -> Floats:
        """Compute the velocity (N, d) after supports have taken up theirs of after a time at once.

        Free nodes have no impulse: where the mass couples them to held ones they move, too.
        """
        supports, velocity = self.supports, state.velocity
        if not isinstance(supports, MovingSupports) or supports.after is None:
            return velocity
        change = np.where(self.fixed, supports.after(state.time) - velocity, 0.0)
        if not change.any():
            return velocity
        return velocity + FreeMass(self).solve(np.zeros(self.shape), change)

    def external(self, time: float) -> Floats:
        """Sum weight, load and tie forces (N, d) at a time, in newtons.

        Raises
        ------
        XfemError
            If the load has a wrong shape.
        """
        assert self.weight is not None
        total = self.weight
        if self.load is not None:
            load = self.load(time)
            if np.shape(load) != self.shape:
                raise XfemError(
                    f"load of shape {np.shape(load)} at t={time:g}; expected {self.shape}"
                )
            total = total + load
        return total if self.tie is None else total + self.tie(time)

    def balance(self, displacement: Floats, velocity: Floats, time: float) -> "StepForces":
        """Compute all forces of an instant, contact among the internal ones."""
        at = self.force.configuration(displacement)
        internal, _ = self.force.evaluate_at(at)
        if self.contact is not None:
            internal += self.contact.force_of_step(displacement, displacement)
        return StepForces(internal, self.external(time), self.viscous(velocity, at))

    def viscous(self, velocity: Floats, at: Configuration | None) -> Floats:
        """Compute the damping force C v (N, d), K with the rotations of a configuration.

        The configuration may be None if β = 0.
        """
        if self.damping.mass == 0.0 and self.damping.stiffness == 0.0:
            return np.zeros(self.shape)
        force = self.damping.mass * self.mass.apply(velocity)
        if self.damping.stiffness > 0.0:
            assert at is not None
            self.force.add_tangent_product(at, velocity, self.damping.stiffness, force)
        return force


class StepFailedError(RuntimeError):
    """A step whose equation was not solved, or whose result is not finite."""


@dataclass(frozen=True)
class StepForces:
    """Forces (N, d) that a step has put into the balance of momentum, in newtons.

    Attributes
    ----------
    internal, external, viscous : (N, d) float array
    inertia : (N, d) float array, optional
        What the step has balanced with them, where that is not M (v₁ − v₀)/h.
    loaded_at : tuple of (share, weight)
        Instants of the step, as shares of it, at which it takes the external forces of the body,
        and the weight of each.
    strain : float, optional
        Strain energy at the end of the step, without contact, where the scheme has found it, in
        joules.
    """

    internal: Floats
    external: Floats
    viscous: Floats
    inertia: Floats | None = None
    loaded_at: tuple[tuple[float, float], ...] = ((0.0, 0.5), (1.0, 0.5))
    strain: float | None = None

    @property
    def unbalanced(self) -> Floats:
        """(N, d) what of them accelerates a body."""
        return self.external - self.internal - self.viscous


class Integrator(Protocol):
    """A time integration scheme for one body and one step size."""

    step_size: float

    def step(self, state: MotionState) -> StepForces:
        """Advance the state in place by one step.

        Raises
        ------
        StepFailedError
            If the step's equation was not solved or the result is not finite; the state is then
            left as it was.
        XfemError
            If the state is not one of the body.
        """
        ...


def check_no_contact(body: DynamicBody, scheme: str) -> None:
    """Check that a body has no contact, for a scheme that cannot treat it.

    Raises
    ------
    XfemError
        If it has.
    """
    if body.contact is not None:
        raise XfemError(
            f"{scheme} has no contact of the faces of cuts; expected the trapezoidal rule, the "
            "energy-momentum scheme or implicit Euler"
        )


def check_step(step_size: float) -> float:
    """Check a step size, and return it.

    Raises
    ------
    XfemError
        If it is not positive and finite.
    """
    if not (np.isfinite(step_size) and step_size > 0.0):
        raise XfemError(f"time step {step_size!r} s; expected positive and finite")
    return float(step_size)


def check_state(state: MotionState, shape: tuple[int, int]) -> None:
    """Check that a state fits a body, before a step is spoilt by broadcasting.

    Raises
    ------
    XfemError
        If it does not.
    """
    for name, value in (("displacement", state.displacement), ("velocity", state.velocity)):
        check_floats(name, value, shape)
    if not np.isfinite(state.time):
        raise XfemError(f"time {state.time!r} s of a state; expected finite")


class FreeMass:
    """The mass of a body without rows and columns of held components.

    A mass that is not diagonal is factorised. In a large solid that takes longer than a step: there
    conjugate gradients solve for it once, as when a cut opens the body further. What they do not
    solve, because a part is too thin, and all that comes after, is solved for by factors.

    Parameters
    ----------
    body : DynamicBody
    """

    def __init__(self, body: DynamicBody) -> None:
        phantom = body.force.phantom
        self._body = body
        self._iterates = phantom.mesh.dim == 3 and body.shape[0] > _LARGE

    def solve(self, forces: Floats, held: Floats | None = None) -> Floats:
        """Compute accelerations (N, d) of forces (N, d); writes on the forces.

        Parameters
        ----------
        forces : (N, d) float array
        held : (N, d) float array, optional
            Acceleration of held components, zero elsewhere; by default they have none.

        Raises
        ------
        XfemError
            If the mass is singular to round-off.
        """
        body = self._body
        if held is not None:
            forces -= body.mass.apply(held)
        forces[body.fixed] = 0.0
        found = self._once(forces) if self._iterates and body.mass.is_coupled else None
        self._iterates = False
        if found is None:
            found = np.empty_like(forces)
            for some, inverse in self._inverses:
                found[:, some] = inverse(forces[:, some])
        return found if held is None else found + held

    def _once(self, forces: Floats) -> Floats | None:
        """Solve by conjugate gradients; None if they fail."""
        body, size = self._body, forces.shape[1]
        rows, columns, values = body.mass.entries
        scale = 1.0 / np.sqrt(body.mass.matrix.diagonal())  # so that slivers count in the residual
        blocks = np.zeros((len(body.pattern.columns), size, size))
        scaled = values * scale[rows] * scale[columns]
        add_mass(blocks, body.mass.places(body.pattern), scaled, 1.0)
        constrain(body.pattern, body.fixed, blocks)
        scale = scale[:, None]
        solver = body.force.kernels.iterative(body.pattern, size, _ROUND_OFF, _LIMIT)
        try:
            solver.factorize(blocks)
            return scale * solver.solve(scale * forces)
        except (SingularStiffnessError, NotConvergedError):
            return None

    @cached_property
    def _inverses(self) -> list[tuple[list[int], Callable[[Floats], Floats]]]:
        """Components that are held at the same nodes, and what solves for them."""
        mass, fixed = self._body.mass, self._body.fixed
        if mass.diagonal is not None or not fixed.any():
            return [(list(range(fixed.shape[1])), mass.solve)]
        alike: dict[bytes, list[int]] = {}
        for component in range(fixed.shape[1]):
            alike.setdefault(fixed[:, component].tobytes(), []).append(component)
        return [(some, mass.inverse_of(~fixed[:, some[0]])) for some in alike.values()]


def couples_supports(body: DynamicBody) -> bool:
    """Tell whether an acceleration of held components moves free ones through the mass."""
    if body.mass.diagonal is not None:
        return False
    rows, columns, _ = body.mass.entries
    return bool((body.fixed[rows] & ~body.fixed[columns]).any())
