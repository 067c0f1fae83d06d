"""Solids by the FEniCSx side: statics, how it is solved, finite rotation and strain."""

import numpy as np
import pytest
from large_bodies import space_of, turn
from reference_scenes import energy_of, needs_fenicsx
from solid_scenes import EXACT, SHAPES, cube, disc, polygon

from reference import elasticity, linear_solvers
from reference.deformation import stretch_trace
from reference.elasticity import solve_linear
from reference.exact import exact_solution
from reference.law import Law
from reference.meshing import (
    Grading,
    conforming_mesh,
    imprint_polygons,
    open_cut,
    structured_tetrahedra,
)
from reference.space import conforming_space
from verify.scene import Material, load_scene
from verify.solvers import find_solver
from verify.solvers.conforming_meshes import reference_mesh

pytestmark = needs_fenicsx


THROUGH = SHAPES["through"][0]
NORMAL = [0.0, -0.2 / 3, 1.0]
PATCH = {
    "point": [0.5, 0.0, 0.4 + 0.2 / 3],
    "normal": NORMAL,
    "axis": [1.0, 0.0, 0.0],
    "strain": [[0.1, -0.03], [-0.05, 0.02]],
    "shift": [[0, 0, 0.1], [0, 0, -0.02]],
}
WAVES = {
    "point": PATCH["point"],
    "normal": NORMAL,
    "above": [[0.1, 2.0, 1.0, 20.0], [0.05, -1.0, 3.0, 0.0], [0.04, 3.0, 1.5, 90.0]],
    "below": [[-0.1, 1.0, 2.5, 0.0], [0.08, 2.0, 0.5, 40.0], [0.05, 1.0, -2.0, 10.0]],
}


def with_exact(name, parameters, cuts=THROUGH, **changes):
    return cube(
        cuts,
        exact={"solution": name, "parameters": parameters},
        **({"supports": EXACT, "loads": []} | changes),
    )


def energy_error(scene, **choices):
    known = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    return energy_of(scene, **choices) / known.strain_energy(scene) - 1


@pytest.mark.parametrize(("mesh", "degree"), [("imprinted", 1), ("remeshed", 2)])
def test_a_uniform_strain_on_each_side_of_a_cut_is_reproduced(mesh, degree):
    scene = with_exact("solid_patch", PATCH)
    # the imprinted cut is off by up to 3e-5 of an edge, and the energy by that times the jump
    tolerance = 1e-5 if mesh == "imprinted" else 1e-11
    assert abs(energy_error(scene, solver="conforming", mesh=mesh, degree=degree)) < tolerance


@pytest.mark.parametrize("degree, order, cells", [(1, 2.0, (5, 10)), (2, 4.0, (3, 6))])
def test_smooth_fields_with_a_body_force_converge_with_twice_the_degree(degree, order, cells):
    force = [{"kind": "body_force", "force": "exact"}]
    scene = with_exact(
        "solid_smooth",
        WAVES,
        loads=force,
        mesh={"cells": [[n] * 3 for n in cells]},
    )
    errors = [abs(energy_error(scene, solver="conforming", level=k, degree=degree)) for k in (0, 1)]
    assert np.log2(errors[-2] / errors[-1]) == pytest.approx(order, abs=0.4)


def test_an_exact_traction_does_the_work_of_an_exact_support():
    # stress and strain are uniform on each side: the tractions are too
    supports = [{"where": w, "displacement": "exact"} for w in ("top", "bottom")]
    loads = [
        {"kind": "traction", "where": w, "traction": "exact"}
        for w in ("left", "right", "front", "back")
    ]
    scene = with_exact("solid_patch", PATCH, supports=supports, loads=loads)
    assert abs(energy_error(scene, solver="conforming", mesh="remeshed", degree=2)) < 1e-9


class TestHowItIsSolved:
    def solve(self, scene, method, size=0.28, degree=2):
        grading = Grading(size, np.zeros((0, 3)), 0.5, 2 / 3, curves=True)
        space = conforming_space(conforming_mesh(scene, grading), degree)
        return solve_linear(scene, space, None, method)

    def test_multigrid_and_mumps_agree(self, monkeypatch):
        direct = self.solve(cube([disc()]), "direct")
        for most, iterations in ((0, 60), (10**6, 30)):  # linear elements by GAMG, by MUMPS
            monkeypatch.setattr(linear_solvers, "_MOST_CORNERS", most)
            iterative = self.solve(cube([disc()]), "multigrid")
            assert iterative.answer.iterations <= iterations
            assert iterative.strain_energy == pytest.approx(direct.strain_energy, rel=1e-10)
            scale = np.abs(direct.displacement).max()
            assert np.abs(iterative.displacement - direct.displacement).max() < 1e-8 * scale
            assert iterative.answer.residual <= 1e-10

    def test_iterations_do_not_grow_with_the_mesh(self):
        found = [self.solve(cube([disc()]), "multigrid", h, 1) for h in (0.32, 0.16)]
        few, many = (one.answer.iterations for one in found)
        assert found[1].displacement.size > 6 * found[0].displacement.size
        assert many <= 1.5 * few

    def test_cells_that_a_cut_leaves_flat_take_few_iterations_more(self, monkeypatch):
        """A plane close by the nodes of a grid: without their correction four times as many."""
        cut = np.array([[-0.1, -0.1, 0.49], [1.1, -0.1, 0.502], [1.1, 1.1, 0.513]])
        mesh = imprint_polygons(*structured_tetrahedra((0,) * 3, (1,) * 3, (4, 4, 8)), [cut])
        space = conforming_space(open_cut(*mesh), 2)
        corrected, direct = (solve_linear(cube(), space, None, m) for m in ("multigrid", "direct"))
        assert corrected.strain_energy == pytest.approx(direct.strain_energy, rel=1e-9)
        monkeypatch.setattr(elasticity, "_FLAT", 0.0)
        plain = solve_linear(cube(), space, None, "multigrid")
        assert corrected.answer.iterations < 0.5 * plain.answer.iterations

    def test_a_thin_strip_that_bends_is_solved_to_round_off(self):
        """K x is 1e7 times the loads here: no solver leaves a residual of 1e-10 of these."""
        scene = load_scene("controls/thin_skin")
        space = conforming_space(reference_mesh(scene, 0)[0], 2)
        direct, iterative = (solve_linear(scene, space, None, m) for m in ("direct", "multigrid"))
        assert direct.answer.residual > 1e-9
        scale = np.abs(direct.displacement).max()
        assert np.abs(iterative.displacement - direct.displacement).max() < 1e-8 * scale
        assert iterative.answer.round_off < 1e-8

    def test_a_residual_that_is_not_reached_is_said(self, monkeypatch):
        monkeypatch.setattr(linear_solvers, "_MOST_ITERATIONS", 3)
        scene = cube()
        space = conforming_space(conforming_mesh(scene, Grading(0.2, np.zeros((0, 3)))), 1)
        with pytest.raises(RuntimeError, match="residual"):
            solve_linear(scene, space, None, "multigrid")


