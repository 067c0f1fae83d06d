"""K_I and K_II against closed forms and high-order solutions, on several domains."""

import numpy as np
import pytest
from reference_scenes import TENSION, needs_fenicsx, plate, polyline, square

from reference.exact import exact_solution
from reference.fracture import stress_intensity, tips
from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.scene import Material, load_scene
from verify.solution import Solution
from verify.solvers import find_solver

STRAIN = Material(young=1.0, poisson=0.3, plane="strain")
MODULUS = 1 / (1 - 0.3**2)
ORIGIN, ALONG_X = np.zeros(2), np.array([1.0, 0.0])


def interpolated_tip(intensity, order=1, n=64):
    """Give the exact tip field at the nodes of a uniform mesh of [−1, 1]² cut along x < 0."""
    points, cells = structured_triangles((-1.0, -1.0), (1.0, 1.0), (n, n))
    mesh = open_cut(*imprint(points, cells, [np.array([[-1.0, 0.0], [0.0, 0.0]])]))
    corner = mesh.points[mesh.cells]
    nodes, points = mesh.cells, mesh.points
    middle = corner.mean(axis=1)
    if order == 2:  # mid-nodes of each cell of its own: the field is continuous all the same
        mid = 0.5 * (corner + np.roll(corner, -1, axis=1)).reshape(-1, 2)
        nodes = np.hstack([nodes, len(points) + np.arange(len(mid)).reshape(-1, 3)])
        points = np.vstack([points, mid])
    near = np.empty_like(points)
    near[nodes] = middle[:, None]
    exact = exact_solution("tip", {"tip": [0.0, 0.0], "intensity": intensity}, STRAIN)
    return Solution(points, nodes, exact.displacement(points, near)[None], order=order)


@pytest.mark.parametrize("intensity", [(1.0, 0.0), (0.0, 1.0), (0.7, -0.4)])
def test_both_modes_are_told_apart_in_the_exact_tip_field(intensity):
    # away from the tip the interpolant is off by h/r squared (P1 superconverges little), and
    # the integral is linear in the gradient's error: percents for P1, 1e-4 for P2
    for order, tolerance in ((1, 5e-3), (2, 2e-5)):
        field = interpolated_tip(intensity, order)
        found = stress_intensity(field, STRAIN, ORIGIN, ALONG_X, [0.4, 0.6, 0.8])
        assert [found.mode_1, found.mode_2] == pytest.approx(intensity, abs=tolerance)
        assert found.spread.max() < tolerance
        # Irwin's (K_I² + K_II²)/E'; the field times its own error, twice as often as in K
        expected = (intensity[0] ** 2 + intensity[1] ** 2) / MODULUS
        assert found.release == pytest.approx(expected, abs=2 * tolerance)


def test_the_intensity_does_not_depend_on_the_axes():
    field = interpolated_tip((0.7, -0.4), 2)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s], [s, c]])
    turned = Solution(
        field.points @ turn.T + [3.0, 1.0], field.cells, field.displacement @ turn.T, order=2
    )
    one = stress_intensity(field, STRAIN, ORIGIN, ALONG_X, [0.51])
    two = stress_intensity(turned, STRAIN, np.array([3.0, 1.0]), turn @ ALONG_X, [0.51])
    assert [two.mode_1, two.mode_2] == pytest.approx([one.mode_1, one.mode_2], abs=1e-12)
    assert two.release == pytest.approx(one.release, abs=1e-12)


def test_only_ends_inside_the_body_that_end_free_are_tips():
    cuts = [
        polyline("edge", (-0.1, 0.35), (0.4, 0.35)),
        polyline("main", (0.2, 0.6), (0.8, 0.6)),
        polyline("branch", (0.5, 0.6), (0.5, 0.9)),
    ]
    found = {(tip.cut, tip.end): tip for tip in tips(square(cuts))}
    assert set(found) == {("edge", "end"), ("main", "start"), ("main", "end"), ("branch", "end")}
    assert found["branch", "end"].direction == pytest.approx([0.0, 1.0])
    assert found["branch", "end"].reach == pytest.approx(0.1)  # the boundary
    assert found["main", "end"].reach == pytest.approx(0.2)
    assert found["branch", "end"].nearest == "the boundary"
    assert found["edge", "end"].reach == pytest.approx(0.25)
    assert found["edge", "end"].nearest == "cut 'main'"


