"""K_III at a blade that advances, from the jump behind it: exact field, signs, times."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_solution
from verify.compare.blade import blade_front, blade_intensity
from verify.compare.body import body_of
from verify.compare.motion import ExactMotion
from verify.judge.stress_intensity import intensity_defect
from verify.scene.acceptance import StressIntensityQuantity


def _strip(speed, angle, upwards=True):
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    start, end = ([0.02 + r * c, 0.01 + r * s, -0.01] for r in (-0.6, 0.1 * speed))
    blade = 1.0
    if not upwards:
        start, end, blade = [*start[:2], 0.03], [*end[:2], 0.03], -1.0
    return scenes.scene(
        [{"kind": "tool_path", "points": [start, end], "speed": speed,
          "starts_at": -0.6 / speed, "depth": 0.05, "direction": [0.0, 0.0, blade]}],
        geometry=scenes.box([0.3, 0.05, 0.02], [-0.3, -0.05, 0.0]),
        mesh={"cells": [[8, 3, 1]]},
        material={"young": 2500.0, "poisson": 0.25, "density": 1000.0},
        analysis={"kind": "dynamic", "duration": 0.1},
        supports=[{"where": "boundary", "displacement": "exact"}],
        exact={"solution": "blade_strip",
               "parameters": {"half_width": 0.1, "grip": 0.006, "speed": speed, "angle": angle,
                              "tip": [0.02, 0.01]}},
        initial={"kind": "field", "displacement": "exact", "velocity": "exact"},
        quantities=[{"kind": "stress_intensity", "name": "K", "end": "end", "mode": "III",
                     "radius": 0.03, "time": 0.05}],
    )  # fmt: skip


@pytest.mark.parametrize(
    "speed, angle, upwards", [(0.1, 0.0, True), (0.6, 14.0, False), (0.3, -14.0, True)]
)
def test_the_exact_field_has_its_own_intensity(speed, angle, upwards):
    """Terms beyond the fit: (πr/2bg)² of the jump over 160, below 0.2 % for r = 0.3 b, g = 0.8."""
    scene = _strip(speed, angle, upwards)
    body = body_of(scene)
    exact = exact_solution("blade_strip", scene.exact.parameters, scene.material)
    found = blade_intensity(scene, ExactMotion(exact, 0.1), body, scene.quantities[0])
    assert found == pytest.approx(exact.stress_intensity[2], rel=2e-3)
    front = blade_front(scene.cuts[0], body, 0.05)
    assert front.speed == pytest.approx(speed)
    tip = [0.02 + 0.05 * speed * np.cos(np.deg2rad(angle)),
           0.01 + 0.05 * speed * np.sin(np.deg2rad(angle)), 0.01]  # fmt: skip
    np.testing.assert_allclose(front.point, tip, atol=1e-9)


@pytest.mark.parametrize(("lag", "low"), [(0.02, 0.039), (0.1, 0.209), (0.2, 0.480)])
def test_a_tip_behind_the_blade_reads_less(lag, low):
    """By the least-squares fit of √(r − s) to √r, r^(3/2); the strip is no half-plane: a tenth."""
    scene = _strip(0.3, 0.0)
    exact = exact_solution("blade_strip", scene.exact.parameters, scene.material)

    class Behind(ExactMotion):
        def at(self, time):
            return super().at(time - lag * 0.03 / 0.3)

    found = blade_intensity(scene, Behind(exact, 0.1), body_of(scene), scene.quantities[0])
    assert 1.0 - found / exact.stress_intensity[2] == pytest.approx(low, rel=0.1)


def test_modes_1_and_2_are_not_measured_at_a_tip_that_advances():
    """Their fields are not those of a tip at rest; after it has stopped they are."""
    path = {"kind": "tool_path", "points": [[-0.5, 0.2], [0.5, 0.4]], "times": [-1.0, 1.0]}
    analysis = {"kind": "dynamic", "duration": 2.0, "outputs": 5}
    scene = scenes.scene([path], material=scenes.soft(density=1.0), analysis=analysis)
    for time, refused in ((0.5, True), (1.0, True), (1.5, False)):
        asked = StressIntensityQuantity(kind="stress_intensity", name="K", end="end", time=time)
        assert ("a tip that advances" in (intensity_defect(scene, asked) or "")) == refused
