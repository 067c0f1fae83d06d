"""A cut body of a dynamic scene with its mass, loads and supports, and its initial state."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Equilibrium, Gravity, InitialField, Moving, Scene
from verify.scene.history import factor_at, first_factor
from verify.solvers.loads_of_scene import forces_of, is_moving, nodal_forces
from verify.solvers.supports_of_scene import motion_of_supports, path_of_supports
from verify.xfem.body import DynamicBody, MotionState, RayleighDamping
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass
from verify.xfem.supports import check_bodies

_Floats = NDArray[np.float64]


def body_in_motion(scene: Scene, force: InternalForce, mass: Mass, exact: Any) -> DynamicBody:
    """Give a body with elasticity and mass the loads, supports and damping of a scene."""
    phantom = force.phantom
    weight = np.zeros_like(phantom.node_points)
    driven: list[tuple[_Floats, Any]] = []
    moving: list[tuple[int, Any]] = []
    for i, (load, forces) in enumerate(nodal_forces(scene, phantom, exact)):
        if isinstance(load, Gravity):  # on the mass as it is lumped, so that all falls alike
            weight += mass.weight(load.acceleration)
        elif is_moving(load, exact):
            moving.append((i, load.history))
        else:
            driven.append((forces, load.history))

    def load_at(time: float) -> _Floats:
        total = np.zeros_like(weight)
        for forces, history in driven:
            total += factor_at(history, time) * forces
        for i, history in moving:
            total += factor_at(history, time) * forces_of(scene, i, phantom, exact, time)
        return total

    return DynamicBody(
        force,
        mass,
        weight,
        load_at if driven or moving else None,
        motion_of_supports(scene, phantom, exact),
        RayleighDamping(*scene.analysis.damping),
    )


def initial_state(scene: Scene, body: DynamicBody, exact: Any) -> MotionState:
    """Return the state of a body at the time 0, before what opens then.

    Raises
    ------
    UnsupportedBodyError, NotInEquilibriumError
        If it is to be an equilibrium, and a piece is not held or none is found.
    """
    state, initial, phantom = body.rest(), scene.initial, body.force.phantom
    free = ~body.fixed
    if isinstance(initial, Moving):
        state.velocity[free] = initial.velocities(phantom.node_points)[free]
    elif isinstance(initial, InitialField):
        u, v = initial.state(phantom.node_points, phantom.node_piece_points, exact)
        state.displacement[free], state.velocity[free] = u[free], v[free]
    elif isinstance(initial, Equilibrium):
        state.displacement[:] = _equilibrium(scene, body, exact)
    return state


def _equilibrium(scene: Scene, body: DynamicBody, exact: Any) -> _Floats:
    """Displacement at rest under the loads and supports as their histories begin."""
    phantom = body.force.phantom
    assert body.weight is not None
    load = body.weight.copy()
    for entry, forces in nodal_forces(scene, phantom, exact):
        if not isinstance(entry, Gravity):
            load += first_factor(entry.history) * forces
    path = path_of_supports(scene, phantom, exact)
    check_bodies(phantom, path(1.0))
    return static_equilibrium(
        body.force, body.fixed, lambda share: path(share).values, load
    ).displacement