INCLINED = 0.4 / np.sqrt(2)
PLATES = {
    # values of high-order elements graded geometrically to the tips, good to 2e-6
    "single edge": (
        plate(1, 2, [polyline("a", (0, 1), (0.5, 1))], TENSION),
        (2.825465 * np.sqrt(np.pi * 0.5), 0.0),
    ),
    "edge, sheared": (
        plate(
            7,
            16,
            [polyline("a", (0, 8), (3.5, 8))],
            {"top": [1, 0]},
            [{"where": "bottom", "displacement": [0, 0]}],
        ),
        (34.0426, 4.5370),
    ),
    "centre, inclined": (
        plate(
            1,
            4,
            [polyline("a", (-INCLINED, 2 - INCLINED), (INCLINED, 2 + INCLINED))],
            TENSION,
            left=-1.0,
        ),
        (0.571827 * np.sqrt(np.pi * 0.4), 0.528982 * np.sqrt(np.pi * 0.4)),
    ),
    "cruciform": (
        plate(
            1,
            2,
            [polyline("a", (-0.25, 1), (0.25, 1)), polyline("b", (0, 0.75), (0, 1.25))],
            TENSION | {"left": [-1, 0], "right": [1, 0]},
            left=-1.0,
        ),
        (0.900153 * np.sqrt(np.pi * 0.25), 0.0),
    ),
}


class TestOnTheReference:
    pytestmark = needs_fenicsx

    def solve(self, scene, level, solver="reference"):
        return find_solver(solver).solve(scene, level, repetitions=0)

    @pytest.mark.parametrize("case", ["griffith_edges", "griffith_inside"])
    def test_a_griffith_crack_has_its_closed_form_intensity_at_both_tips(self, case):
        scene = load_scene(f"statics/{case}")
        exact = exact_solution("griffith", scene.exact.parameters, scene.material)
        field = self.solve(scene, 1)
        for tip in tips(scene):
            found = stress_intensity(field, scene.material, tip.point, tip.direction, tip.radii())
            # an energy error of 3e-6 on this level: K is of the same order
            assert [found.mode_1, found.mode_2] == pytest.approx(
                exact.stress_intensity, rel=5e-6, abs=5e-6
            )
            assert found.spread.max() < 2e-6

    @pytest.mark.parametrize("name", PLATES)
    def test_plates_have_the_known_intensities(self, name):
        scene, known = PLATES[name]
        field = self.solve(scene, 1)
        for tip in tips(scene):
            found = stress_intensity(field, scene.material, tip.point, tip.direction, tip.radii())
            assert [found.mode_1, found.mode_2] == pytest.approx(known, rel=3e-5, abs=3e-5)

    def test_the_weight_of_the_body_belongs_to_the_integral(self):
        # a hanging strip cut halfway: with ρg in it K does not depend on the domain
        scene = load_scene("statics/tissue_strip")
        (tip,) = tips(scene)
        field = self.solve(scene, 1)
        arguments = (field, scene.material, tip.point, tip.direction, tip.radii())
        with_weight = stress_intensity(*arguments, body_force=np.array([0.0, -9800.0]))
        without = stress_intensity(*arguments)
        assert with_weight.spread[0] < 1e-5 * with_weight.mode_1
        assert without.spread[0] > 100 * with_weight.spread[0]

    def test_it_is_measured_on_an_unfitted_solution_too(self):
        scene = load_scene("statics/griffith_edges")
        errors = []
        for level in (1, 2):
            field = self.solve(scene, level, "xfem")
            (tip, _) = tips(scene)
            found = stress_intensity(field, scene.material, tip.point, tip.direction, tip.radii())
            errors.append(abs(found.mode_1 / np.sqrt(np.pi) - 1))
        # no tip enrichment: K is of order 1, some per cent on meshes of 32 and 64 cells
        assert errors[1] < 0.6 * errors[0]
        assert errors[1] < 0.05
