"""Linear solvers: factorisation, null spaces, what the cost decides, bodies held by mass alone."""

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sparse
from cut_bodies import DENSITY, material
from scipy.sparse.linalg import spsolve

from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky, NearlySymmetric
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.solver_by_cost import DirectBySize
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.arrays import NotConvergedError, SingularStiffnessError
from verify.xfem.block_pattern import block_pattern
from verify.xfem.body import DynamicBody
from verify.xfem.cuts import Plane
from verify.xfem.element import isotropic
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import PLAIN, BlockJacobiCG, SparseLU
from verify.xfem.loads_and_supports import Supports, body_force
from verify.xfem.mass import side_wise_mass
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.real_time import RealTimeEuler
from verify.xfem.statics import solve_static

LU = partial(SparseLU, definite=True)


def random_system(cells, nodes, block, seed=0):
    """A symmetric positive definite matrix on the pattern of these cells."""
    rng = np.random.default_rng(seed)
    pattern = block_pattern(cells, nodes)
    blocks = np.zeros((len(pattern.columns), block, block))
    corners = cells.shape[1]
    for cell in range(len(cells)):
        half = rng.normal(size=(corners * block, corners * block))
        element = (half @ half.T).reshape(corners, block, corners, block)
        for a in range(corners):
            for b in range(corners):
                blocks[pattern.targets[cell, a, b]] += element[a, :, b]
    blocks[pattern.diagonal] += 0.1 * np.eye(block)
    return pattern, blocks, rng.normal(size=(nodes, block))


MESHES = {
    "plate": rectangle_mesh((9, 7)),
    "long plate": rectangle_mesh((40, 2)),
    "block": box_mesh((3, 4, 3)),
}


@pytest.mark.parametrize("block", [1, 2, 3])
@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("method", [Cholesky, ConjugateGradients, LU, BlockJacobiCG])
def test_solutions_equal_those_of_superlu(method, name, block):
    mesh = MESHES[name]
    pattern, blocks, load = random_system(mesh.cells, len(mesh.points), block)
    solver = method(pattern, block)
    solver.factorize(blocks)
    want = spsolve(sparse.csc_matrix(pattern.matrix(blocks)), load.ravel()).reshape(load.shape)
    tolerance = 1e-11 if method in (Cholesky, LU) else 1e-7
    assert np.abs(solver.solve(load) - want).max() < tolerance * np.abs(want).max()


def test_a_badly_scaled_matrix_loses_no_digits():
    """D A D with D over 24 decades: a factorisation's error does not depend on diagonal scaling."""
    mesh = MESHES["plate"]
    pattern, blocks, _ = random_system(mesh.cells, len(mesh.points), 2)
    rng = np.random.default_rng(1)
    scale = 10.0 ** rng.uniform(-12, 12, (len(mesh.points), 2))
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    scaled = scale[rows][:, :, None] * blocks * scale[pattern.columns][:, None, :]
    x = rng.normal(size=scale.shape)
    load = (pattern.matrix(blocks) @ x.ravel()).reshape(scale.shape)
    for solver in (Cholesky(pattern, 2), LU(pattern, 2)):
        solver.factorize(scaled)
        got = solver.solve(load * scale) * scale
        assert np.abs(got - x).max() < 1e-10


def test_an_indefinite_matrix_is_refused_by_the_node_where_it_shows():
    mesh = MESHES["plate"]
    pattern, blocks, _ = random_system(mesh.cells, len(mesh.points), 2)
    blocks[pattern.diagonal[17]] *= -1.0
    for method in (Cholesky, ConjugateGradients, DirectBySize, LU, BlockJacobiCG):
        solver = method(pattern, 2)
        with pytest.raises(SingularStiffnessError, match="not positive definite"):
            solver.factorize(blocks)
    blocks[pattern.diagonal[17]] = np.nan
    with pytest.raises(SingularStiffnessError):
        Cholesky(pattern, 2).factorize(blocks)


def _solve(solver, blocks, load):
    solver.factorize(blocks)
    return solver.solve(load)


