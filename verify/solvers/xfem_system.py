"""Elasticity, mass, loads, supports and time steps of a scene for the compact library."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array, identity, kron

from verify.accelerated import FAST
from verify.errors import InputError, UnsupportedSceneError
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.methods.mass_variants import (
    eigenvalue_stabilised_mass,
    generalised_eigenvalue_stabilised_mass,
    shifted_mass,
)
from verify.scene import Equilibrium, Gravity, InitialField, Moving, Scene
from verify.scene.physics import factor_at, first_factor
from verify.solution import INTO_CELL, ContactPressure
from verify.solvers.body_of_scene import cuts_of, density_of, material_of
from verify.solvers.boundary_conditions import (
    forces_of,
    is_moving,
    motion_of_supports,
    path_of_supports,
    supports_of,
)
from verify.system import System
from verify.xfem.arrays import XfemError
from verify.xfem.block_pattern import body_pattern
from verify.xfem.body import DynamicBody, Integrator, MotionState, RayleighDamping
from verify.xfem.closing import ClosingFaces, solve_closed
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.equilibrium import static_equilibrium
from verify.xfem.explicit import (
    RESONANCE_FREE,
    CentralDifferences,
    ForwardEuler,
    SymplecticEuler,
    critical_step,
    element_critical_steps,
)
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce, Kinematics
from verify.xfem.linear_solvers import Kernels
from verify.xfem.loads_and_supports import check_bodies
from verify.xfem.mass import Mass, consistent_mass, side_wise_mass
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]
_FINE = 0.1  # of an element: arcs are sampled so for their normals


def elasticity_of(
    scene: Scene,
    phantom: PhantomMesh,
    kinematics: Kinematics,
    penalise: bool = False,
    kernels: Kernels = FAST,
) -> tuple[InternalForce, GhostPenalty | None]:
    """Return the elasticity of a cut body, with a ghost penalty where asked for, and that."""
    material = material_of(scene, phantom.mesh)
    ghost = GhostPenalty(phantom, material) if penalise else None
    return InternalForce(phantom, material, kinematics, kernels, ghost), ghost


def mass_of(scene: Scene, phantom: PhantomMesh, mass: str, ghost: GhostPenalty | None) -> Mass:
    """Return the mass of a cut body, by its name among `MASSES`.

    Raises
    ------
    UnsupportedSceneError
        If it is not defined on this body: a lumping of the thesis, where cuts cross.
    """
    density = density_of(scene, phantom.mesh)
    try:
        found = MASSES[mass](phantom, density)
    except XfemError as error:
        raise UnsupportedSceneError(f"mass = '{mass}': {error}") from None
    return ghost.mass(found, density) if ghost else found


def faces_of(
    scene: Scene, phantom: PhantomMesh, penalise: bool = False, moving: bool = False
) -> ClosingFaces | None:
    """Find the faces of cuts that touch, where a scene asks for contact.

    Raises
    ------
    UnsupportedSceneError
        If slivers follow others or have a penalty.
    """
    if not scene.contact.closed:
        return None
    if phantom.aggregation is not None or penalise:
        raise UnsupportedSceneError(
            "contact of the faces of a cut is for slivers = 'keep' or 'drop': it needs no others"
        )
    mesh = phantom.mesh
    cuts = cuts_of(scene, _FINE * float(mesh.measures.mean()) ** (1.0 / mesh.dim))
    return ClosingFaces(phantom, material_of(scene, mesh), cuts, moving)


def contact_of(faces: ClosingFaces, pressures: Iterable[_Floats]) -> ContactPressure:
    """Return the pressure between faces from pressures (f, q), one per output time."""
    points = faces.points.reshape(-1, faces.points.shape[2])
    return ContactPressure(points, faces.weights.ravel(), np.array([p.ravel() for p in pressures]))


def system_of(
    scene: Scene,
    phantom: PhantomMesh,
    force: InternalForce,
    ghost: GhostPenalty | None,
    exact: Any,
    mass: str = "sidewise",
) -> System:
    """Assemble the system of a cut body.

    Parameters
    ----------
    scene : Scene
    phantom : PhantomMesh
        What has the mass and the supports.
    force, ghost
        Linear elasticity of what resists with the same unknowns, as of `elasticity_of`.
    exact : exact solution, optional
    mass : str
        As of the solver ``xfem``.

    Raises
    ------
    UnsupportedSceneError
        If the mass is not defined on this body.
    """
    pattern = body_pattern(force.phantom, ghost.couplings if ghost else None)
    stiffness = csr_array(pattern.matrix(force.stiffness(pattern)))
    supports = supports_of(scene, phantom, exact)
    matrix = None
    if scene.material.density is not None:
        inertia = mass_of(scene, phantom, mass, ghost)
        matrix = csr_array(kron(inertia.matrix, identity(supports.fixed.shape[1])))
    return System(stiffness, matrix, supports.fixed.ravel())


SCHEMES: dict[str, Callable[..., Integrator]] = {  # of a body and a step, s
    "newmark": Trapezoidal,
    "implicit_euler": ImplicitEuler,
    "energy_momentum": EnergyMomentum,
    "generalised_alpha": GeneralisedAlpha,
    "central_differences": CentralDifferences,
    "symplectic_euler": SymplecticEuler,
    "forward_euler": ForwardEuler,
}
MASSES: dict[str, Callable[[PhantomMesh, ArrayLike], Mass]] = {
    "sidewise": side_wise_mass,
    "consistent": consistent_mass,
    "evs": eigenvalue_stabilised_mass,
    "gevs": generalised_eigenvalue_stabilised_mass,
    "row_sum": lambda phantom, density: shifted_mass(phantom, density, "row sum"),
    "hrz": lambda phantom, density: shifted_mass(phantom, density, "weighted diagonal"),
    "thesis": lambda phantom, density: shifted_mass(phantom, density, "enrichment"),
}
_REACH = 1.0  # strain up to which the step of a turning body is a bound
EXPLICIT = ("central_differences", "symplectic_euler", "forward_euler")


def largest_step(scene: Scene, body: DynamicBody, scheme: str, factor: float) -> tuple[float, str]:
    """Return the largest time step of a body, s, and where it comes from.

    An explicit scheme takes `factor` times its critical step, or the step asked for if that is
    smaller. Where pieces turn, the critical step allows strains up to 1, and `RESONANCE_FREE` of
    it, so that the time grid makes no modes resonate (docs/theory/dynamics.md). An implicit one
    takes the step asked for, or else `factor` times the critical step of the uncut elements.

    Parameters
    ----------
    scene : Scene
    body : DynamicBody
    scheme : str
        One of `SCHEMES`.
    factor : float
    """
    explicit, asked = scheme in EXPLICIT, scene.analysis.time_step
    if not explicit and asked is not None:
        return asked, "analysis.time_step"
    critical = _critical(scene, body, explicit)
    turning = explicit and body.force.is_corotational
    found = factor * critical * (RESONANCE_FREE if turning else 1.0)
    said = f"{factor:g} of {'√½ of ' if turning else ''}the critical step {critical:.4g} s"
    if not np.isfinite(found) or found <= 0.0:
        raise InputError(f"the critical step is {critical:g} s; give analysis.time_step")
    if asked is not None and asked < found:
        return asked, f"analysis.time_step; the critical step is {critical:.4g} s"
    return found, said


def _critical(scene: Scene, body: DynamicBody, explicit: bool) -> float:
    mesh = body.force.phantom.mesh
    if not explicit or body.mass.keeps_element_steps:
        # side-wise mass: the step of the smallest uncut element is stable, whatever the cuts
        strain = _REACH if body.force.is_corotational else 0.0
        elastic, density = material_of(scene, mesh), density_of(scene, mesh)
        step = float(element_critical_steps(mesh, elastic, density, strain).min())
    else:
        force: Any = body.force
        blocks = force.stiffness(body.pattern, np.zeros(body.shape), "rotation-fixed")
        step = critical_step(csr_array(body.pattern.matrix(blocks)), body.mass, body.fixed)
    if not explicit:
        return step
    # damping is taken at the velocity half a step back: (1 + ξ²)^½ − ξ of the undamped step
    highest = 2.0 / step
    ratio = 0.5 * (body.damping.mass / highest + body.damping.stiffness * highest)
    return step * float(np.hypot(1.0, ratio) - ratio)


def body_in_motion(scene: Scene, force: InternalForce, mass: Mass, exact: Any) -> DynamicBody:
    """Give a body with elasticity and mass the loads, supports and damping of a scene."""
    phantom = force.phantom
    weight = np.zeros_like(phantom.node_points)
    driven: list[tuple[Any, Callable[[float], _Floats]]] = []  # history, and forces at a time
    for i, load in enumerate(scene.loads):
        if isinstance(load, Gravity):  # on the mass as it is lumped, so that all falls alike
            weight += mass.weight(load.acceleration)
        else:
            at = partial(forces_of, scene, i, phantom, exact)
            driven.append((load.history, at if is_moving(load, exact) else _always(at(0.0))))

    def load_at(time: float) -> _Floats:
        total = np.zeros_like(weight)
        for history, forces in driven:
            total += factor_at(history, time) * forces(time)
        return total

    return DynamicBody(
        force,
        mass,
        weight,
        load_at if driven else None,
        motion_of_supports(scene, phantom, exact),
        RayleighDamping(*scene.analysis.damping),
        contact=faces_of(scene, phantom, force.ghost is not None, moving=True),
    )


def _always(forces: _Floats) -> Callable[[float], _Floats]:
    return lambda _time: forces


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
        # a node that no cut has doubled is on its own side: its largest piece may be on the other
        points, beside = phantom.node_points, phantom.node_piece_points
        alone = np.bincount(phantom.node_parent)[phantom.node_parent] == 1
        share = np.where(alone, INTO_CELL, 1.0)[:, None]
        u, v = initial.state(points, points + share * (beside - points), exact)
        state.displacement[free], state.velocity[free] = u[free], v[free]
    elif isinstance(initial, Equilibrium):
        state.displacement[:] = _equilibrium(scene, body, exact)
    return state


def _equilibrium(scene: Scene, body: DynamicBody, exact: Any) -> _Floats:
    """Compute the displacement at rest under the loads and supports as their histories begin."""
    phantom = body.force.phantom
    assert body.weight is not None
    load = body.weight.copy()
    for i, entry in enumerate(scene.loads):
        if not isinstance(entry, Gravity):
            load += first_factor(entry.history) * forces_of(scene, i, phantom, exact)
    path = path_of_supports(scene, phantom, exact)
    if (faces := faces_of(scene, phantom)) is not None:
        return solve_closed(body.force, faces, path(1.0), load).displacement
    check_bodies(phantom, path(1.0))
    return static_equilibrium(
        body.force, body.fixed, lambda share: path(share).values, load
    ).displacement
