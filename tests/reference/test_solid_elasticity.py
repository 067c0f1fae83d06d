"""Linear elasticity in space against closed forms; directly, by multigrid, on several ranks."""

import numpy as np
import pytest
from ranks_of_tests import on_ranks
from reference_scenes import energy_of, needs_fenicsx
from solid_scenes import EXACT, SHAPES, cube, disc

from reference.exact import exact_solution
from verify.scene import load_scene

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


@pytest.mark.parametrize("mesh", ["imprinted", "remeshed"])
@pytest.mark.parametrize("degree", [1, 2])
def test_a_uniform_strain_on_each_side_of_a_cut_is_reproduced(mesh, degree):
    scene = with_exact("solid_patch", PATCH)
    # the imprinted cut is off by up to 3e-5 of an edge, and the energy by that times the jump
    tolerance = 1e-5 if mesh == "imprinted" else 1e-11
    assert abs(energy_error(scene, solver="conforming", mesh=mesh, degree=degree)) < tolerance


@pytest.mark.parametrize("degree, order", [(1, 2.0), (2, 4.0)])
def test_smooth_fields_with_a_body_force_converge_with_twice_the_degree(degree, order):
    force = [{"kind": "body_force", "force": "exact"}]
    scene = with_exact(
        "solid_smooth",
        WAVES,
        loads=force,
        mesh={"cells": [[3] * 3, [6] * 3, [12] * 3][: 4 - degree]},
    )
    levels = range(len(scene.mesh.cells))
    errors = [abs(energy_error(scene, solver="conforming", level=k, degree=degree)) for k in levels]
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


def test_a_bar_under_tension_is_in_uniaxial_stress():
    scene = cube(
        supports=[
            {"where": "bottom", "displacement": [0], "components": ["z"]},
            {"where": "left", "displacement": [0], "components": ["x"]},
            {"where": "front", "displacement": [0], "components": ["y"]},
        ],
        loads=[{"kind": "traction", "where": "top", "traction": [0, 0, 3.0]}],
    )
    for solver in ("conforming", "reference"):
        assert energy_of(scene, solver) == pytest.approx(4.5, rel=1e-10)  # ½ σ²/E


class TestHowItIsSolved:
    def solve(self, scene, method, size=0.22, degree=2):
        from reference.elasticity import solve_linear
        from reference.meshing import Grading, conforming_mesh
        from reference.space import conforming_space

        grading = Grading(size, np.zeros((0, 3)), 0.5, 2 / 3, curves=True)
        space = conforming_space(conforming_mesh(scene, grading), degree)
        return solve_linear(scene, space, None, method)

    def test_multigrid_and_mumps_agree(self):
        direct, iterative = (self.solve(cube([disc()]), m) for m in ("direct", "multigrid"))
        assert iterative.strain_energy == pytest.approx(direct.strain_energy, rel=1e-10)
        scale = np.abs(direct.displacement).max()
        assert np.abs(iterative.displacement - direct.displacement).max() < 1e-8 * scale
        assert iterative.answer.residual <= 1e-10

    def test_iterations_do_not_grow_with_the_mesh(self):
        found = [self.solve(cube([disc()]), "multigrid", h, 1) for h in (0.24, 0.12)]
        few, many = (one.answer.iterations for one in found)
        assert found[1].displacement.size > 6 * found[0].displacement.size
        assert many <= 1.5 * few

    def test_a_thin_strip_that_bends_is_solved_to_round_off(self):
        """K x is 1e7 times the loads here: no solver leaves a residual of 1e-10 of these."""
        from reference.elasticity import solve_linear
        from reference.space import conforming_space
        from verify.solvers.conforming_meshes import reference_mesh

        scene = load_scene("controls/thin_skin")
        space = conforming_space(reference_mesh(scene, 0)[0], 2)
        direct, iterative = (solve_linear(scene, space, None, m) for m in ("direct", "multigrid"))
        assert direct.answer.residual > 1e-9
        scale = np.abs(direct.displacement).max()
        assert np.abs(iterative.displacement - direct.displacement).max() < 1e-8 * scale
        assert iterative.answer.round_off < 1e-8

    def test_a_residual_that_is_not_reached_is_said(self, monkeypatch):
        from reference import linear_solvers
        from reference.elasticity import solve_linear
        from reference.meshing import Grading, conforming_mesh
        from reference.space import conforming_space

        monkeypatch.setattr(linear_solvers, "_MOST_ITERATIONS", 3)
        scene = cube()
        space = conforming_space(conforming_mesh(scene, Grading(0.2, np.zeros((0, 3)))), 1)
        with pytest.raises(RuntimeError, match="residual"):
            solve_linear(scene, space, None, "multigrid")


_PARALLEL = """
import resource
from solid_scenes import cube, disc
from reference.elasticity import solve_linear
from reference.meshing import Grading, conforming_mesh
from reference.space import conforming_space

loads = [dict(kind="gravity", acceleration=[0, 0, -1]),
         dict(kind="traction", where="top", traction=[0.1, 0, 1.0])]
scene = cube([disc()], loads=loads)
mesh = None
if world.rank == 0:
    mesh = conforming_mesh(scene, Grading({size}, np.zeros((0, 3)), 0.5, 2 / 3, curves=True))
mesh = world.bcast(mesh)
space = conforming_space(mesh, {degree}, world)
found = solve_linear(scene, space, None, {method!r})
memory = world.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)
answer = [found.displacement.size, found.strain_energy, float(np.linalg.norm(found.displacement)),
          memory / 1e6, sum(found.timings.values())]
"""


@pytest.mark.parametrize("degree, method", [(1, "direct"), (2, "multigrid")])
def test_two_ranks_give_the_answer_of_one(degree, method, tmp_path):
    script = _PARALLEL.format(size=0.3, degree=degree, method=method)
    one, two = (on_ranks(count, script, tmp_path)[:3] for count in (1, 2))
    assert two == pytest.approx(one, rel=1e-10)
