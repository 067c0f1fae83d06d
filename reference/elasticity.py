"""Plane linear elasticity on a conforming mesh with DOLFINx, solved directly by MUMPS."""

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.boundary_values import constrained_values
from reference.space import ConformingSpace
from verify.scene import BodyForce, Gravity, Material, Scene, Traction
from verify.scene.parts import on_part

__all__ = [
    "LinearSolve",
    "direct_solver",
    "load_form",
    "plane_lame",
    "solve_linear",
    "stiffness_form",
]

_LARGEST_CORRECTION = 1e-6  # relative; a direct solve of a regular system stays far below it


@dataclass(frozen=True)
class LinearSolve:
    """A solved linear problem.

    Attributes
    ----------
    displacement : (n, 2) array
        At the nodes of the space, m.
    strain_energy : float
        J per metre of thickness.
    round_off : float
        Relative size of the last correction by iterative refinement: what the solve is good to.
    timings : dict of str to float
        Seconds by phase.
    """

    displacement: NDArray[np.float64]
    strain_energy: float
    round_off: float
    timings: dict[str, float] = field(default_factory=dict)


def solve_linear(scene: Scene, space: ConformingSpace, exact: Any) -> LinearSolve:
    """Solve the linear static problem of `scene` on `space`.

    Raises
    ------
    InputError
        If a support or load acts nowhere, or a piece of the body is not held.
    RuntimeError
        If PETSc did not solve the system; the message says why.
    """
    import ufl
    from dolfinx import fem
    from dolfinx.fem import petsc

    V = space.function_space
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    unknowns, values = constrained_values(scene, space, exact)
    a = fem.form(stiffness_form(scene.material, u, v))
    load = fem.form(load_form(scene, space, v, exact))

    start = perf_counter()
    matrix = petsc.assemble_matrix(a)
    matrix.assemble()
    vector = petsc.assemble_vector(load)
    solution = fem.Function(V)
    x = solution.x.petsc_vec
    x.array[unknowns] = values
    # symmetric elimination; the free rows keep their equilibrium, and any component can be held
    matrix.zeroRowsColumns(unknowns, 1.0, x, vector)
    assembled = perf_counter()
    solver = direct_solver(matrix)
    factored = perf_counter()
    solver.solve(vector, x)
    solved = perf_counter()
    round_off = _refine(solver, matrix, x, vector)
    energy = fem.form(0.5 * stiffness_form(scene.material, solution, solution))
    result = LinearSolve(
        np.array(solution.x.array, dtype=float).reshape(-1, 2),
        float(np.real(fem.assemble_scalar(energy))),
        round_off,
        {
            "assembly": assembled - start,
            "factorisation": factored - assembled,
            "solve": solved - factored,
        },
    )
    for entry in (solver, matrix, vector):
        entry.destroy()
    return result


def stiffness_form(material: Material, u: Any, v: Any) -> Any:
    """Write the virtual work ∫ σ(u) : ε(v) of plane linear elasticity."""
    import ufl
    from dolfinx import fem

    # constants, so that another material does not compile another form
    domain = ufl.domain.extract_unique_domain(v)
    lam, mu = (fem.Constant(domain, value) for value in plane_lame(material))
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + lam * ufl.tr(strain) * ufl.Identity(2)
    return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx


