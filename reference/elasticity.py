"""Linear statics on a conforming mesh with DOLFINx, in the plane and in space.

From `LEAST_POISSON` on with the pressure as an unknown, which does not lock as ν goes to ½.
"""

from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from reference.boundary_conditions import constrained_values, load_form
from reference.contact import FaceContact, pressures
from reference.deformation import lame
from reference.inside_out import naming_weak_places
from reference.law import Law, mass_matrix
from reference.linear_solvers import (
    Answer,
    answers_of,
    factorised,
    mean_stiffness,
    solve_by_multigrid,
    solve_directly,
    solve_saddle,
)
from reference.nodal_algebra import assembled_matrix, nodal_forces
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.geometry.simplices import measures
from verify.scene import Material, Scene
from verify.solution import ContactPressure

# Poisson's ratio from which the pressure pays, measured: docs/theory/reference.md
LEAST_POISSON = 0.45
# Unknowns in space up to which MUMPS was measured to be quicker (in the plane it always is)
_MOST_DIRECT = 30_000
_MOST_DIRECT_MIXED = 60_000
# Volume over the cube of the longest edge, below which a cell is flat: a regular tetrahedron has
# 0.12, tetrahedra of a split cube 0.03
_FLAT = 0.01


@dataclass(frozen=True)
class LinearSolve:
    """A solved linear problem.

    Attributes
    ----------
    displacement : (n, d) array
        At the nodes of the space, m; the same on every rank.
    strain_energy : float
        J; in the plane per metre of thickness.
    answer : Answer
        How well the system was solved, and by what.
    timings : dict of str to float
        Seconds by phase.
    contact : ContactPressure or None
        Of a scene with contact.
    changes : int
        Iterations of its active set.
    """

    displacement: NDArray[np.float64]
    strain_energy: float
    answer: Answer
    timings: dict[str, float] = field(default_factory=dict)
    contact: ContactPressure | None = None
    changes: int = 0


def wants_pressure(scene: Scene, degree: int) -> bool:
    """Tell whether a scene is solved better with a pressure.

    In plane stress nothing locks: the sheet is free to become thicker. The pressure is continuous,
    but jumps where materials meet: several materials are solved without.
    """
    material = scene.material
    if degree != 2 or material.plane == "stress" or not material.is_uniform:
        return False
    return material.poisson >= LEAST_POISSON


def solve_linear(
    scene: Scene,
    space: ConformingSpace,
    exact: Any,
    method: Literal["direct", "multigrid"] | None = None,
    tolerance: float = 1e-10,
    pressure: bool = False,
) -> LinearSolve:
    """Solve the linear static problem of `scene` on `space`.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
    exact : ExactSolution or None
        For supports and loads that take the exact solution.
    method : {"direct", "multigrid"}, optional
        MUMPS, or CG with multigrid (with a pressure MINRES with GAMG); default by
        the number of unknowns.
    tolerance : float
        Of multigrid: the norm of the true residual over the norm of the loads.
    pressure : bool
        Whether the pressure is an unknown: in plane strain or in space, on a space of degree 2.

    Raises
    ------
    InputError
        If a support or load acts nowhere, or a piece of the body is not held, or part of it so
        weakly that round-off is all there is; with a pressure, if ν is not positive.
    RuntimeError
        If PETSc did not solve the system; the message says why.
    """
    import ufl
    from dolfinx import fem

    if pressure:
        _check_pressure(scene)
    law = Law(scene.material, space, "linear", pressure)
    unknowns, (held, values) = law.unknowns, constrained_values(scene, space, exact)
    load = fem.form(load_form(scene, space, ufl.TestFunction(space.function_space), exact))
    start = perf_counter()
    matrix = assembled_matrix(law.stiffness_form)
    most = _MOST_DIRECT_MIXED if pressure else _MOST_DIRECT
    small = space.dimension == 2 or matrix.getSize()[0] <= most or scene.contact.closed
    touched: tuple[ContactPressure | None, int] = (None, 0)
    x, vector = law.solution.x.petsc_vec, matrix.createVecLeft()
    vector.array[:] = unknowns.own_part(nodal_forces(load, space))
    own, at = unknowns.own_unknowns(held)
    x.array[own] = values[at]
    # symmetric elimination; the free rows keep their equilibrium, and any component can be held
    matrix.zeroRowsColumns(unknowns.rows(held), mean_stiffness(matrix), x, vector)
    timings = {"assembly": perf_counter() - start}
    if method == "direct" or (method is None and small):
        solver = factorised(matrix, "symmetric" if pressure else "definite")
        timings["factorisation"] = perf_counter() - start - timings["assembly"]
        with naming_weak_places(scene, space, unknowns):
            answer = solve_directly(solver, matrix, x, vector)
            if scene.contact.closed:
                before = perf_counter()
                touched = _press(space, unknowns, held, (solver, matrix, x, vector))
                answer = solve_directly(solver, matrix, x, vector)
                timings["contact"] = perf_counter() - before
        solver.destroy()
    elif pressure:
        weight = _pressure_mass(scene.material, law)
        answer = solve_saddle(matrix, weight, space, unknowns, x, vector, tolerance)
        weight.destroy()
    else:
        flat = _unknowns_of_flat_cells(matrix, space)
        answer = solve_by_multigrid(matrix, space, x, vector, tolerance, flat)
    timings["solve"] = perf_counter() - start - sum(timings.values())
    law.update()
    found = LinearSolve(unknowns.everywhere(x.array), law.stored(), answer, timings, *touched)
    for entry in (matrix, vector):
        entry.destroy()
    return found