@pytest.mark.parametrize("method", [Cholesky, ConjugateGradients, LU, BlockJacobiCG])
@pytest.mark.parametrize("name", MESHES)
def test_a_matrix_with_a_null_space_or_a_negative_mode_is_refused(method, name):
    """A chain of springs without support, and one whose stiffness is of the wrong sign inside."""
    mesh = MESHES[name]
    pattern = block_pattern(mesh.cells, len(mesh.points))
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    load = np.random.default_rng(0).normal(size=(pattern.node_count, 2))
    for shift in (0.0, -0.3):
        blocks = np.zeros((len(pattern.columns), 2, 2))
        blocks[:] = -np.eye(2)
        count = np.diff(pattern.starts)[rows[pattern.diagonal]] - 1.0 + shift
        blocks[pattern.diagonal] = count[:, None, None] * np.eye(2)
        solver = method(pattern, 2)
        iterates = method in (ConjugateGradients, BlockJacobiCG)
        # iterations see a null space by their residual, a negative mode by its curvature
        wanted = NotConvergedError if iterates and shift == 0.0 else SingularStiffnessError
        with pytest.raises((SingularStiffnessError, wanted)):
            _solve(solver, blocks, load)


SOLVERS = {
    "Cholesky": Cholesky,
    "ConjugateGradients": ConjugateGradients,
    "SparseLU": SparseLU,
    "definite SparseLU": partial(SparseLU, definite=True),
    "BlockJacobiCG": BlockJacobiCG,
    "NearlySymmetric": NearlySymmetric,
}
TWO = SimplexMesh(
    np.concatenate([np.eye(4)[:, 1:], np.eye(4)[:, 1:] + 5.0]), np.arange(8).reshape(2, 4)
)
FREE_MESHES = {
    "one tetrahedron": SimplexMesh(np.eye(4)[:, 1:], np.array([[0, 1, 2, 3]])),
    "two apart": TWO,
    "block": box_mesh((2, 2, 2)),
    "plate": rectangle_mesh((4, 4)),
}


def system(name, multiple=1.0):
    """A stiffness without supports (of springs between nodes) and a multiple of the identity."""
    mesh = FREE_MESHES[name]
    pattern = block_pattern(mesh.cells, len(mesh.points))
    blocks = np.zeros((len(pattern.columns), mesh.dim, mesh.dim))
    for cell, nodes in enumerate(mesh.cells):
        for a in range(len(nodes)):
            for b in range(a):
                along = mesh.points[nodes[a]] - mesh.points[nodes[b]]
                spring = np.outer(along, along) / (along @ along)
                for i, j in ((a, b), (b, a)):
                    blocks[pattern.targets[cell, i, i]] += spring
                    blocks[pattern.targets[cell, i, j]] -= spring
    blocks[pattern.diagonal] += multiple * np.eye(mesh.dim)
    load = np.random.default_rng(0).normal(size=mesh.points.shape)
    return pattern, blocks, load


@pytest.mark.parametrize("name", FREE_MESHES)
@pytest.mark.parametrize("kind", SOLVERS)
def test_a_free_body_that_its_mass_alone_holds_is_solved_at_any_step_and_size_of_load(kind, name):
    """The mass over the square of the step is 1e-3 to 1e16 of the stiffness; loads scale.

    Conjugate gradients used to return zero, as converged, for loads whose square leaves the range
    of floating-point numbers.
    """
    for multiple in (1e-3, 1.0, 1e16):
        pattern, blocks, load = system(name, multiple)
        solver = SOLVERS[kind](pattern, blocks.shape[1])
        solver.factorize(blocks)
        K = pattern.matrix(blocks).toarray()
        for size in (1.0, 1e-200, 1e200) if kind in ("Cholesky", "ConjugateGradients") else (1.0,):
            found = solver.solve(size * load) / size
            left = np.linalg.norm(K @ found.ravel() - load.ravel()) / np.linalg.norm(load)
            assert left < 1e-9
        assert not solver.solve(np.zeros_like(load)).any()
        if kind == "ConjugateGradients":
            assert solver.iterations == 0


def _body(divisions, at=0.5, normal=(1.0, 0.9, 0.4), kinematics="corotational"):
    """Elements of a centimetre, held at the left, cut across."""
    dim = len(divisions)
    size = 0.01 * np.array(divisions)
    mesh = (rectangle_mesh if dim == 2 else box_mesh)(divisions, (0,) * dim, size)
    point = np.concatenate([[at * size[0]], 0.5 * size[1:]])
    v = cut_mesh(mesh, [Plane(point, normal[:dim])])
    mass = side_wise_mass(v, DENSITY)
    return DynamicBody(
        InternalForce(v, material(dim), kinematics, FAST),
        mass,
        weight=mass.weight([0.5, *[0.0] * (dim - 2), -1.0]),
        supports=Supports.none(v).prescribe(v, mesh.points[:, 0] == 0.0),
    )


