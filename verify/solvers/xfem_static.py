"""Static equilibrium of a cut body, in linear and in corotational kinematics."""

from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.accelerated import FAST
from verify.scene import Scene
from verify.solution import Regularisation
from verify.solvers.body_of_scene import material_of
from verify.solvers.loads_of_scene import loads_of
from verify.solvers.supports_of_scene import path_of_supports, supports_of
from verify.solvers.xfem_answer import penalised
from verify.solvers.xfem_bases import solve_in_basis
from verify.xfem.equilibrium import StaticEquilibrium, static_equilibrium
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce, inverted_cells
from verify.xfem.linear_solvers import Kernels
from verify.xfem.phantom import PhantomMesh
from verify.xfem.statics import solve_static
from verify.xfem.supports import Supports, check_bodies

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Equilibrium:
    """Displacement (N, d) in m, strain energy in J, and how they were found."""

    displacement: _Floats
    strain_energy: float
    timings: dict[str, float]
    iterations: dict[str, int] = field(default_factory=dict)
    notes: dict[str, str] = field(default_factory=dict)
    regularisations: list[Regularisation] = field(default_factory=list)


def solve_equilibrium(
    scene: Scene,
    phantom: PhantomMesh,
    exact: Any,
    basis: str,
    load_steps: int,
    penalise: bool = False,
    kernels: Kernels = FAST,
) -> Equilibrium:
    """Solve a static scene on a cut mesh; with `penalise` with a ghost penalty (linear only).

    Raises
    ------
    XfemError, NotInEquilibriumError
        From the library.
    """
    clock = perf_counter()
    supports = supports_of(scene, phantom, exact)
    load = loads_of(scene, phantom, exact)
    loading = perf_counter() - clock
    if scene.analysis.kinematics == "linear":
        found = _linear(scene, phantom, supports, load, basis, penalise, kernels)
    else:
        found = _corotational(scene, phantom, exact, supports, load, load_steps, kernels)
    return replace(found, timings={"loading": loading, **found.timings})


def _linear(
    scene: Scene,
    phantom: PhantomMesh,
    supports: Supports,
    load: _Floats,
    basis: str,
    penalise: bool,
    kernels: Kernels,
) -> Equilibrium:
    material = material_of(scene, phantom.mesh)
    if basis == "sidewise":
        ghost = GhostPenalty(phantom, material) if penalise else None
        static = solve_static(phantom, material, supports, load, ghost=ghost, kernels=kernels)
        share = static.penalty_energy / max(static.strain_energy, np.finfo(float).tiny)
        notes = {
            "linear solver": _said(static.solver, kernels),
            "residual": f"{static.residual:.3e}",
        }
        return Equilibrium(
            static.displacement,
            static.strain_energy,
            static.timings,
            notes=notes,
            regularisations=penalised(ghost, share),
        )
    other: Any = basis
    displacement, phases = solve_in_basis(phantom, material, supports, load, other)
    energy = InternalForce(phantom, material, "linear").evaluate(displacement)[1]
    return Equilibrium(displacement, energy, phases, notes={"linear solver": "SciPy SuperLU"})


def _corotational(
    scene: Scene,
    phantom: PhantomMesh,
    exact: Any,
    supports: Supports,
    load: _Floats,
    load_steps: int,
    kernels: Kernels,
) -> Equilibrium:
    check_bodies(phantom, supports)
    clock = perf_counter()
    force = InternalForce(phantom, material_of(scene, phantom.mesh), kernels=kernels)
    path = path_of_supports(scene, phantom, exact)
    found = static_equilibrium(
        force, supports.fixed, lambda share: path(share).values, load, load_steps or 1
    )
    notes = {
        "linear solver": " and ".join(_said(one, kernels) for one in sorted(found.solvers)),
        **path_notes(found),
        "pieces inside out": _inverted(force, found.displacement),
    }
    return Equilibrium(
        found.displacement,
        found.energy,
        {"solve": perf_counter() - clock},
        {"newton": sum(found.iterations)},
        notes,
        dismissed_equilibria(found),
    )


def _said(solver: str, kernels: Kernels) -> str:
    """Say which linear solver has solved."""
    if kernels is FAST:
        return {"direct": "factorisation", "iterative": "own conjugate gradients"}[solver]
    return {"direct": "SciPy SuperLU", "iterative": "SciPy conjugate gradients"}[solver]


def path_notes(found: StaticEquilibrium) -> dict[str, str]:
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


def dismissed_equilibria(found: StaticEquilibrium) -> list[Regularisation]:
    """Report equilibria that were found and left for one of less energy."""
    energies = found.check.dismissed
    if not energies:
        return []
    kind = "equilibrium left for one of less potential energy"
    return [Regularisation(kind, len(energies), max(energies), "J")]


def _inverted(force: InternalForce, displacement: _Floats) -> str:
    mesh = force.phantom.mesh
    if mesh.dim < mesh.space:
        return "not defined for a membrane"
    return str(len(inverted_cells(force, displacement)))
