"""Linear elasticity on a conforming mesh with DOLFINx, in the plane and in space."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from reference.boundary_values import constrained_values
from reference.face_loads import cut_facets_of
from reference.linear_solvers import (
    Answer,
    direct_solver,
    near_null_space,
    solve_by_multigrid,
    solve_directly,
)
from reference.moduli import density, lame_constants
from reference.part_loads import LoadedFacets, density_on_whole, loaded_facets
from reference.space import ConformingSpace, SharedUnknowns
from reference.weak_place import naming_weak_places
from verify.errors import InputError
from verify.scene import BodyForce, CutFaces, Gravity, Material, Scene, Traction, is_uniform

# Unknowns in space up to which MUMPS was measured to be quicker (in the plane it always is)
_MOST_DIRECT = 30_000
# marks of the faces of cuts in a measure, beyond those of the loads on the boundary
_FACE = 1_000_000
_PART = 2_000_000  # and of facets in which loads end


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
    """

    displacement: NDArray[np.float64]
    strain_energy: float
    answer: Answer
    timings: dict[str, float] = field(default_factory=dict)


def solve_linear(
    scene: Scene,
    space: ConformingSpace,
    exact: Any,
    method: Literal["direct", "multigrid"] | None = None,
    tolerance: float = 1e-10,
) -> LinearSolve:
    """Solve the linear static problem of `scene` on `space`.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
    exact : ExactSolution or None
        For supports and loads that are said to be exact.
    method : {"direct", "multigrid"}, optional
        MUMPS, or CG with GAMG; default by the number of unknowns.
    tolerance : float
        Of multigrid: the norm of the true residual over that of the loads.

    Raises
    ------
    InputError
        If a support or load acts nowhere, or a piece of the body is not held, or part of it so
        weakly that round-off is all there is.
    RuntimeError
        If PETSc did not solve the system; the message says why.
    """
    import ufl
    from dolfinx import fem

    V, d = space.function_space, space.dimension
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    held = constrained_values(scene, space, exact)
    a = fem.form(stiffness_form(scene.material, u, v))
    load = fem.form(load_form(scene, space, v, exact))
    if method is None:
        small = d == 2 or space.node_points.size <= _MOST_DIRECT
        method = "direct" if small else "multigrid"

    start = perf_counter()
    matrix, vector, solution = held_system(a, load, space, *held)
    x = solution.x.petsc_vec
    assembled = perf_counter()
    timings = {"assembly": assembled - start}
    if method == "direct":
        solver = direct_solver(matrix)
        timings["factorisation"] = perf_counter() - assembled
        with naming_weak_places(scene, space):
            answer = solve_directly(solver, matrix, x, vector)
        solver.destroy()
    else:
        matrix.setNearNullSpace(near_null_space(matrix, space))
        answer = solve_by_multigrid(matrix, x, vector, tolerance)
    timings["solve"] = perf_counter() - start - sum(timings.values())
    solution.x.scatter_forward()
    energy = fem.form(0.5 * stiffness_form(scene.material, solution, solution))
    stored = V.mesh.comm.allreduce(float(np.real(fem.assemble_scalar(energy))))
    displacement = space.everywhere(np.asarray(x.array, dtype=float))
    for entry in (matrix, vector):
        entry.destroy()
    return LinearSolve(displacement, stored, answer, timings)


def held_system(
    form: Any,
    load: Any,
    unknowns: SharedUnknowns,
    held: NDArray[np.int32],
    values: NDArray[np.float64],
) -> tuple[Any, Any, Any]:
    """Assemble a symmetric system of which some displacements are known.

    Parameters
    ----------
    form, load : compiled forms
    unknowns : SharedUnknowns
    held : (h,) int array
        Scalar displacements, by nodes.
    values : (h,) array
        m.

    Returns
    -------
    matrix, vector : PETSc Mat and Vec
    solution : dolfinx.fem.Function
        The known values, and zeros.
    """
    from dolfinx import fem
    from dolfinx.fem import petsc

    matrix = petsc.assemble_matrix(form)
    matrix.assemble()
    vector = petsc.assemble_vector(load)
    vector.ghostUpdate(addv=True, mode="reverse")
    solution = fem.Function(unknowns.function_space)
    x = solution.x.petsc_vec
    own, at = unknowns.own_unknowns(held)
    x.array[own] = values[at]
    # symmetric elimination; the free rows keep their equilibrium, and any component can be held
    matrix.zeroRowsColumns(unknowns.rows(held), mean_stiffness(matrix), x, vector)
    return matrix, vector, solution


