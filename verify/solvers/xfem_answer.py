"""Equilibria of a cut body, and its fields as a neutral solution with all that was changed."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from verify.accelerated import FAST
from verify.scene import Scene
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import material_of
from verify.solvers.boundary_conditions import loads_of, path_of_supports, support_ends
from verify.solvers.runs import Record, across_interfaces, at_rest
from verify.solvers.xfem_system import contact_of, faces_of
from verify.xfem.clip import ROUND_OFF_SHARE
from verify.xfem.closing import solve_closed
from verify.xfem.equilibrium import StaticEquilibrium, static_equilibrium
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import Kernels
from verify.xfem.loads_and_supports import check_bodies
from verify.xfem.phantom import PhantomMesh
from verify.xfem.slivers import Fragments, treat_slivers
from verify.xfem.statics import solve_static
from verify.xfem.subdivision import Subdivision, extrapolation, subdivide


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
    body = resisting or phantom
    material, kinematics = material_of(scene, body.mesh), scene.analysis.kinematics
    if (faces := faces_of(scene, phantom, penalise)) is not None:
        with record.timed("solve"):
            elastic = InternalForce(body, material, "linear", kernels)
            closed = solve_closed(elastic, faces, supports, load)
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
        found = static_equilibrium(
            force, supports.fixed, lambda share: path(share).values, load, load_steps or 1
        )
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