def answer_on(world, degree, method, size, pressure=False):
    """Number of unknowns, energy and norm of the answer for a cube with a disc cut into it."""
    loads = [
        {"kind": "gravity", "acceleration": [0, 0, -1]},
        {"kind": "traction", "where": "top", "traction": [0.1, 0, 1.0]},
    ]
    scene, mesh = cube([disc()], loads=loads), None
    if world.rank == 0:
        grading = Grading(size, np.zeros((0, 3)), 0.5, 2 / 3, curves=True)
        mesh = conforming_mesh(scene, grading)
    space = conforming_space(world.bcast(mesh), degree, world)
    found = solve_linear(scene, space, None, method, pressure=pressure)
    return (
        found.displacement.size, found.strain_energy, float(np.linalg.norm(found.displacement))
    )  # fmt: skip


def test_the_sum_of_stretches_is_that_of_the_singular_values_with_the_sign_of_the_volume():
    random = np.random.default_rng(0)
    F = random.standard_normal((2000, 3, 3))
    F[:500] = np.eye(3) + 1e-6 * F[:500]  # three nearly equal stretches
    F[500:600] = F[500:600, :, :1] @ F[500:600, :1]  # rank one
    F[-1] = 0.0
    values = np.linalg.svd(F, compute_uv=False)
    values[:, 2] *= np.sign(np.linalg.det(F))
    # a root of a quartic from its coefficients: round-off over its distance from the others
    apart = 1e-30 + (values[:, 1] + values[:, 2]) / np.maximum(values[:, 0], 1e-300)
    error = np.abs(stretch_trace(F - np.eye(3)) + 3 - values.sum(axis=1))
    error /= np.maximum(values[:, 0], 1e-300)
    assert (error <= np.minimum(1e-13 / apart, 1e-6)).all()


@pytest.mark.parametrize(
    ("energy", "d", "pressure"), [("corotated", 3, False), ("neo_hookean", 2, True)]
)
def test_force_and_tangent_are_the_derivatives_of_the_energy(energy, d, pressure):
    from dolfinx import fem
    from dolfinx.fem import petsc

    space = space_of(2, (1,) * d)
    tissue = Material(young=1.0, poisson=0.3, plane="strain" if d == 2 else None)
    law = Law(tissue, space, energy, pressure)
    random = np.random.default_rng(1)
    start, way = 0.03 * random.standard_normal((2, law.solution.x.array.size))
    turned = (space.node_points @ turn(d, 1.75).T - space.node_points).ravel()
    start += law.unknowns.own_part(turned)

    def put(share):
        law.solution.x.array[:] = start + share * way
        law.update()

    def at(share):
        put(share)
        return law.stored(), fem.assemble_vector(law.work_form).array.copy()

    step = 1e-4
    (e, f), (e_less, f_less) = at(step), at(-step)
    put(0.0)
    tangent = petsc.assemble_matrix(law.stiffness_form)
    tangent.assemble()
    x, y = tangent.createVecs()
    x.array[:] = way
    tangent.mult(x, y)
    force = at(0.0)[1]
    # central differences: third derivatives times step²; strains along the way are about 0.3
    assert force @ way == pytest.approx((e - e_less) / (2 * step), rel=1e-6)
    slope = (f - f_less) / (2 * step)
    assert y.array == pytest.approx(slope, abs=1e-6 * np.abs(slope).max())


def hanging(cuts):
    """Give a cube that is turned by 60° at its base and hangs under a large weight."""
    base = {"where": "bottom", "displacement": [0.1, 0.0, 0.0]}
    base["rotation"] = {"angle": 60.0, "centre": [0.5, 0.5, 0.0], "axis": [0.0, 1.0, 1.0]}
    return cube(
        cuts,
        mesh={"cells": [[2, 2, 4]]},
        supports=[base],
        loads=[{"kind": "gravity", "acceleration": [0.05, 0.0, -0.1]}],
        analysis={"kinematics": "corotational"},
    )


def test_linear_elements_equal_another_code_at_finite_rotation():
    """Of one rotation per element XFEM makes the same model where the cut runs along facets."""
    half = polygon("half", (-1, -1, 0.5), (0.5, -1, 0.5), (0.5, 2, 0.5), (-1, 2, 0.5))
    mine, other = (
        find_solver(name).solve(hanging([half]), 0, repetitions=0)
        for name in ("conforming", "xfem")
    )
    assert mine.ledger["strain"][0] == pytest.approx(other.ledger["strain"][0], rel=1e-9)
