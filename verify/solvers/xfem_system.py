"""A scene for the compact library: elasticity, mass, loads, time steps, equilibria, and its answer.

The fields of a cut body become a neutral solution, with all that was changed.
"""

from collections.abc import Callable, Iterable, Sequence
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
from verify.solution import INTO_CELL, ContactPressure, Regularisation, Solution
from verify.solution_checks import CONSISTENT
from verify.solvers.body_of_scene import cuts_of, density_of, material_of
from verify.solvers.boundary_conditions import (
    forces_of,
    is_moving,
    loads_of,
    motion_of_supports,
    path_of_supports,
    support_ends,
    supports_of,
)
from verify.solvers.runs import Record, across_interfaces, at_rest
from verify.system import System
from verify.xfem.arrays import XfemError
from verify.xfem.block_pattern import body_pattern
from verify.xfem.body import DynamicBody, Integrator, MotionState, RayleighDamping
from verify.xfem.clip import ROUND_OFF_SHARE
from verify.xfem.closing import ClosingFaces, solve_closed
from verify.xfem.energy_momentum import EnergyMomentum
from verify.xfem.equilibrium import StaticEquilibrium, static_equilibrium
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
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.slivers import Fragments, treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import Subdivision, extrapolation, subdivide
from verify.xfem.turning_faces import TurningFaces

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
    if scene.analysis.kinematics != "linear":
        return TurningFaces(phantom, material_of(scene, mesh), moving)
    cuts = cuts_of(scene, _FINE * float(mesh.measures.mean()) ** (1.0 / mesh.dim))
    return ClosingFaces(phantom, material_of(scene, mesh), cuts, moving)


def contact_of(faces: ClosingFaces, pressures: Iterable[_Floats]) -> ContactPressure:
    """Return the pressure between faces from pressures (f, q), one per output time."""
    points = faces.points.reshape(-1, faces.points.shape[2])
    averaged = np.array([faces.averaged(one).ravel() for one in pressures])
    return ContactPressure(points, faces.weights.ravel(), averaged)


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
    "real_time": RealTimeEuler,
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
_LUMPED = (*EXPLICIT, "real_time")


def mass_for(scheme: str, slivers: str = "keep") -> str:
    """Name the mass that suits a time integration, among `MASSES`.

    Explicit schemes need a diagonal one, whose step no sliver shortens; so does a ghost penalty.
    So does the real-time step, as in `verify play`. All others take the consistent one: a lumped
    mass lets the lattice radiate energy that belongs to the crack (docs/theory/dynamics.md).
    """
    return "sidewise" if scheme in _LUMPED or slivers == "penalise" else CONSISTENT


