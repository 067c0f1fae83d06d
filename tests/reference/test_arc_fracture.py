"""K_I and K_II at the ends of arcs, from any field."""

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, square

from reference.exact import exact_solution
from reference.fracture import no_tip, stress_intensity, tips
from verify.judge.stress_intensity import exact_intensity
from verify.solvers import find_solver


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
    """Give K_I and K_II at both ends, (2, 2), from domains of a share of the usual radius."""
    found = [
        stress_intensity(
            solution, scene.material, t.point, t.direction, share * t.radii(), arc=t.arc
        )
        for t in tips(scene)
    ]
    return np.array([[one.mode_1, one.mode_2, one.release] for one in found])


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

    @pytest.mark.parametrize("start, sweep", [(-20.0, 100.0), (70.0, 200.0)])
    def test_factors_at_both_ends_are_the_exact_ones_from_every_domain(self, start, sweep):
        scene = plate_with_an_arc(start, sweep)
        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
        expected = np.array([exact.intensity_at(tip.point) for tip in tips(scene)])
        released = np.sum(expected**2, axis=1) / exact.law.plane_modulus
        found = {}
        for level in (0, 1):
            solution = find_solver("reference").solve(scene, level, repetitions=0)
            both = [factors(scene, solution, share) for share in (1.0, 0.25)]
            found[level] = [one[:, :2] for one in both]
            for one in both:  # quadratic in K: twice its share
                assert one[:, 2] == pytest.approx(released, abs=0.04 * released.max() / 2.5**level)
        off = {n: [np.abs(k - expected).max() for k in both] for n, both in found.items()}
        # straight edges along the arc: (h/R)²/8 of the sagitta at h = R/2.3, then half of it
        assert max(off[0]) < 0.02 * np.abs(expected).max()
        assert max(off[1]) < max(off[0]) / 2.5  # order 2, less what the meshes are not nested
        apart = np.abs(found[1][0] - found[1][1]).max()
        assert apart < 2e-3 * np.abs(expected).max()
