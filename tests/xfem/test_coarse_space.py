"""Conjugate gradients with a coarse space: the same solution, in iterations that do not grow."""

import numpy as np
import pytest
from cut_bodies import material
from scipy.spatial import Delaunay

import verify.xfem as xfem
from verify.accelerated import FAST
from verify.accelerated.two_level import TwoLevel
from verify.xfem import statics
from verify.xfem.arrays import NotConvergedError, SingularStiffnessError
from verify.xfem.block_pattern import body_pattern, constrain
from verify.xfem.linear_solvers import SparseLU

INCLINED = xfem.Plane([0.5, 0.5, 0.5], [-1.0, -2.0, 3.0])


def cube(n, *cuts):
    return xfem.cut_mesh(xfem.box_mesh((n, n, n)), list(cuts) or [INCLINED])


def scattered(count):
    """Tetrahedra of any shape but the flattest, parted by two planes that cross."""
    points = np.random.default_rng(4).random((count, 3))
    cells = Delaunay(points).simplices
    corners = points[cells]
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    longest = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max(axis=1)
    cells = cells[volume > 1e-3 * longest**3]
    used, cells = np.unique(cells, return_inverse=True)
    mesh = xfem.SimplexMesh(points[used], cells.reshape(-1, 4))
    return xfem.cut_mesh(mesh, [xfem.Plane([0.5] * 3, [0.3, 1.0, 0.2]), INCLINED])


def plate():
    mesh = xfem.box_mesh((24, 24, 2), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0 / 12.0))
    return xfem.cut_mesh(mesh, [xfem.Plane([0.5, 0.5, 0.04], [-1.0, -2.0, 0.3])])


def system(v, stiffer=1.0, held=None, **which):
    """Blocks of the stiffness with supports, what is fixed, and forces that are not smooth."""
    x = v.mesh.points[:, 0]
    held = (x < x.min() + 0.1) | (x > x.max() - 0.1) if held is None else held
    supports = xfem.Supports.none(v).prescribe(v, held, **which)
    for axis in range(3) if which else ():
        supports = supports.prescribe(v, v.mesh.points[:, axis] == 0.0, components=(axis,))
    pattern = body_pattern(v)
    stiff = xfem.isotropic(1e4 * stiffer, np.full(len(v.mesh.cells), 0.3), "solid")
    blocks = xfem.InternalForce(v, stiff, "linear").stiffness(pattern)
    constrain(pattern, supports.fixed, blocks)
    load = np.random.default_rng(1).standard_normal(v.node_points.shape)
    return pattern, blocks, supports.fixed, np.where(supports.fixed, 0.0, load)


def _solve(solver, blocks, load):
    solver.factorize(blocks)
    return solver.solve(load)


def layers(v):
    """Every other layer ten thousand times as stiff."""
    height = v.mesh.points[v.mesh.cells].mean(axis=1)[:, 2]
    return np.where(np.floor(3.0 * height) % 2 == 0, 1.0, 1e4)


def clamped(v):
    return v.mesh.points[:, 0] < 0.05


BODIES = {
    "cut cube": lambda: (cube(9), {}),
    "layers": lambda: (v := cube(9), {"stiffer": layers(v)}),
    "slivers": lambda: (cube(8, xfem.Plane([0.5, 0.5, 0.5 + 1e-13], [0, 0, 1])), {}),
    "held on one side": lambda: (v := scattered(700), {"held": clamped(v)}),
    "rollers": lambda: (
        cube(9, xfem.Plane([0.5, 0.5, 0.5], [1.0, 0.3, 0.1])), {"components": (0,)},
    ),
    "plate": lambda: (plate(), {}),
    "three planes": lambda: (
        cube(8, INCLINED, xfem.Plane([0.4, 0.5, 0.5], [0.2, 1.0, 0.1]),
             xfem.Plane([0.5, 0.5, 0.3], [0.1, 0.05, 1.0])), {},
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", BODIES)
def test_the_solution_is_that_of_a_factorisation(name):
    body, more = BODIES[name]()
    pattern, blocks, fixed, load = system(body, **more)
    exact = SparseLU(pattern, 3, definite=True)
    wanted = _solve(exact, blocks, load)
    solver = TwoLevel(pattern, body.node_points, fixed, 1e-13, 500)
    found = _solve(solver, blocks, load)
    # errors of both: round-off times the condition of the matrix, scaled by its diagonal
    assert np.abs(found - wanted).max() < 1e-8 * np.abs(wanted).max()
    left = load.ravel() - pattern.matrix(blocks) @ found.ravel()
    floor = load.ravel() - pattern.matrix(blocks) @ wanted.ravel()
    assert np.linalg.norm(left) < 1e-12 * np.linalg.norm(load) + 3.0 * np.linalg.norm(floor)
    for guess in (np.where(fixed, 0.0, 0.1), 0.1 * load):  # a rigid motion, and no smooth one
        assert np.abs(solver.solve(load, guess) - wanted).max() < 1e-8 * np.abs(wanted).max()


def test_iterations_do_not_grow_with_the_body():
    """With eight times the nodes; those without a coarse space double, with h⁻¹."""
    counts = []
    for n in (10, 20):
        pattern, blocks, fixed, load = system(body := cube(n))
        solver = TwoLevel(pattern, body.node_points, fixed, 1e-13, 500)
        _solve(solver, blocks, load)
        counts.append(solver.iterations)
    assert counts[1] < 1.3 * counts[0]


def test_nor_with_slivers_or_stiff_layers():
    """Nodal blocks do not see the size of slivers; parts do not end where materials do."""
    counts = {}
    for name in ("cut cube", "slivers", "layers"):
        body, more = BODIES[name]()
        pattern, blocks, fixed, load = system(body, **more)
        solver = TwoLevel(pattern, body.node_points, fixed, 1e-13, 500)
        _solve(solver, blocks, load)
        counts[name] = solver.iterations
    assert max(counts.values()) < 2.0 * counts["cut cube"]


@pytest.mark.parametrize("height", [-1.0, 0.01])
def test_a_part_that_nothing_holds_is_refused(height):
    """All of the body, and what a cut leaves above its held ground."""
    body = cube(6, xfem.Plane([0.5, 0.5, 0.5], [0.1, 0.05, 1.0]))
    pattern, blocks, fixed, load = system(body, held=body.mesh.points[:, 2] < height)
    solver = TwoLevel(pattern, body.node_points, fixed, 1e-13, 500)
    with pytest.raises((SingularStiffnessError, NotConvergedError)):
        _solve(solver, blocks, load)


def test_statics_of_a_large_solid_take_it(monkeypatch):
    """And give what SciPy gives."""
    body = cube(9)
    x = body.mesh.points[:, 0]
    supports = xfem.Supports.none(body).prescribe(body, (x == 0.0) | (x == 1.0))
    given = body, material(3), supports, xfem.body_force(body, [0.0, 3.0, -9.8e3])
    wanted = xfem.solve_static(*given)
    monkeypatch.setattr(statics, "LARGE_FROM", 500)
    taken = []
    former = TwoLevel.factorize
    monkeypatch.setattr(TwoLevel, "factorize", lambda *a: (taken.append(1), former(*a))[1])
    found = xfem.solve_static(*given, kernels=FAST)
    assert taken
    assert found.solver == "iterative"
    size = np.abs(wanted.displacement).max()
    np.testing.assert_allclose(found.displacement, wanted.displacement, atol=1e-10 * size)
