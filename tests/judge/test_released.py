"""Account of the energy that a blade released: differences, short waves, advance, the balance."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_solution
from verify.compare.blade import advance, released_metrics
from verify.compare.hooke import Hooke, difference_energy, law_of, short_wave_energy
from verify.compare.motion_account import motion_account
from verify.errors import InputError
from verify.solution import Solution
from verify.solvers import find_solver

POINTS = np.array([[0, 0], [2, 0], [2, 1], [0, 1]], dtype=float)
CELLS = np.array([[0, 1, 2], [0, 2, 3]])


class _Linear:
    """u = G x, v = H x."""

    def __init__(self, gradient, rate):
        self._gradient, self._rate = np.array(gradient), np.array(rate)

    def gradient(self, points, near):
        return np.broadcast_to(self._gradient, (len(points), 2, 2))

    def velocity(self, points, near):
        return points @ self._rate.T


def _moving(times, displacement, velocity):
    return Solution(POINTS, CELLS, np.array(displacement), times=np.array(times),
                    velocity=np.array(velocity), size=1.0)  # fmt: skip


def test_the_energy_of_a_difference_is_that_of_the_field_that_is_left():
    """Left are ∇u = [[0.1, 0], [0, 0]] and v = (y, 0): (λ/2 + μ) 0.01 · 2, and ρ/2 · 2/3."""
    own = POINTS @ np.array([[0.3, 0.2], [0.0, 0.4]]).T
    speed = POINTS @ np.array([[1.0, 1.0], [0.5, 2.0]]).T
    exact = _Linear([[0.2, 0.2], [0.0, 0.4]], [[1.0, 0.0], [0.5, 2.0]])
    found = difference_energy(_moving([0.0], [own], [speed]), 0, exact, Hooke(3.0, 2.0), 5.0)
    assert found == pytest.approx((5.0 / 3, (1.5 + 2.0) * 0.01 * 2))


def test_short_waves_are_told_from_a_slow_motion():
    """Amplitude 0.3 (x − 1) within the period: ρ/2 · 0.3²/2 · area 2 · 1/3.

    Beside it a drift of 2, and as fast a motion of the whole, which is none of a wave.
    """
    times, period = np.linspace(0.0, 2.0, 81), 0.4
    along, wave = POINTS[:, 0] - 1.0, np.sin(2 * np.pi * times / 0.2)
    speed = 2.0 + 0.3 * wave[:, None] * along
    velocity = np.stack([speed, np.outer(wave, np.ones(4))], axis=2)
    solution = _moving(times, 0 * velocity, velocity)
    assert short_wave_energy(solution, period, 7.0) == pytest.approx(7.0 / 2 * 0.045 * 2 / 3)
    slow = 0.3 * np.sin(2 * np.pi * times / 8.0)
    velocity = np.stack([np.column_stack([s * along, np.zeros(4)]) for s in slow])
    found = short_wave_energy(_moving(times, 0 * velocity, velocity), period, 7.0)
    assert found < 0.01 * 7.0 / 2 * 0.045 * 2 / 3
    with pytest.raises(InputError, match=r"output times are 0.025 s apart"):
        short_wave_energy(solution, 0.05, 7.0)


TIP = (0.0123, 0.0031)  # at the time 0, no node


def strip(speed=0.6, cells=(45, 11, 1), angle=0.0, **changes):
    """Take the exact strip: b = 0.1 m, G = 0.36 J/m², c = 1 m/s."""
    c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
    start, end = ([TIP[0] + r * c, TIP[1] + r * s, -0.001] for r in (-0.5, 0.15 * speed))
    content = {
        "geometry": scenes.box([0.2, 0.05, 0.01], [-0.2, -0.05, 0.0]),
        "mesh": {"cells": [list(cells)]},
        "material": {"young": 2500.0, "poisson": 0.25, "density": 1000.0},
        "analysis": {"kind": "dynamic", "duration": 0.15, "time_step": 0.005, "outputs": 3},
        "initial": {"kind": "field", "displacement": "exact", "velocity": "exact"},
        "supports": [
            {"where": w, "displacement": [0.0, 0.0], "components": ["x", "y"]}
            for w in ("bottom", "top")
        ]
        + [{"where": w, "displacement": "exact"} for w in ("left", "right", "front", "back")],
        "exact": {
            "solution": "blade_strip",
            "parameters": {"half_width": 0.1, "grip": 0.006, "speed": speed, "angle": angle,
                           "tip": list(TIP)},
        },
        "cuts": [{"kind": "tool_path", "points": [start, end], "speed": speed,
                  "starts_at": -0.5 / speed, "depth": 0.012, "direction": [0.0, 0.0, 1.0]}],
    }  # fmt: skip
    return scenes.scene(**content | changes)


@pytest.mark.parametrize("angle", [0.0, 17.0])
def test_the_advance_of_a_blade_is_what_it_sweeps_inside_the_body(angle):
    """Of the blade, 0.012 m deep, 0.01 m are in the slab; what it swept before 0 does not count."""
    assert advance(strip(0.6, angle=angle)) == pytest.approx(0.6 * 0.15 * 0.01, rel=1e-9)
    path = {"kind": "tool_path", "points": [[-0.5, 0.2], [1.0, 0.575]], "times": [-1.0, 2.0]}
    moving = {"kind": "dynamic", "duration": 2.0}
    plane = scenes.scene([path], material=scenes.soft(density=1.0), analysis=moving)
    # at the time 0 it is at (0, 0.325), on its way to (1, 0.575)
    assert advance(plane) == pytest.approx(np.hypot(1.0, 0.25), rel=1e-9)


@pytest.mark.parametrize(
    "solver, scheme, least, angle, most",
    [("xfem", "implicit_euler", 0.5, 17.0, 0.25), ("conforming", "newmark", 0.0, 17.0, 0.25)],
)
def test_what_a_blade_releases_is_found_again(solver, scheme, least, angle, most):
    """G = μ w₀²/b per unit advance: as waves, or dissipated; a general position is no exception.

    What is open has its end up to an element and a step behind the blade, at the start as at the
    end: 1.3 elements of the ten of the advance. The energies of the waves and of the smooth field
    add up but for their product. That changes with the same delay where the sides of the body
    move, in the inclined part of the strip: by 1.3 h/b, a ninth.
    """
    if solver == "conforming":
        pytest.importorskip("dolfinx_solver")
    scene = strip(angle=angle)
    found = find_solver(solver).solve(scene, 0, 0, scheme=scheme, opening="late")
    law = law_of(scene)
    exact = exact_solution("blade_strip", scene.exact.parameters, scene.material)
    account = motion_account(scene, found, law)
    metrics, _ = released_metrics(scene, found, found.size, law, account, exact)
    values = {metric.name: metric.value for metric in metrics}
    assert values["released"] == pytest.approx(0.36)
    assert values["released_mismatch"] < most
    assert least * 0.36 <= values["released_to_scheme"] + 1e-9
    if scheme == "newmark":  # nothing takes it: all of it is in the mesh
        assert abs(values["released_to_scheme"]) < 1e-9
        assert values["released_to_kinetic"] > 0.3 * 0.36


def test_a_solver_that_knows_every_step_tells_its_short_waves_whatever_the_outputs():
    """The same from outputs at every step, and nothing but that from two outputs."""
    pytest.importorskip("dolfinx_solver")
    cut = {"kind": "tool_path", "points": [[-0.1, 0.36], [1.1, 0.53]], "speed": 2.5}
    scene = scenes.scene(
        [cut],
        mesh={"cells": [[4, 4]]},
        material=scenes.soft(density=1.0, young=10.0),
        analysis={"kind": "dynamic", "duration": 0.6, "time_step": 0.02, "outputs": 31},
        initial={"kind": "equilibrium"},
        supports=[
            {"where": "bottom", "displacement": [0.0, 0.0]},
            {"where": "top", "displacement": [0.0, 0.02]},
        ],
    )
    apart = {"analysis": scene.analysis.model_copy(update={"outputs": 2})}
    found = find_solver("conforming").solve(scene, 0, 0)
    sparse = find_solver("conforming").solve(scene.model_copy(update=apart), 0, 0)
    period = 4 * found.size / np.sqrt(10.0 / 2 / (1 + scene.material.poisson))
    expected = short_wave_energy(found, float(period), 1.0)
    assert expected > 1e-4 * found.ledger["strain"][0]
    for one in (found, sparse):
        assert one.quantities["short_wave_energy"] == pytest.approx(expected, rel=1e-6)