def stiffness_form(material: Material, u: Any, v: Any) -> Any:
    """Write the virtual work ∫ σ(u) : ε(v) of linear elasticity."""
    import ufl

    lam, mu = lame_constants(material, v)
    strain = ufl.sym(ufl.grad(u))
    stress = 2 * mu * strain + lam * ufl.tr(strain) * ufl.Identity(len(u))
    return ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx


def mass_form(material: Material, u: Any, v: Any, where: str = "") -> Any:
    """Write the virtual work ∫ ρ u · v of an acceleration u.

    Raises
    ------
    InputError
        If there is no density; `where` names the case file.
    """
    import ufl

    if material.density is None:
        raise InputError("material.density is missing: motion and vibration need it", where)
    return density(material, v) * ufl.inner(u, v) * ufl.dx


def load_form(scene: Scene, space: ConformingSpace, v: Any, exact: Any, time: float = 0.0) -> Any:
    """Sum up the linear form of all loads of a scene at a time for the test function `v`."""
    import ufl
    from dolfinx import fem

    exact = None if exact is None else exact.at(time)
    domain = space.function_space.mesh
    form = ufl.inner(fem.Constant(domain, np.zeros(space.dimension)), v) * ufl.dx
    thickness = scene.material.thickness or 1.0  # loads of a membrane are per volume and area too
    tractions: dict[int, NDArray[np.int32]] = {}
    parted: dict[int, list[tuple[int, Any]]] = {}
    for i, load in enumerate(scene.loads):
        if isinstance(load, Traction):
            loaded = loaded_facets(scene, space, load, f"loads[{i}].where")
            tractions[i] = _pairs(space, *space.mesh.boundary[loaded.whole].T)
            parted[i] = []
            for corner, pairs, given in _parted(space, loaded, load, exact, time):
                mark = _PART + 4 * i + corner
                tractions[mark] = pairs
                parted[i].append((mark, given))
    for i, load in enumerate(scene.loads):
        if isinstance(load, CutFaces):
            cell, opposite, positive = cut_facets_of(scene, space, load, f"loads[{i}]")
            tractions[_FACE + 2 * i] = _pairs(space, cell[positive], opposite[positive])
            tractions[_FACE + 2 * i + 1] = _pairs(space, cell[~positive], opposite[~positive])
    # all parts in one measure: DOLFINx takes one set of subdomains per form
    ds = ufl.Measure("ds", domain=domain, subdomain_data=list(tractions.items()))
    for i, load in enumerate(scene.loads):
        if isinstance(load, Gravity):
            acceleration = fem.Constant(domain, np.asarray(load.acceleration, dtype=float))
            form += density(scene.material, v) * ufl.inner(acceleration, v) * ufl.dx
        elif isinstance(load, BodyForce):
            force = (
                _sided_function(space, exact.body_force, (space.dimension,))
                if load.force == "exact"
                else thickness * _density(space, load, load.force, time)
            )
            form += ufl.inner(force, v) * ufl.dx
        elif isinstance(load, CutFaces):
            given = _face_density(space, load, time)
            one, other = ds(_FACE + 2 * i), ds(_FACE + 2 * i + 1)
            if load.traction is None:
                form -= given[0] * ufl.inner(ufl.FacetNormal(domain), v) * (one + other)
            else:
                form += ufl.inner(given, v) * one - ufl.inner(given, v) * other
        elif load.traction == "exact":
            stress = _sided_function(space, exact.stress, (space.dimension,) * 2)
            form += ufl.inner(stress * ufl.FacetNormal(domain), v) * ds(i)
        else:
            traction = thickness * _density(space, load, load.traction, time)
            form += ufl.inner(traction, v) * ds(i)
        for mark, given in parted.get(i, []):
            form += thickness * ufl.inner(given, v) * ds(mark)
    return form


