"""Linear solvers: factorisation, null spaces, what the cost decides, bodies held by mass alone."""

from functools import partial

import numpy as np
import pytest
from cut_bodies import DENSITY, material

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.accelerated.cholesky import Cholesky, NearlySymmetric
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.accelerated.solver_by_cost import DirectBySize
from verify.methods.generalised_alpha import GeneralisedAlpha
from verify.xfem.arrays import NotConvergedError, SingularStiffnessError
from verify.xfem.block_pattern import block_pattern
from verify.xfem.implicit import ImplicitEuler, Trapezoidal
from verify.xfem.linear_solvers import BlockJacobiCG, SparseLU
from verify.xfem.real_time import RealTimeEuler

SOLVERS = {
    "Cholesky": Cholesky,
    "ConjugateGradients": ConjugateGradients,
    "SparseLU": SparseLU,
    "definite SparseLU": partial(SparseLU, definite=True),
    "BlockJacobiCG": BlockJacobiCG,
    "NearlySymmetric": NearlySymmetric,
}
FREE_MESHES = {
    "two apart": xfem.SimplexMesh(
        np.concatenate([np.eye(4)[:, 1:], np.eye(4)[:, 1:] + 5.0]), np.arange(8).reshape(2, 4)
    ),
    "plate": xfem.rectangle_mesh((9, 4)),
}


def system(name, multiple=1.0):
    """The stiffness of a body without supports, and a multiple of the identity."""
    v = xfem.cut_mesh(FREE_MESHES[name], [])
    pattern = block_pattern(v.cells, v.node_count)
    blocks = xfem.InternalForce(v, material(v.mesh.dim, 1.0), "linear").stiffness(pattern)
    blocks[pattern.diagonal] += multiple * np.eye(v.mesh.dim)
    return pattern, blocks, np.random.default_rng(0).normal(size=v.node_points.shape)


def _solve(solver, blocks, load):
    solver.factorize(blocks)
    return solver.solve(load)


def test_a_badly_scaled_matrix_loses_no_digits():
    """D A D with D over 24 decades: a factorisation's error does not depend on diagonal scaling."""
    pattern, blocks, x = system("plate")
    scale = 10.0 ** np.random.default_rng(1).uniform(-12, 12, x.shape)
    rows = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
    scaled = scale[rows][:, :, None] * blocks * scale[pattern.columns][:, None, :]
    load = (pattern.matrix(blocks) @ x.ravel()).reshape(scale.shape)
    for kind in ("Cholesky", "definite SparseLU"):
        found = _solve(SOLVERS[kind](pattern, 2), scaled, load * scale)
        assert np.abs(found * scale - x).max() < 1e-10


@pytest.mark.parametrize(
    "kind", ["Cholesky", "ConjugateGradients", "definite SparseLU", "BlockJacobiCG", "DirectBySize"]
)
def test_a_matrix_with_a_null_space_or_a_negative_mode_is_refused(kind):
    for multiple in (0.0, -0.01, np.nan):
        pattern, blocks, load = system("plate", multiple)
        # iterations see a null space by their residual, a negative mode by its curvature
        errors = [SingularStiffnessError, *([NotConvergedError] if multiple == 0.0 else [])]
        with pytest.raises(tuple(errors)):
            _solve((SOLVERS | {"DirectBySize": DirectBySize})[kind](pattern, 2), blocks, load)


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
    mesh = (xfem.rectangle_mesh if dim == 2 else xfem.box_mesh)(divisions, (0,) * dim, size)
    point = np.concatenate([[at * size[0]], 0.5 * size[1:]])
    v = xfem.cut_mesh(mesh, [xfem.Plane(point, normal[:dim])])
    mass = xfem.side_wise_mass(v, DENSITY)
    return xfem.DynamicBody(
        xfem.InternalForce(v, material(dim), kinematics, FAST),
        mass,
        weight=mass.weight([0.5, *[0.0] * (dim - 2), -1.0]),
        supports=xfem.Supports.none(v).prescribe(v, mesh.points[:, 0] == 0.0),
    )


def _moved(kind, body, step, steps, **given):
    scheme, state = kind(body, step, **given), body.rest()
    for _ in range(steps):
        scheme.step(state)
    return scheme, state


def _cholesky(body):
    return Cholesky(body.pattern, body.shape[1], body.fixed.all(axis=1))


@pytest.mark.parametrize(
    ("kind", "kinematics"),
    [
        (RealTimeEuler, "corotational"),
        (GeneralisedAlpha, "linear"),
        (ImplicitEuler, "corotational"),
    ],
)
def test_a_motion_is_the_same_as_with_a_factorisation(kind, kinematics):
    body = _body((7, 7, 7), kinematics=kinematics)
    assert body.shape[0] > 500
    _, found = _moved(kind, body, 0.005, 3)
    _, wanted = _moved(kind, body, 0.005, 3, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    # 1e-10 of the forces of each step
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-8 * size)


@pytest.mark.parametrize("fraction", [1e-4, 1e-13])
def test_slivers_are_solved_for_as_well(fraction):
    """A plane that nearly touches nodes, at a fraction of an element from them."""
    body = _body((8, 7, 7), at=(4.0 + fraction) / 8.0, normal=(1.0, 0.0, 0.0))
    assert body.mass.weights.max() / body.mass.weights.min() > 0.1 / fraction
    scheme, found = _moved(Trapezoidal, body, 0.005, 4)
    assert scheme._solver.is_iterative
    _, wanted = _moved(Trapezoidal, body, 0.005, 4, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-7 * size)


@pytest.mark.parametrize(
    ("divisions", "step", "iterates"),
    [
        ((12, 12, 12), 4.0, True),  # as many iterations as in statics: 82
        ((26, 26, 1), 4.0, False),  # 380 against 50: thin bodies bend
        ((60, 60), 0.001, True),  # 5 against 15
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


@pytest.mark.parametrize("divisions", [(30, 4), (9, 5, 4)])
def test_a_matrix_that_comes_back_is_factorised_once_its_iterations_have_cost_as_much(divisions):
    """Linear motion has one matrix; with another step the next one begins by iterations again."""
    body = _body(divisions, kinematics="linear")
    scheme, found = _moved(Trapezoidal, body, 0.005, 1)
    assert scheme._solver.is_iterative
    for _ in range(29):
        scheme.step(found)
    assert not scheme._solver.is_iterative
    _, wanted = _moved(Trapezoidal, body, 0.005, 30, solver=_cholesky(body))
    size = np.abs(wanted.displacement).max()
    assert found.displacement == pytest.approx(wanted.displacement, abs=1e-8 * size)
    scheme._solver.factorize(scheme._blocks)
    assert scheme._solver.is_iterative
