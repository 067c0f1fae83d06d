"""Second routes that are programs of their own, with a blade or finite rotation."""

import tomllib
from functools import partial
from pathlib import Path

import c3_strip
import c5_blade
import c6_block
import c7_spinning
import numpy as np
import pytest

VALUES = Path(__file__).resolve().parents[2] / "cases/benchmark/values.toml"
PROGRAMS = {
    "c3_strip": c3_strip.second_route,
    "c5_blade_01": partial(c5_blade.second_route, 0.1),
    "c5_blade_03": partial(c5_blade.second_route, 0.3),
    "c5_blade_06": partial(c5_blade.second_route, 0.6),
    "c6_block": c6_block.second_route,
    "c7_spinning": c7_spinning.second_route,
}


@pytest.mark.heavy
@pytest.mark.parametrize("scene", PROGRAMS)
def test_a_program_gives_what_is_stated(scene):
    values = tomllib.loads(VALUES.read_text("utf-8"))[scene]
    found = PROGRAMS[scene]()
    for name, (first, second) in values.items():
        stated, wide = map(float, second.split(" ± "))
        value, half_width = found[name]
        print(f"{name:20} {first:28} {value:.8g} ± {half_width:.1g}")
        assert abs(value - stated) <= 0.1 * wide, name  # round-off, and what is rounded off
        assert half_width <= 1.01 * wide, name


def test_a_strained_body_at_rest_has_no_momentum_on_elements_that_move():
    speed, slope, time = 0.45, 0.03, 0.13
    strip = c5_blade.Strip(speed, 2)
    u = slope * strip.places(time)
    rate = speed * slope * (1 - np.abs(strip.x) / c5_blade.HALF_LENGTH)
    mass, carried, twice, stiffness, _ = strip.matrices(time)
    scale = np.abs(mass @ rate).max()
    assert np.abs(mass @ rate - carried @ u).max() <= 1e-12 * scale
    assert np.abs(carried.T @ rate - twice @ u).max() <= 1e-12 * np.abs(twice @ u).max()
    force = stiffness @ u
    assert np.abs(force[np.abs(strip.x) < 0.29]).max() <= 1e-12 * np.abs(force).max()
    area = 2 * c5_blade.HALF_LENGTH * c5_blade.WIDTH
    strained = 0.5 * c5_blade.SHEAR * slope**2 * area
    assert strip.energy(time, u, rate) == pytest.approx(strained, rel=1e-12)


def test_a_blade_at_a_speed_that_no_scene_has_takes_what_the_closed_form_says():
    speed, g = 0.45, np.sqrt(1 - 0.45**2)
    found = c5_blade.outputs(speed, 8)
    opening = 2 * c5_blade.exact(c5_blade.PLACE, 0.0, c5_blade.END, speed)[0]
    assert found["opening_behind"] == pytest.approx(opening, rel=1e-3)
    assert found["K_III"] == pytest.approx(1000 * 0.006 * np.sqrt(2 * g / 0.1), rel=1e-2)
    assert found["energy_taken"] == pytest.approx(1000 * 0.006**2 / 0.1, rel=1e-3)


def test_a_turned_body_that_nothing_strains_is_at_rest():
    """Middles of edges that lie beside them strain it: so this program was wrong at first."""
    nodes, triangles, *_ = c7_spinning.grid(4)
    body = c7_spinning.Body(nodes, triangles)
    turn = np.array([[np.cos(2.0), np.sin(2.0)], [-np.sin(2.0), np.cos(2.0)]])
    forces, energy = body.forces(nodes @ turn)
    scale = c7_spinning.YOUNG * c7_spinning.SIZE.prod()
    assert energy <= 1e-15 * scale
    assert np.abs(forces).max() <= 1e-12 * c7_spinning.YOUNG * c7_spinning.SIZE.max()


def test_parts_of_a_spinning_body_keep_mass_and_momentum_together():
    found = c7_spinning.outputs(2, 2e-4)
    mass = c7_spinning.DENSITY * c7_spinning.SIZE.prod()
    assert found["mass_below"] + found["mass_above"] == pytest.approx(mass, rel=1e-12)
    for axis, speed in zip("xy", c7_spinning.VELOCITY, strict=True):
        whole = found[f"momentum_below_{axis}"] + found[f"momentum_above_{axis}"]
        assert whole == pytest.approx(mass * speed, rel=1e-9)


def test_forces_at_the_path_fade_from_one_to_zero_and_are_half_in_the_middle():
    n = 4
    for node in range(2 * n + 1):
        first, last = max((node - 1) // 2, 0), min(node // 2 + 1, n)
        assert c6_block.unswept(node, first, n) == pytest.approx(1.0, abs=1e-15)
        assert c6_block.unswept(node, last, n) == pytest.approx(0.0, abs=1e-15)
        if 0 < node < 2 * n:
            assert c6_block.unswept(node, 0.5 * node, n) == pytest.approx(0.5, abs=1e-15)