def _parted(
    space: ConformingSpace, loaded: LoadedFacets, load: Traction, exact: Any, time: float
) -> Iterator[tuple[int, NDArray[np.int32], Any]]:
    """Facets in which a load ends, with their densities: corner opposite, pairs and a function.

    Those of one function are opposite to the same corner: no cell has two of them.
    """
    from dolfinx import fem

    if not len(loaded.ended):
        return
    domain = space.function_space.mesh
    broken = fem.functionspace(domain, ("DG", space.degree, (space.dimension,)))
    for corner in np.unique(space.mesh.boundary[loaded.ended, 1]):
        mine = loaded.opposite_to(space, int(corner))
        values = density_on_whole(space, mine, load, exact, time)
        cell, opposite = space.mesh.boundary[mine.ended].T
        here = space.dolfinx_cell[cell] >= 0
        function = fem.Function(broken)
        at = space.broken_facet_dofs(broken, cell[here], opposite[here])
        function.x.array.reshape(-1, space.dimension)[at] = values[here]
        yield int(corner), _pairs(space, cell[here], opposite[here]), function


def _density(space: ConformingSpace, load: BodyForce | Traction, given: Any, time: float) -> Any:
    """Give a force per volume or area as a constant, or interpolated if it is a formula."""
    from dolfinx import fem

    if is_uniform(given):
        return fem.Constant(space.function_space.mesh, np.asarray(given, dtype=float))
    values = lambda points, _near: load.values(points, time)  # noqa: E731
    return _sided_function(space, values, (space.dimension,))


def _face_density(space: ConformingSpace, load: CutFaces, time: float) -> Any:
    """Give what acts on the faces of a cut as a vector: a pressure (1,) or a traction (d,)."""
    from dolfinx import fem

    if is_uniform(load.components):
        given = np.asarray(load.components, dtype=float)
        return fem.Constant(space.function_space.mesh, given)
    shape = (len(load.components),)
    return _sided_function(space, lambda points, _near: load.given(points, time), shape)


def _pairs(
    space: ConformingSpace, cell: NDArray[np.int64], opposite: NDArray[np.int64]
) -> NDArray[np.int32]:
    """DOLFINx's pairs of cell and local facet of the facets opposite to corners of cells."""
    # facet i lies opposite corner i; other ranks integrate over their cells themselves
    pairs = np.column_stack([space.dolfinx_cell[cell], opposite])
    own = space.function_space.mesh.topology.index_map(space.mesh.cell_dimension).size_local
    pairs = pairs[(pairs[:, 0] >= 0) & (pairs[:, 0] < own)]
    return pairs[np.argsort(pairs[:, 0], kind="stable")].astype(np.int32).ravel()


def _sided_function(space: ConformingSpace, values: Any, shape: tuple[int, ...]) -> Any:
    """Interpolate an exact field by discontinuous polynomials, each cell on its own side."""
    from dolfinx import fem

    d = space.dimension
    degree = 4 if d == 2 else space.degree + 1  # in space quartics would take gigabytes
    broken = fem.functionspace(space.function_space.mesh, ("DG", degree, shape))
    here = np.flatnonzero(space.dolfinx_cell >= 0)
    nodes = np.asarray(broken.dofmap.list, dtype=np.int64)[space.dolfinx_cell[here]]
    points = broken.tabulate_dof_coordinates()[:, :d]
    near = np.empty_like(points)
    near[nodes] = space.centroids[here, None, :]
    function = fem.Function(broken)
    function.x.array[:] = values(points, near).ravel()
    return function


def mean_stiffness(matrix: Any) -> float:
    """Give a mean diagonal entry: a constrained unknown shall not stand out among the others."""
    diagonal = matrix.getDiagonal()
    mean = float(diagonal.sum()) / diagonal.getSize()
    diagonal.destroy()
    return mean
