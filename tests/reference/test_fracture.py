"""K_I and K_II against closed forms on several domains, at ends of lines and arcs."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square

from reference.exact import exact_solution
from reference.fracture import no_tip, stress_intensity, tips
from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.judge.stress_intensity import exact_intensity
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


@pytest.mark.parametrize("intensity", [(0.0, 1.0), (0.7, -0.4)])
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


def plate_with_an_arc(start=-20.0, sweep=100.0):
    """Give a plate with an arc in it, held all around as in an infinite one under tension."""
    circle = {"centre": [1.45, 1.1], "radius": 0.5}
    covered = {"angle": start + sweep / 2, "half_angle": sweep / 2}
    parameters = {**circle, **covered, "stress": [0.3, 1.0, 0.2]}
    return square(
        [{"kind": "arc", **circle, "start": start, "sweep": sweep}],
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [3, 2.2]},
        mesh={"pattern": "unstructured", "sizes": [0.2, 0.1]},
        supports=[{"where": "boundary", "displacement": "exact"}],
        loads=[],
        exact={"solution": "arc_crack", "parameters": parameters},
        quantities=[
            {"kind": "stress_intensity", "name": f"K_{mode} {end}", "end": end, "mode": mode}
            for end in ("start", "end")
            for mode in ("I", "II")
        ],
    )


def factors(scene, solution, share=1.0):
    """Give the factors at all tips, from domains of a share of the usual radius."""
    return [
        stress_intensity(
            solution, scene.material, t.point, t.direction, share * t.radii(), arc=t.arc
        )
        for t in tips(scene)
    ]


def test_ends_of_arcs_are_tips_and_an_exact_solution_states_both():
    scene = plate_with_an_arc()
    start, end = tips(scene)
    assert (start.end, end.end) == ("start", "end")
    assert end.direction == pytest.approx([-np.sin(np.deg2rad(80)), np.cos(np.deg2rad(80))])
    assert start.direction == pytest.approx([-np.sin(np.deg2rad(20)), -np.cos(np.deg2rad(20))])
    exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    stated = [exact_intensity(scene, exact, asked) for asked in scene.quantities]
    assert stated == pytest.approx(np.ravel([exact.intensity_at(t.point) for t in (start, end)]))


def test_a_closed_arc_has_no_tips():
    scene = square([{"kind": "arc", "centre": [0.5, 0.5], "radius": 0.2}])
    assert "closed" in no_tip(scene, "cut", "start")
    assert tips(scene) == []


class TestOnTheReference:
    pytestmark = needs_fenicsx

    def solve(self, scene, level, solver="reference"):
        return find_solver(solver).solve(scene, level, repetitions=0)

    def test_a_griffith_crack_has_its_closed_form_intensity_at_both_tips(self):
        scene = load_scene("statics/griffith_edges")
        exact = exact_solution("griffith", scene.exact.parameters, scene.material)
        # an energy error of 3e-6 on this level: K is of the same order
        for found in factors(scene, self.solve(scene, 1)):
            assert [found.mode_1, found.mode_2] == pytest.approx(
                exact.stress_intensity, rel=5e-6, abs=5e-6
            )
            assert found.spread.max() < 2e-6

    def test_factors_at_both_ends_of_an_arc_are_the_exact_ones_from_every_domain(self):
        scene = plate_with_an_arc(70.0, 200.0)
        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
        expected = np.array([exact.intensity_at(tip.point) for tip in tips(scene)])
        released = np.sum(expected**2, axis=1) / exact.law.plane_modulus
        found = []
        for level in (0, 1):
            solution = self.solve(scene, level)
            both = [factors(scene, solution, share) for share in (1.0, 0.25)]
            found.append(np.array([[(t.mode_1, t.mode_2) for t in one] for one in both]))
            for one in both:  # quadratic in K: twice its share
                assert [t.release for t in one] == pytest.approx(
                    released, abs=0.04 * released.max() / 2.5**level
                )
        off = [np.abs(k - expected).max() for k in found]
        # straight edges along the arc: (h/R)²/8 of the sagitta at h = R/2.3, then half of it
        assert off[0] < 0.02 * np.abs(expected).max()
        assert off[1] < off[0] / 2.5  # order 2, less what the meshes are not nested
        assert np.abs(np.diff(found[1], axis=0)).max() < 2e-3 * np.abs(expected).max()

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