def largest_step(
    scene: Scene, body: DynamicBody, scheme: str, factor: float, given: float | None = None
) -> tuple[float, str]:
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
    given : float or None
        Step asked for instead of the scene's, s.
    """
    explicit, asked = scheme in EXPLICIT, given or scene.analysis.time_step
    name = "the parameter step" if given else "analysis.time_step"
    if not explicit and asked is not None:
        return asked, name
    critical = _critical(scene, body, explicit)
    turning = explicit and body.force.is_corotational
    found = factor * critical * (RESONANCE_FREE if turning else 1.0)
    said = f"{factor:g} of {'√½ of ' if turning else ''}the critical step {critical:.4g} s"
    if not np.isfinite(found) or found <= 0.0:
        raise InputError(f"the critical step is {critical:g} s; give analysis.time_step")
    if asked is not None and asked < found:
        return asked, f"{name}; the critical step is {critical:.4g} s"
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

    def prescribed(share: float) -> _Floats:
        return path(share).values

    if isinstance(faces := body.contact, ClosingFaces):  # by the law of the motion
        return solve_closed(body.force, faces, path(1.0), load, prescribed).displacement
    check_bodies(phantom, path(1.0))
    return static_equilibrium(body.force, body.fixed, prescribed, load).displacement


def solution_on(
    scene: Scene,
    record: Record,
    phantom: PhantomMesh,
    fields: dict[str, Any],
    size: float,
    shown: Subdivision | None = None,
) -> Solution:
    """Put the fields of a cut body on the mesh that conforms to its cuts.

    Parameters
    ----------
    scene : Scene
    record : Record
        Of the run; entries on the body and its supports are added.
    phantom : PhantomMesh
        The cut body.
    fields : dict
        Of `Solution`: displacement and rates (t, N, d) of the unknowns, mass as a word or (N, N)
        matrix, and entries that are no fields.
    size : float
        Of its elements, m.
    shown : Subdivision, optional
        Where the cut body is not as its `subdivide` makes it.
    """
    body = subdivide(phantom) if shown is None else shown
    mass = fields.pop("mass", None)
    if not (mass is None or isinstance(mass, str)):
        back = extrapolation(phantom, body)
        mass = csr_array(back.T @ mass @ back)
    for name in ("displacement", "velocity", "acceleration"):
        if fields.get(name) is not None:
            fields[name] = np.stack([body.interpolation @ one for one in fields[name]])
    mesh = phantom.mesh
    record.regularisations += [
        *(_of_the_cut(phantom) if shown is None else []),
        *across_interfaces(scene, mesh.points, mesh.cells),
        *support_ends(scene, phantom, size),
    ]
    record.notes["timed"] = (
        "every phase as listed; first call (compilation) excluded; writing excluded"
    )
    return record.solution(
        points=body.points,
        cells=body.cells,
        cut_facets=body.cut_facets,
        cell_sides=_side_labels(phantom.label[body.cell_piece]) if shown is None else None,
        mass=mass,
        size=size,
        **fields,
    )


def penalised(ghost: GhostPenalty | None, share: float | None = None) -> list[Regularisation]:
    """Report a ghost penalty: its faces, and its share in the energy or else its factor."""
    if ghost is None:
        return []
    size, unit = (ghost.factor, "factor") if share is None else (share, "of the strain energy")
    return [Regularisation("face with a ghost penalty", len(ghost.weights), size, unit)]


def treated(
    phantom: PhantomMesh, policy: Any, held_in: Callable[[PhantomMesh], NDArray[np.bool_]]
) -> tuple[PhantomMesh, list[Regularisation]]:
    """Treat slivers by a policy; report each kind with its largest volume fraction.

    Parameters
    ----------
    phantom : PhantomMesh
    policy : str
        As of the solver ``xfem``; but for "merge" and "drop" they stay.
    held_in : callable
        Components (N, d) of a body that supports hold.
    """
    if policy not in ("merge", "drop"):
        return phantom, []
    phantom, report = treat_slivers(phantom, policy, supported=held_in(phantom).any(axis=1))
    counts = {
        "sliver that follows a root cell (aggregation)": report.aggregated,
        "sliver absorbed across the cut": report.dropped,
        "sliver without a root cell, kept": report.rootless,
    }
    return phantom, [
        Regularisation(kind, count, report.largest, "volume fraction")
        for kind, count in counts.items()
    ]


def joined(fragments: Fragments) -> Regularisation:
    """Report loose parts of round-off size that move with their neighbours."""
    kind = "loose part of round-off size joined to its neighbour"
    return Regularisation(kind, fragments.count, fragments.largest, "volume fraction")


def springs_left_out(force: InternalForce) -> Regularisation:
    """Report the springs that a fit would make negative; elements have none."""
    kind = "spring that the fit would make negative left out"
    return Regularisation(kind, int(getattr(force, "clamped", 0)), 0.0, "N/m")


def _side_labels(label: NDArray[np.int8]) -> NDArray[np.int64]:
    """Return one number per combination of sides; 0 away from all cuts."""
    if not label.shape[1]:
        return np.zeros(len(label), dtype=np.int64)
    distinct, number = np.unique(label, axis=0, return_inverse=True)
    away = np.flatnonzero((distinct == 0).all(axis=1))
    names = np.arange(1, len(distinct) + 1)
    names[away] = 0
    return names[number.ravel()]


def _of_the_cut(phantom: PhantomMesh) -> list[Regularisation]:
    """Report what the solver moved or left out, each with its size."""
    left = "piece within round-off of its cell left to its neighbour"
    return [
        Regularisation("node taken as on the cut", phantom.snapped, 0.0, "m"),
        Regularisation(left, phantom.dropped, ROUND_OFF_SHARE, "volume fraction"),
    ]


Law = Callable[..., InternalForce]


def solve_equilibrium(
    scene: Scene,
    phantom: PhantomMesh,
    exact: Any,
    record: Record,
    *,
    resisting: PhantomMesh | None = None,
    law: Law = InternalForce,
    load_steps: int = 0,
    penalise: bool = False,
    kernels: Kernels = FAST,
) -> dict[str, Any]:
    """Solve a static scene on a cut mesh.

    Parameters
    ----------
    scene : Scene
    phantom : PhantomMesh
        What bears loads and supports.
    exact : object or None
        The exact solution that supports and loads may be taken from.
    record : Record
        Gets timings, iterations, notes and regularisations.
    resisting : PhantomMesh, optional
        What resists, with the same unknowns; default: the same.
    law : callable
        Makes the internal force; Newton's method solves all but elements.
    load_steps : int
        As of the solver ``xfem``.
    penalise : bool
        Whether with a ghost penalty (linear only).
    kernels : Kernels

    Returns
    -------
    dict
        Fields of `Solution`, of the unknowns of the cut mesh.

    Raises
    ------
    XfemError, NotInEquilibriumError
        From the library.
    """
    with record.timed("loading"):
        path = path_of_supports(scene, phantom, exact)
        supports = path(1.0)
        load = loads_of(scene, phantom, exact)

    def prescribed(share: float) -> _Floats:
        return path(share).values

    body = resisting or phantom
    material, kinematics = material_of(scene, body.mesh), scene.analysis.kinematics
    if (faces := faces_of(scene, phantom, penalise)) is not None:
        with record.timed("solve"):
            elastic = InternalForce(body, material, kinematics, kernels)
            closed = solve_closed(elastic, faces, supports, load, prescribed, load_steps or 1)
        record.iterations["contact"] = closed.iterations
        record.notes["linear solver"] = _solver_text(closed.solver, kernels)
        record.notes["residual"] = f"{closed.residual:.3e}"
        fields = at_rest(closed.displacement, closed.strain_energy)
        return fields | {"contact": contact_of(faces, [closed.pressure])}
    if kinematics == "linear" and law is InternalForce:
        ghost = GhostPenalty(body, material) if penalise else None
        static = solve_static(body, material, supports, load, ghost=ghost, kernels=kernels)
        share = static.penalty_energy / max(static.strain_energy, np.finfo(float).tiny)
        record.timings |= static.timings
        record.notes["linear solver"] = _solver_text(static.solver, kernels)
        record.notes["residual"] = f"{static.residual:.3e}"
        record.regularisations += penalised(ghost, share)
        return at_rest(static.displacement, static.strain_energy)
    check_bodies(body, supports)
    with record.timed("solve"):
        force = law(body, material, kinematics, kernels=kernels)
        found = static_equilibrium(force, supports.fixed, prescribed, load, load_steps or 1)
    record.iterations["newton"] = sum(found.iterations)
    record.notes |= {
        "linear solver": " and ".join(_solver_text(one, kernels) for one in sorted(found.solvers)),
        **_path_notes(found),
    }
    record.regularisations += [_dismissed(found.check.dismissed), springs_left_out(force)]
    return at_rest(found.displacement, found.energy)


def _solver_text(solver: str, kernels: Kernels) -> str:
    """Say which linear solver has solved."""
    if kernels is FAST:
        return {"direct": "factorisation", "iterative": "own conjugate gradients"}[solver]
    return {"direct": "SciPy SuperLU", "iterative": "SciPy conjugate gradients"}[solver]


def _path_notes(found: StaticEquilibrium) -> dict[str, str]:
    """Load steps of an equilibrium at finite rotation, and what it was checked by."""
    check = found.check
    stable = "stiffness is singular (slack, or a collapsed piece): not shown"
    compared = "none: the work of loads and supports accounts for the energy"
    if check.compared:
        compared = f"{check.compared} load steps solved again in halves"
    return {
        "load steps": str(len(found.iterations)),
        "stability": "stiffness positive definite" if check.stable else stable,
        "second paths": compared,
    }


def _dismissed(energies: Sequence[float]) -> Regularisation:
    """Report equilibria that were found and left for one of less energy."""
    kind = "equilibrium left for one of less potential energy"
    return Regularisation(kind, len(energies), max(energies, default=0.0), "J")
