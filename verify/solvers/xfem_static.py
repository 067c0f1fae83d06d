"""Static equilibrium of a cut body, in linear and in corotational kinematics."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene
from verify.solution import Regularisation
from verify.solvers.xfem_answer import penalised
from verify.solvers.xfem_bases import solve_in_basis
from verify.solvers.xfem_loads import loads_of
from verify.solvers.xfem_scene import material_of
from verify.solvers.xfem_supports import supports_of
from verify.xfem.corotation import InternalForce
from verify.xfem.slivers import GhostPenalty
from verify.xfem.statics import (
    NotInEquilibriumError,
    StaticEquilibrium,
    solve_static,
    static_equilibrium,
)
from verify.xfem.stiffness import LinearStiffness
from verify.xfem.supports import Supports, check_bodies
from verify.xfem.virtual import VirtualMesh

__all__ = ["Equilibrium", "in_load_steps", "solve_equilibrium"]

_Floats = NDArray[np.float64]

_MOST_LOAD_STEPS = 64


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
    virtual: VirtualMesh,
    exact: Any,
    basis: str,
    load_steps: int,
    penalise: bool = False,
) -> Equilibrium:
    """Solve a static scene on a cut mesh; with `penalise` with a ghost penalty (linear only).

    Raises
    ------
    XfemError, NotInEquilibriumError
        From the library.
    """
    clock = perf_counter()
    supports = supports_of(scene, virtual, exact)
    load = loads_of(scene, virtual, exact)
    loading = perf_counter() - clock
    if scene.analysis.kinematics == "linear":
        found = _linear(scene, virtual, supports, load, basis, penalise)
    else:
        found = _corotational(scene, virtual, exact, supports, load, load_steps)
    return replace(found, timings={"loading": loading, **found.timings})


def _linear(
    scene: Scene,
    virtual: VirtualMesh,
    supports: Supports,
    load: _Floats,
    basis: str,
    penalise: bool,
) -> Equilibrium:
    material = material_of(scene)
    if basis == "sidewise":
        ghost = GhostPenalty(virtual, material) if penalise else None
        static = solve_static(virtual, material, supports, load, ghost=ghost)
        share = static.penalty_energy / max(static.strain_energy, np.finfo(float).tiny)
        own = "sparse Cholesky" if static.solver == "direct" else "conjugate gradients"
        notes = {"linear solver": f"own {own}", "residual": f"{static.residual:.3e}"}
        return Equilibrium(
            static.displacement,
            static.strain_energy,
            static.timings,
            notes=notes,
            regularisations=penalised(ghost, share),
        )
    other: Any = basis
    displacement, phases = solve_in_basis(virtual, material, supports, load, other)
    energy = LinearStiffness(virtual, material).force(displacement)[1]
    return Equilibrium(displacement, energy, phases, notes={"linear solver": "SciPy SuperLU"})


def _corotational(
    scene: Scene,
    virtual: VirtualMesh,
    exact: Any,
    supports: Supports,
    load: _Floats,
    load_steps: int,
) -> Equilibrium:
    check_bodies(virtual, supports)
    clock = perf_counter()
    force = InternalForce(virtual, material_of(scene))

    def prescribed(share: float) -> _Floats:
        return supports_of(scene, virtual, exact, share).values

    found, steps = in_load_steps(force, supports.fixed, prescribed, load, load_steps)
    notes = {
        "linear solver": "own sparse Cholesky",
        "load steps": str(steps),
        "pieces inside out": _inverted(force, found.displacement),
    }
    return Equilibrium(
        found.displacement,
        found.energy,
        {"solve": perf_counter() - clock},
        {"newton": sum(found.iterations)},
        notes,
    )


def in_load_steps(
    force: InternalForce,
    fixed: NDArray[np.bool_],
    prescribed: Callable[[float], _Floats],
    load: _Floats,
    load_steps: int,
) -> tuple[StaticEquilibrium, int]:
    """Find the equilibrium in as many load steps as asked for, or (0) as few as do.

    Raises
    ------
    NotInEquilibriumError
        If the steps asked for, or the most that are tried, do not lead there.
    """
    steps = load_steps or 1
    while True:
        try:
            return static_equilibrium(force, fixed, prescribed, load, steps), steps
        except NotInEquilibriumError:
            if load_steps or steps >= _MOST_LOAD_STEPS:
                raise
            steps *= 2


def _inverted(force: InternalForce, displacement: _Floats) -> str:
    mesh = force.virtual.mesh
    if mesh.dim < mesh.space:
        return "not defined for a membrane"
    return str(len(force.inverted(displacement)))