def _moved(kind, body, step, steps, **given):
    scheme, state = kind(body, step, **given), body.rest()
    for _ in range(steps):
        scheme.step(state)
    return scheme, state


def _cholesky(body):
    return Cholesky(body.pattern, body.shape[1], body.fixed.all(axis=1))


@pytest.mark.parametrize("kinematics", ["linear", "corotational"])
@pytest.mark.parametrize("kind", [RealTimeEuler, ImplicitEuler, Trapezoidal, GeneralisedAlpha])
def test_a_motion_is_the_same_as_with_a_factorisation(kind, kinematics):
    body = _body((7, 7, 7), kinematics=kinematics)
    assert body.shape[0] > 500
    _, found = _moved(kind, body, 0.005, 6)
    _, wanted = _moved(kind, body, 0.005, 6, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    # 1e-10 of the forces of each step
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-8 * size)


@pytest.mark.parametrize("fraction", [1e-4, 1e-9, 1e-13])
def test_slivers_are_solved_for_as_well(fraction):
    """A plane that nearly touches nodes, at a fraction of an element from them."""
    body = _body((8, 8, 8), at=(4.0 + fraction) / 8.0, normal=(1.0, 0.0, 0.0))
    ratio = body.mass.weights.max() / body.mass.weights.min()
    assert ratio > 0.1 / fraction
    scheme, found = _moved(Trapezoidal, body, 0.005, 10)
    assert scheme._solver.is_iterative
    _, wanted = _moved(Trapezoidal, body, 0.005, 10, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-7 * size)


@pytest.mark.parametrize(
    ("divisions", "step", "iterates"),
    [
        ((12, 12, 12), 0.01, True),  # 32 iterations against 180 that a factorisation is worth
        ((12, 12, 12), 4.0, True),  # as many as in statics: 82
        ((26, 26, 1), 4.0, False),  # 380 against 50: thin bodies bend
        ((60, 60), 0.001, True),  # 5 against 15
        ((60, 60), 0.1, False),  # 250
    ],
)
def test_what_it_takes_depends_on_the_size_the_shape_and_the_step(divisions, step, iterates):
    body = _body(divisions)
    scheme, state = RealTimeEuler(body, step), body.rest()
    for _ in range(3):
        scheme.advance(state)
    assert scheme.solver.is_iterative == iterates
    after = RealTimeEuler(body, step)  # as after a cut: what was found is not found again
    after.follow(scheme, np.arange(body.shape[0]))
    assert after.solver.is_iterative == iterates
    same, other = RealTimeEuler(body, step, solver=_cholesky(body)), body.rest()
    for _ in range(3):
        same.advance(other)
    size = np.abs(other.displacement).max()
    assert state.displacement == pytest.approx(other.displacement, abs=1e-7 * size)


@pytest.mark.parametrize(
    ("divisions", "height", "way", "other"),
    [((12, 12, 12), 1.0, "iterative", FAST), ((32, 32, 1), 1 / 32, "direct", PLAIN)],
)
def test_statics_iterate_for_a_cube_and_factorise_a_plate(divisions, height, way, other):
    """More iterations than a compact body of as many nodes needs are not spent on a plate."""
    mesh = box_mesh(divisions, (0.0, 0.0, 0.0), (1.0, 1.0, height))
    phantom = cut_mesh(mesh, [Plane([0.5, 0.5, 0.5 * height], [1.0, 0.4, 0.3])])
    ends = (mesh.points[:, 0] == 0.0) | (mesh.points[:, 0] == 1.0)
    held = Supports.none(phantom).prescribe(phantom, ends)
    load, law = body_force(phantom, [0.0, 0.3, -1.0]), isotropic(1e3, 0.3, "solid")
    found = solve_static(phantom, law, held, load, kernels=FAST)
    again = solve_static(phantom, law, held, load, solver="direct", kernels=other)
    assert found.solver == way
    difference = np.abs(found.displacement - again.displacement).max()
    assert difference < 1e-9 * np.abs(again.displacement).max()
