"""Linear elasticity of the FEniCSx side against closed forms, each load and support in turn."""

import numpy as np
import pytest
from reference_scenes import energy_of, needs_fenicsx, polyline, square

from reference.exact import exact_solution
from verify.scene import Scene, load_scene

pytestmark = needs_fenicsx

INCLINED = {"point": [0.5, 0.5], "slope": 1 / 3}
ACROSS = polyline("cut", (-0.1, 0.3), (1.1, 0.7))
SMOOTH = {
    **INCLINED,
    "above": [[0.1, np.pi, 0.0], [0.05, np.pi, 90.0]],
    "below": [[-0.05, 2 * np.pi, 0.0], [-0.05, 2 * np.pi, 90.0]],
}
AIRY = {**INCLINED, "above": [0.1, 0.2, 2.0], "below": [-0.2, 0.1, 3.0]}
EXACT = [{"where": "boundary", "displacement": "exact"}]


def with_exact(name, parameters, plane="strain", cut=ACROSS, **changes):
    return square(
        [cut],
        material={"young": 1.0, "poisson": 0.3, "plane": plane},
        exact={"solution": name, "parameters": parameters},
        **({"supports": EXACT, "loads": []} | changes),
    )


def exact_energy(scene):
    known = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    return known.strain_energy(scene)


def energy_errors(scene, levels=3, **parameters):
    values = [energy_of(scene, "conforming", level, **parameters) for level in range(levels)]
    return np.array(values) / exact_energy(scene) - 1


UNIFORM = {"mesh": {"cells": [[8, 8], [16, 16], [32, 32], [64, 64]]}}


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_quadratic_elements_converge_in_energy_with_order_four(plane):
    errors = energy_errors(with_exact("airy", AIRY, plane, **UNIFORM), degree=2)
    assert np.log2(errors[-2] / errors[-1]) >= 3.9
    assert abs(errors[-1]) < 1e-5


@pytest.mark.parametrize("plane", ["strain", "stress"])
def test_an_exact_body_force_is_applied_on_each_side_of_the_cut(plane):
    force = [{"kind": "body_force", "force": "exact"}]
    scene = with_exact("smooth", SMOOTH, plane, loads=force, **UNIFORM)
    errors = energy_errors(scene, levels=4, degree=2)
    # order 4 over the whole sequence; from level to level the cut crosses other cells
    assert np.log2(np.abs(errors[0] / errors[-1])) / 3 >= 3.8
    assert abs(errors[-1]) < 1e-7
    # without the force the same boundary values give another energy
    assert abs(energy_errors(with_exact("smooth", SMOOTH, plane), levels=1)[0]) > 0.05


def test_a_bar_that_hangs_under_its_weight_stretches_like_a_parabola():
    from verify.solvers import find_solver

    # without lateral contraction u_y = −ρg (Ly − y²/2)/E from the held end down: in P2's space
    rho, g, length = 1000.0, 9.8, 2.0
    scene = Scene.model_validate(
        {
            "title": "bar",
            "requirement": "none",
            "geometry": {"kind": "rectangle", "lower": [0, 0], "upper": [0.5, length]},
            "mesh": {"cells": [[2, 8]]},
            "material": {"young": 1e4, "poisson": 0.0, "plane": "strain", "density": rho},
            "supports": [{"where": "top", "displacement": [0, 0]}],
            "loads": [{"kind": "gravity", "acceleration": [0, -g]}],
        }
    )
    for solution in (
        find_solver("conforming").solve(scene, 0, repetitions=0, degree=2),
        find_solver("reference").solve(scene, 0, repetitions=0),
    ):
        below = length - solution.points[:, 1]
        expected = -rho * g * (length * below - below**2 / 2) / 1e4
        assert solution.displacement[0, :, 1] == pytest.approx(expected, abs=1e-9)
        assert np.abs(solution.displacement[0, :, 0]).max() < 1e-9


def test_the_graded_reference_converges_with_order_two_in_the_number_of_unknowns():
    from verify.solvers import find_solver

    scene, found = load_scene("statics/griffith_inside"), find_solver("reference")
    levels = [found.solve(scene, level, repetitions=0) for level in range(2)]
    errors = [abs(one.ledger["strain"][0] / exact_energy(scene) - 1) for one in levels]
    growth = np.log(levels[1].unknowns / levels[0].unknowns)
    assert np.log(errors[0] / errors[1]) / growth >= 1.9


def test_remeshing_the_cut_body_is_as_good_as_imprinting_the_cut():
    scene = with_exact("airy", AIRY, **UNIFORM)
    imprinted, remeshed = (energy_errors(scene, mesh=mesh) for mesh in ("imprinted", "remeshed"))
    # over the whole sequence: meshes made anew vary
    assert np.log2(remeshed[0] / remeshed[-1]) / 2 == pytest.approx(2.0, abs=0.2)
    # equal mean cell area; well-shaped cells are somewhat better, never twice as bad
    assert (remeshed < 2 * imprinted).all()
