"""Plane elasticity on conforming meshes: tips and mouths, orders, forces, repeated meshes."""

import numpy as np
import pytest
from reference_scenes import areas, energy_of, exterior_facets, needs_fenicsx, polyline, square

from reference.exact import exact_solution
from reference.meshing import Grading, conforming_mesh, singular_points
from verify.judge.convergence import extrapolate
from verify.scene import load_scene
from verify.solvers import find_solver

pytestmark = needs_fenicsx


def energies(case, solver):
    scene, found = load_scene(case), find_solver(solver)
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    values = [
        float(found.solve(scene, level).ledger["strain"][0]) for level in range(found.levels(scene))
    ]
    return np.array(values) / exact.strain_energy(scene) - 1


# A cut of F facets that is a tree has F + 1 nodes. A tip keeps one, a point inside an arm or a
# mouth gets two, a junction of k arms k: the extra nodes are F + 1 − (tips) + (k − 2 more per
# junction), so F − 1 for a tree whose ends are all tips, one more per mouth.
SHAPES = {
    "inner": ([polyline("a", (0.2, 0.43), (0.7, 0.61))], -1),
    "kinked": ([polyline("a", (0.2, 0.3), (0.5, 0.6), (0.8, 0.3))], -1),
    "arc": ([{"kind": "arc", "name": "a", "centre": [0.5, 0.5], "radius": 0.2, "sweep": 180}], -1),
    "edge": ([polyline("a", (-0.1, 0.43), (0.5, 0.5))], 0),
    "through": ([polyline("a", (-0.1, 0.43), (1.1, 0.6))], 1),
    "T": ([polyline("a", (0.2, 0.5), (0.8, 0.5)), polyline("b", (0.5, 0.5), (0.5, 0.8))], -1),
    "X": ([polyline("a", (0.2, 0.45), (0.8, 0.5)), polyline("b", (0.5, 0.2), (0.45, 0.8))], -1),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_tips_stay_closed_mouths_open_and_junctions_get_a_node_per_sector(shape):
    cuts, extra = SHAPES[shape]
    scene = square(cuts)
    mesh = conforming_mesh(scene, Grading(0.09, singular_points(scene), 0.5))
    doubled = len(mesh.parent) - len(np.unique(mesh.parent))
    assert doubled == len(mesh.cut_facets) + extra
    assert mesh.pieces.max() + 1 == (2 if shape == "through" else 1)
    assert exterior_facets(mesh) == len(mesh.boundary) + 2 * len(mesh.cut_facets)
    area = areas(mesh)
    assert area.min() > 0
    assert area.sum() == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("sweep", [270.0, 359.0, 360.0])
def test_an_arc_is_cut_as_far_as_it_goes(sweep):
    """Chords of a circle are short by (h/R)²/24."""
    arc = {"kind": "arc", "centre": [0.51, 0.47], "radius": 0.31, "start": 20.0, "sweep": sweep}
    mesh = conforming_mesh(square([arc]), Grading(0.06, np.zeros((0, 2)), 0.5))
    ends = mesh.realised_cut
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum()
    assert length == pytest.approx(np.deg2rad(sweep) * 0.31, rel=2e-3)
    assert mesh.pieces.max() + 1 == (2 if sweep == 360.0 else 1)


def test_the_same_scene_gives_the_same_mesh_twice():
    scene = square(SHAPES["X"][0])
    one, two = (conforming_mesh(scene, Grading(0.1, singular_points(scene), 0.5)) for _ in "ab")
    assert np.array_equal(one.points, two.points)
    assert np.array_equal(one.cells, two.cells)


@pytest.mark.parametrize("solver", ["conforming", "reference"])
def test_a_field_linear_on_each_side_is_reproduced(solver):
    # in the space on every level; only the round-off of a direct solve is left
    assert np.abs(energies("statics/f1_patch", solver)).max() < 1e-11


def test_graded_quadratic_elements_beat_the_demand_at_the_griffith_crack():
    errors = energies("statics/griffith_edges", "reference")
    assert abs(errors[-1]) < 1e-6  # 1e-5 is demanded
    # energy norm of order 2 is energy of order 4, or order 2 in the unknowns
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([4.0, 4.0], abs=0.3)
    # and the error bar that is made of the levels covers, without being ten times too wide
    sizes = [4.0, 2.0, 1.0]
    known = extrapolate((1 + errors).tolist(), sizes, 4)
    assert errors[-1] <= known.half_width <= 10 * errors[-1]


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


def test_quadratic_elements_converge_in_energy_with_order_four():
    errors = energy_errors(with_exact("airy", AIRY, "stress", **UNIFORM), degree=2)
    assert np.log2(errors[-2] / errors[-1]) >= 3.9
    assert abs(errors[-1]) < 1e-5


def test_an_exact_body_force_is_applied_on_each_side_of_the_cut():
    force = [{"kind": "body_force", "force": "exact"}]
    scene = with_exact("smooth", SMOOTH, loads=force, **UNIFORM)
    errors = energy_errors(scene, levels=4, degree=2)
    # order 4 over the whole sequence; from level to level the cut crosses other cells
    assert np.log2(np.abs(errors[0] / errors[-1])) / 3 >= 3.8
    assert abs(errors[-1]) < 1e-7
    # without the force the same boundary values give another energy
    assert abs(energy_errors(with_exact("smooth", SMOOTH), levels=1)[0]) > 0.05


def test_a_bar_that_hangs_under_its_weight_stretches_like_a_parabola():
    # without lateral contraction u_y = −ρg (Ly − y²/2)/E from the held end down: in P2's space
    rho, g, length = 1000.0, 9.8, 2.0
    scene = square(
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [0.5, length]},
        mesh={"cells": [[2, 8]]},
        material={"young": 1e4, "poisson": 0.0, "plane": "strain", "density": rho},
        supports=[{"where": "top", "displacement": [0, 0]}],
        loads=[{"kind": "gravity", "acceleration": [0, -g]}],
    )
    for solution in (
        find_solver("conforming").solve(scene, 0, repetitions=0, degree=2),
        find_solver("reference").solve(scene, 0, repetitions=0),
    ):
        below = length - solution.points[:, 1]
        expected = -rho * g * (length * below - below**2 / 2) / 1e4
        assert solution.displacement[0, :, 1] == pytest.approx(expected, abs=1e-9)
        assert np.abs(solution.displacement[0, :, 0]).max() < 1e-9


def test_remeshing_the_cut_body_is_as_good_as_imprinting_the_cut():
    scene = with_exact("airy", AIRY, **UNIFORM)
    imprinted, remeshed = (energy_errors(scene, mesh=mesh) for mesh in ("imprinted", "remeshed"))
    assert (imprinted > 0).all()  # boundary values are interpolated, yet the energy is above
    assert np.log2(imprinted[0] / imprinted[-1]) / 2 == pytest.approx(2.0, abs=0.1)
    # over the whole sequence: meshes made anew vary
    assert np.log2(remeshed[0] / remeshed[-1]) / 2 == pytest.approx(2.0, abs=0.2)
    # equal mean cell area; well-shaped cells are somewhat better, never twice as bad
    assert (remeshed < 2 * imprinted).all()
