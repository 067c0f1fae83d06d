"""Static equilibrium of a cut body, in linear and in corotational kinematics."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.accelerated import FAST
from verify.scene import Scene
from verify.solution import Regularisation
from verify.solvers.body_of_scene import material_of
from verify.solvers.loads_of_scene import loads_of
from verify.solvers.runs import Record, at_rest
from verify.solvers.supports_of_scene import path_of_supports
from verify.solvers.xfem_answer import penalised, springs_left_out
from verify.xfem.equilibrium import StaticEquilibrium, static_equilibrium
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.linear_solvers import Kernels
from verify.xfem.phantom import PhantomMesh
from verify.xfem.statics import solve_static
from verify.xfem.supports import check_bodies

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
        Makes the internal force; other than that of elements it is solved by Newton's method.
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
    if kinematics == "linear" and law is InternalForce:
        ghost = GhostPenalty(body, material) if penalise else None
        static = solve_static(body, material, supports, load, ghost=ghost, kernels=kernels)
        share = static.penalty_energy / max(static.strain_energy, np.finfo(float).tiny)
        record.timings |= static.timings
        record.notes["linear solver"] = _said(static.solver, kernels)
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
        "linear solver": " and ".join(_said(one, kernels) for one in sorted(found.solvers)),
        **_path_notes(found),
        "pieces inside out": _inverted(force, found.displacement),
    }
    record.regularisations += [*_dismissed(found), *springs_left_out(force)]
    return at_rest(found.displacement, found.energy)


def _said(solver: str, kernels: Kernels) -> str:
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


def _dismissed(found: StaticEquilibrium) -> list[Regularisation]:
    """Report equilibria that were found and left for one of less energy."""
    energies = found.check.dismissed
    if not energies:
        return []
    kind = "equilibrium left for one of less potential energy"
    return [Regularisation(kind, len(energies), max(energies), "J")]


def _inverted(force: InternalForce, displacement: NDArray[np.float64]) -> str:
    mesh = force.phantom.mesh
    if mesh.is_membrane:
        return "not defined for a membrane"
    return str(len(inverted_cells(force, displacement)))
