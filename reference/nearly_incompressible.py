"""Linear elasticity with the pressure as an unknown, which does not lock as ν goes to ½.

Stationary for ∫ μ ε:ε + p div u − p² / 2λ less the work of the loads, whose p is λ div u: with
quadratic displacements and linear pressures the error is bounded evenly in λ (Brezzi & Fortin,
Mixed and Hybrid Finite Element Methods, 1991, VI).
"""

from time import perf_counter
from typing import Any, Literal

import numpy as np

from reference.boundary_values import constrained_values
from reference.elasticity import LinearSolve, held_system, load_form
from reference.linear_solvers import solve_directly, symmetric_solver
from reference.mixed_solver import solve_saddle
from reference.mixed_space import MixedSpace, mixed_space
from reference.moduli import lame
from reference.space import ConformingSpace
from reference.weak_place import naming_weak_places
from verify.errors import InputError
from verify.scene import Material, Scene

# Poisson's ratio from which the pressure pays, measured: docs/theory/reference.md
LEAST_POISSON = 0.45
# unknowns in space up to which the saddle point is factorised
_MOST_DIRECT = 60_000


def wants_pressure(scene: Scene, degree: int) -> bool:
    """Whether a scene is solved better with a pressure.

    In plane stress nothing locks: the sheet is free to become thicker. The pressure is continuous,
    but jumps where materials meet: several materials are solved without.
    """
    material = scene.material
    if degree != 2 or material.plane == "stress" or not material.is_uniform:
        return False
    return material.poisson >= LEAST_POISSON


def solve_mixed(
    scene: Scene,
    space: ConformingSpace,
    exact: Any,
    method: Literal["direct", "multigrid"] | None = None,
    tolerance: float = 1e-10,
) -> LinearSolve:
    """Solve the linear static problem of `scene` for displacement and pressure.

    Parameters
    ----------
    scene, space, exact, method, tolerance
        As for `reference.elasticity.solve_linear`, but in plane strain or in space, on a space of
        degree 2, and multigrid is MINRES with GAMG for the displacements.

    Raises
    ------
    InputError
        If a support or load acts nowhere, a piece of the body is not held, or ν is not positive.
    RuntimeError
        If PETSc did not solve the system; the message says why.
    """
    import ufl
    from dolfinx import fem

    if not scene.material.poisson > 0:
        raise InputError(
            f"material.poisson {scene.material.poisson}; a pressure expects it above 0",
            str(scene.file or ""),
        )
    if not scene.material.is_uniform:
        raise InputError("a pressure expects one material", str(scene.file or ""))
    start = perf_counter()
    mixed = mixed_space(space)
    W = mixed.function_space
    held = constrained_values(scene, space, exact)
    tests = ufl.TestFunctions(W)
    load = fem.form(load_form(scene, space, tests[0], exact))
    form = fem.form(saddle_form(scene.material, ufl.TrialFunctions(W), tests))
    matrix, vector, solution = held_system(form, load, mixed, *held)
    x = solution.x.petsc_vec
    timings = {"assembly": perf_counter() - start}
    if method is None:
        small = space.dimension == 2 or W.dofmap.index_map.size_global <= _MOST_DIRECT
        method = "direct" if small else "multigrid"
    if method == "direct":
        solver = symmetric_solver(matrix)
        with naming_weak_places(scene, space, mixed):
            answer = solve_directly(solver, matrix, x, vector)
        solver.destroy()
    else:
        weight = _pressure_mass(scene.material, mixed)
        answer = solve_saddle(matrix, weight, mixed, x, vector, tolerance)
        weight.destroy()
    timings["solve"] = perf_counter() - start - timings["assembly"]
    solution.x.scatter_forward()
    u, p = ufl.split(solution)
    lam, mu = lame(scene.material)
    strain = ufl.sym(ufl.grad(u))
    density = mu * ufl.inner(strain, strain) + p**2 / (2 * lam)
    stored = fem.assemble_scalar(fem.form(density * ufl.dx))
    energy = W.mesh.comm.allreduce(float(np.real(stored)))
    displacement = mixed.everywhere(np.asarray(x.array, dtype=float))
    for entry in (matrix, vector):
        entry.destroy()
    return LinearSolve(displacement, energy, answer, timings)


def saddle_form(material: Material, trial: Any, test: Any) -> Any:
    """Write the virtual work of displacement and pressure, (u, p) against (v, q)."""
    import ufl
    from dolfinx import fem

    (u, p), (v, q) = trial, test
    domain = ufl.domain.extract_unique_domain(v)
    lam, mu = (fem.Constant(domain, value) for value in lame(material))
    work = 2 * mu * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v)))
    return (work + p * ufl.div(v) + q * ufl.div(u) - p * q / lam) * ufl.dx


def _pressure_mass(material: Material, mixed: MixedSpace) -> Any:
    """Mass of the pressures over 2μ and λ in series: spectrally like their Schur complement."""
    import ufl
    from dolfinx import fem
    from dolfinx.fem import petsc

    W = mixed.function_space
    lam, mu = lame(material)
    p, q = ufl.TrialFunctions(W)[1], ufl.TestFunctions(W)[1]
    share = fem.Constant(W.mesh, 1 / (2 * mu) + 1 / lam)
    matrix = petsc.assemble_matrix(fem.form(share * p * q * ufl.dx))
    matrix.assemble()
    return matrix