def _press(
    space: ConformingSpace, unknowns: Any, held: NDArray[np.int32], system: tuple[Any, ...]
) -> tuple[ContactPressure, int]:
    """Find the pressures of the faces of cuts, and add their forces to the right side.

    Parameters
    ----------
    held : (h,) int array
        Scalar displacements that are prescribed.
    system : solver, matrix, x and vector of PETSc
        Solved without contact.
    """
    solver, _, x, vector = system
    faces = FaceContact(space, held)
    forces, solve = answers_of(solver, unknowns, unknowns.own_unknowns(held)[0])
    gaps = faces.gaps @ unknowns.everywhere(x.array).ravel()
    found, changes = pressures(faces.compliance(solve), gaps)
    vector.array[:] += forces(faces.gaps.T @ found)
    return ContactPressure(faces.points, faces.weights, found[None]), changes


def _unknowns_of_flat_cells(matrix: Any, space: ConformingSpace) -> NDArray[np.int32]:
    """Unknowns of this process, by their numbers in the matrix, of nodes of cells that are flat."""
    corners = space.mesh.points[space.mesh.cells]
    lengths = [
        np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i in range(4) for j in range(i)
    ]
    flat = measures(corners) < _FLAT * np.max(lengths, axis=0) ** 3
    touched = np.zeros(len(space.node_points), dtype=bool)
    touched[space.cell_nodes[flat]] = True
    nodes = np.flatnonzero(touched[space.node_of_dof[: space.owned]])
    first, d = matrix.getOwnershipRange()[0], space.dimension
    return np.asarray(first + d * nodes[:, None] + np.arange(d), dtype=np.int32).ravel()


def linear_system(
    scene: Scene, space: ConformingSpace, exact: Any
) -> tuple[csr_array, csr_array | None, NDArray[np.bool_]]:
    """Make the stiffness, consistent mass and held unknowns of a scene, in one process.

    Returns
    -------
    stiffness : (k, k) csr_array
        N/m.
    mass : (k, k) csr_array or None
        kg; None where the scene states no density.
    held : (k,) bool array
    """
    material = scene.material
    held = np.zeros(space.node_points.size, dtype=bool)
    held[constrained_values(scene, space, exact)[0]] = True
    mass = None if material.density is None else _as_array(mass_matrix(material, space))
    return _as_array(assembled_matrix(Law(material, space, "linear").stiffness_form)), mass, held


def _as_array(matrix: Any) -> csr_array:
    starts, columns, values = matrix.getValuesCSR()
    array = csr_array((values, columns, starts), shape=matrix.getSize())
    matrix.destroy()
    return array


def _check_pressure(scene: Scene) -> None:
    where = str(scene.file or "")
    if not scene.material.poisson > 0:
        raise InputError(
            f"material.poisson {scene.material.poisson}; a pressure expects it above 0", where
        )
    if not scene.material.is_uniform:
        raise InputError("a pressure expects one material", where)


def _pressure_mass(material: Material, law: Law) -> Any:
    """Mass of the pressures over 2μ and λ in series: spectrally like their Schur complement."""
    import ufl
    from dolfinx import fem

    d = law.unknowns.shape[1]
    lam, mu = lame(material)
    share = fem.Constant(law.unknowns.function_space.mesh, 1 / (2 * mu) + 1 / lam)
    return assembled_matrix(share * law.trial[d] * law.test[d] * ufl.dx)