def load_form(scene: Scene, space: ConformingSpace, v: Any, exact: Any) -> Any:
    """Sum up the linear form of all loads of a scene for the test function `v`."""
    import ufl
    from dolfinx import fem

    domain = space.function_space.mesh
    form = ufl.inner(fem.Constant(domain, np.zeros(2)), v) * ufl.dx
    tractions = {
        i: _facets(scene, space, load, f"loads[{i}].where")
        for i, load in enumerate(scene.loads)
        if isinstance(load, Traction)
    }
    # all parts in one measure: DOLFINx takes one set of subdomains per form
    ds = ufl.Measure("ds", domain=domain, subdomain_data=list(tractions.items()))
    for i, load in enumerate(scene.loads):
        if isinstance(load, Gravity):
            assert scene.material.density is not None  # the scene has checked it
            weight = scene.material.density * np.asarray(load.acceleration)
            form += ufl.inner(fem.Constant(domain, weight), v) * ufl.dx
        elif isinstance(load, BodyForce):
            force = (
                _sided_function(space, exact.body_force, (2,))
                if load.force == "exact"
                else fem.Constant(domain, np.asarray(load.force, dtype=float))
            )
            form += ufl.inner(force, v) * ufl.dx
        elif load.traction == "exact":
            stress = _sided_function(space, exact.stress, (2, 2))
            form += ufl.inner(stress * ufl.FacetNormal(domain), v) * ds(i)
        else:
            traction = fem.Constant(domain, np.asarray(load.traction, dtype=float))
            form += ufl.inner(traction, v) * ds(i)
    return form


def _facets(scene: Scene, space: ConformingSpace, load: Traction, key: str) -> NDArray[np.int32]:
    """Find the facets that a traction acts on, as DOLFINx's pairs of cell and local facet."""
    cell, opposite = space.mesh.boundary.T
    ends = space.mesh.cells[cell[:, None], (opposite[:, None] + [1, 2]) % 3]
    corners = np.unique(ends)
    mark = np.zeros(len(space.mesh.points), dtype=bool)
    mark[corners[on_part(scene, load.where, space.mesh.points[corners], key)]] = True
    chosen = mark[ends].all(axis=1)
    # facet i lies opposite corner i
    pairs = np.column_stack([space.dolfinx_cell[cell[chosen]], opposite[chosen]])
    return pairs[np.argsort(pairs[:, 0], kind="stable")].astype(np.int32).ravel()


def _sided_function(space: ConformingSpace, values: Any, shape: tuple[int, ...]) -> Any:
    """Interpolate an exact field by discontinuous quartics, each cell on its own side."""
    from dolfinx import fem

    broken = fem.functionspace(space.function_space.mesh, ("DG", 4, shape))
    nodes = np.asarray(broken.dofmap.list, dtype=np.int64)[space.dolfinx_cell]
    points = broken.tabulate_dof_coordinates()[:, :2]
    near = np.empty_like(points)
    near[nodes] = space.centroids[:, None, :]
    function = fem.Function(broken)
    function.x.array[:] = values(points, near).ravel()
    return function


def plane_lame(material: Material) -> tuple[float, float]:
    """Lamé constants (λ, μ) in Pa; λ is the reduced one in plane stress."""
    mu = material.young / (2 * (1 + material.poisson))
    lam = material.young * material.poisson / ((1 + material.poisson) * (1 - 2 * material.poisson))
    return (lam, mu) if material.plane == "strain" else (2 * lam * mu / (lam + 2 * mu), mu)


def direct_solver(matrix: Any) -> Any:
    """Factorise a symmetric positive definite matrix by MUMPS; gives a PETSc KSP."""
    from petsc4py import PETSc

    matrix.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    solver.getPC().setType("cholesky")
    solver.getPC().setFactorSolverType("mumps")
    solver.setUp()
    return solver


def _refine(solver: Any, matrix: Any, x: Any, vector: Any) -> float:
    """Refine x by two residual corrections; return the relative size of the last one.

    The correction estimates the error itself, which the residual of a stiff system does not.
    """
    reason = solver.getConvergedReason()
    residual, correction = vector.duplicate(), x.duplicate()
    size = 0.0
    for _ in range(2):
        matrix.mult(x, residual)
        residual.aypx(-1.0, vector)
        solver.solve(residual, correction)
        size = float(correction.norm() / (x.norm() or 1.0))
        x.axpy(1.0, correction)
    residual.destroy()
    correction.destroy()
    if reason < 0 or not size <= _LARGEST_CORRECTION:
        raise RuntimeError(
            f"MUMPS did not solve the system (PETSc reason {reason}, a refined solution differs "
            f"by {size:.1e})"
        )
    return size
