"""A ledger fed with a known drift gives that drift; momenta of known motions are theirs."""

from types import SimpleNamespace

import numpy as np
import pytest
from case_texts import body_text
from cut_meshes import grid, quadratic
from solid_meshes import cube_grid

from verify.compare import mass
from verify.compare.blade import blade_forces, driving_force, swept_area
from verify.compare.mass import kinetic
from verify.compare.motion_account import balance, energy_scale, total_energy
from verify.errors import InputError
from verify.scene import load_scene
from verify.solution import Solution

TIMES = np.linspace(0.0, 2.0, 401)


def test_a_linear_drift_is_a_slope_without_oscillation():
    found = balance(TIMES, 5.0 - 3e-4 * TIMES)
    # the total is 5, its round-off 1e-15
    assert found.slope == pytest.approx(-3e-4, rel=1e-9)
    assert found.drift == pytest.approx(6e-4, rel=1e-9)
    assert found.oscillation < 1e-14
    assert found.slope_error < 1e-14


def test_an_energy_at_round_off_is_no_scale():
    noise = 1e-14 * np.sin(np.arange(len(TIMES)))
    still = {"gravity": 50.0 + noise, "kinetic": noise**2, "strain": np.abs(noise)}
    assert energy_scale(still) == 0.0
    assert energy_scale({"gravity": 50.0 + noise, "strain": 1e-6 + noise}) == pytest.approx(1e-6)


def test_a_bounded_oscillation_is_no_slope():
    wave = 1e-3 * np.cos(40 * np.pi * TIMES)  # whole periods
    found = balance(TIMES, 5.0 + wave)
    assert abs(found.slope) <= 2 * found.slope_error
    assert found.oscillation == pytest.approx(1e-3, rel=0.02)
    both = balance(TIMES, 5.0 + wave + 2e-3 * TIMES)
    assert both.slope == pytest.approx(2e-3, abs=2 * both.slope_error)


def test_jumps_at_cuts_are_told_from_the_trend():
    total = 5.0 - 1e-3 * TIMES + 0.02 * (TIMES > 0.5) - 0.07 * (TIMES > 1.3)
    found = balance(TIMES, total, [0.5, 1.3])
    assert found.jumps == pytest.approx([0.02, -0.07], rel=1e-9)
    assert found.slope == pytest.approx(-1e-3, rel=1e-9)
    assert found.oscillation < 1e-14
    # who does not know of the cuts sees them as oscillation
    assert balance(TIMES, total).oscillation > 0.01


def test_the_total_takes_off_what_was_put_in_and_never_reads_the_stated_one():
    stored, put_in = (
        ("kinetic", "strain", "gravity", "damping"),
        ("work_of_loads", "work_of_supports"),
    )
    names = (*stored, *put_in, "algorithmic", "removed_energy")
    ledger = {name: np.array([0.0, 2.0**k]) for k, name in enumerate(names)}
    ledger["total"] = np.array([9.0, 9.0])
    assert total_energy(ledger) == pytest.approx([0.0, 1 + 2 + 4 + 8 - 16 - 32])
    assert total_energy(ledger, scheme=True) == pytest.approx([0.0, -33 + 64 + 128])
    assert total_energy({"total": np.zeros(2)}) is None
    assert energy_scale(ledger) == 32.0


def spinning(points, spin, centre, push):
    """Velocity of a rigid motion."""
    d = points.shape[1]
    arm = points - centre
    turn = np.cross(spin, arm) if d == 3 else spin * np.column_stack([-arm[:, 1], arm[:, 0]])
    return turn + push


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("d", [2, 3])
def test_a_spinning_body_has_the_energy_and_momenta_of_a_rigid_one(d, order, compiled, monkeypatch):
    monkeypatch.setattr(mass, "COMPILED", compiled)
    points, cells = grid(3, 2) if d == 2 else cube_grid(2, 2, 2)
    if order == 2:
        points, cells = quadratic(points, cells)
    centre, push = np.full(d, 0.5), np.array([0.3, -0.2, 0.7])[:d]
    spin = 2.0 if d == 2 else np.array([1.0, -2.0, 0.5])
    v = spinning(points, spin, centre, push)
    shift = np.ones(d)  # the displacement moves the arm of the momentum
    one = Solution(
        points=points, cells=cells, displacement=np.stack([0 * v, 0 * v + shift]),
        times=np.array([0.0, 1.0]), velocity=np.stack([v, v]), order=order,
    )  # fmt: skip
    density = 3.0
    found = kinetic(one, density)
    # unit square or cube about its centre: 1/6 in the plane and about any axis in space
    inertia = density / 6
    rate = np.array([spin]) if d == 2 else spin
    energy = 0.5 * density * push @ push + 0.5 * inertia * rate @ rate
    assert found.energy == pytest.approx([energy] * 2, rel=1e-13)
    assert found.linear == pytest.approx(np.tile(density * push, (2, 1)), rel=1e-13)
    for step, place in enumerate((centre, centre + shift)):
        orbit = np.cross(place, density * push) if d == 3 else [
            density * (place[0] * push[1] - place[1] * push[0])
        ]  # fmt: skip
        assert found.angular[step] == pytest.approx(inertia * rate + orbit, rel=1e-12)
        assert found.spin[step] == pytest.approx(inertia * rate, rel=1e-12)


@pytest.mark.parametrize(("d", "order"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_scales_of_momenta_do_not_depend_on_whether_kernels_are_there(d, order, monkeypatch):
    points, cells = grid(5, 4) if d == 2 else cube_grid(3, 2, 4)
    if order == 2:
        points, cells = quadratic(points, cells)
    u, v = np.random.default_rng(2).normal(size=(2, 3, *points.shape))
    one = Solution(points, cells, u, times=np.arange(3.0), velocity=v, order=order)
    some, found = np.arange(len(cells))[::3], []
    for compiled in (True, False):
        monkeypatch.setattr(mass, "COMPILED", compiled)
        found.append(kinetic(one, 2.0, some))
    assert found[0].linear_scale == pytest.approx(found[1].linear_scale, rel=1e-13)
    assert found[0].angular_scale == pytest.approx(found[1].angular_scale, rel=1e-13)
    assert found[0].linear_scale > np.linalg.norm(found[0].linear, axis=1).max()


def test_a_blade_that_rests_has_no_driving_force_and_one_that_moves_has_the_mean():
    advance = np.array([0.0, 0.0, 0.5, 1.0, 1.0, 1.0, 2.0, 3.0])
    work = np.array([0.0, 0.0, 1.0, 2.0, 2.5, 3.0, 5.0, 7.0])
    found = driving_force(advance, work, 1.0)
    assert np.isnan(found[[0, 4]]).all()
    # over half a metre before and after, cut off at the ends; what came at rest is before 1.0
    np.testing.assert_allclose(found[[1, 2, 6, 7]], [2.0, 3.0, 2.0, 2.0])
    assert np.isnan(driving_force(np.zeros(3), work[:3], 1.0)).all()


MOTION = '[analysis]\nkind = "dynamic"\nduration = 4.0\noutputs = 5\n'
BLADE = """
[[cuts]]
kind = "tool_path"
name = "{name}"
points = [[0, {y}, 1.2], [0.6, {further}, 1.2], [1.2, {y}, 1.2]]
speed = 0.5
depth = 0.7
direction = [0, 0, -1]
"""


def blades(tmp_path, text):
    body = body_text(
        "blades", "Forces shall be right.", [2.0, 1.0, 1.0], [[4, 4, 4]], density="1e3"
    )
    (tmp_path / "blades.toml").write_text(body + MOTION + text)
    return load_scene(tmp_path / "blades.toml")


def test_what_a_toughness_asks_is_that_of_the_area_in_the_body_less_the_driving_force(tmp_path):
    """The way is two slopes of 0.6 by 0.8 m, 0.5 m of the blade is in the body."""
    one = BLADE.format(name="first", y=0.1, further=0.9) + "toughness = 30.0\n"
    scene = blades(tmp_path, one)
    times = np.array([0.0, 0.5, 1.0, 3.0, 4.0])
    stated = {"cut_work": np.array([0.0, 1.0, 2.0, 6.0, 8.0])}
    forces = blade_forces(scene, SimpleNamespace(times=times, stated=stated))
    assert list(forces) == ["driving_force_first", "resistance_first"]
    np.testing.assert_allclose(forces["driving_force_first"], 4.0)  # 2 J/s at 0.5 m/s
    np.testing.assert_allclose(forces["resistance_first"], 30.0 * 0.5 - 4.0)
    # of two blades the ledger has to tell them apart
    two = blades(tmp_path, one + BLADE.format(name="second", y=0.95, further=0.95))
    assert blade_forces(two, SimpleNamespace(times=times, stated=stated)) == {}
    told = stated | {"cut_work_second": 3.0 * stated["cut_work"]}
    forces = blade_forces(two, SimpleNamespace(times=times, stated=told))
    assert list(forces) == ["driving_force_second"]


SWINGING = """
[[cuts]]
kind = "tool_path"
points = [[0.3, 0.4, 0.45], [0.3, 0.4, 0.45], [0.3, 0.4, 0.45], [0.9, 0.4, 0.65]]
times = [0.5, 1.5, 2.0, 3.0]
depth = 0.4
direction = [[-0.6, 0, 0.8], [0.6, 0, 0.8], [0.6, 0, 0.8], [0.6, 0, 0.8]]
toughness = 30.0
"""


def test_a_blade_that_swings_about_its_resting_tip_sweeps_a_sector(tmp_path):
    """Its other end goes along the chord; a part until the middle has half of the triangle."""
    scene = blades(tmp_path, SWINGING)
    (cut,) = scene.cuts
    whole, moved = 0.5 * 0.48 * 0.32, np.linalg.norm(np.cross([0.6, 0, 0.2], [0.24, 0, 0.32]))
    for start, end, area in (
        (0.0, 0.5, 0.0), (0.0, 1.0, whole / 2), (1.0, 1.5, whole / 2), (0.7, 0.9, whole / 5),
        (1.2, 1.8, 0.3 * whole), (1.5, 2.0, 0.0), (1.3, 2.5, 0.2 * whole + moved / 2),
        (0.0, 4.0, whole + moved), (3.0, 4.0, 0.0),
    ):  # fmt: skip
        assert swept_area(scene, [cut], start, end) == pytest.approx(area, rel=1e-9, abs=1e-15)
    # what it asks while it swings: R times the area per way of its end, 0.48 m along the chord
    stated = {"cut_work": np.zeros(5)}
    times = np.array([0.5, 0.75, 1.0, 1.25, 1.5])
    forces = blade_forces(scene, SimpleNamespace(times=times, stated=stated))
    np.testing.assert_allclose(forces["resistance_cut"], 30.0 * whole / 0.48)


def test_a_path_that_begins_anew_elsewhere_counts_the_jump_once(tmp_path):
    """In the plane; the tip is moved at once at 1 s, and what lies between is cut then."""
    body = body_text("blade", "It shall count.", [2.0, 1.0], [[4, 4]], density="1e3")
    path = '[[cuts]]\nkind = "tool_path"\ntimes = [0.0, 1.0, 1.0, 2.0]\n'
    path += "points = [[0.2, 0.3], [0.6, 0.6], [0.9, 0.2], [1.2, 0.6]]\n"
    (tmp_path / "jump.toml").write_text(body + MOTION + path)
    scene = load_scene(tmp_path / "jump.toml")
    parts = [swept_area(scene, scene.cuts, *ends) for ends in ((-1, 0.5), (0.5, 1), (1, 1.5))]
    np.testing.assert_allclose(parts, [0.25, 0.75, 0.25])


def test_a_cut_that_no_blade_makes_has_no_toughness(tmp_path):
    cut = '[[cuts]]\nkind = "disc"\ncentre = [1, 0.5, 0.5]\nnormal = [1, 0, 0]\nradius = 0.2\n'
    with pytest.raises(InputError, match=r"toughness: no blade makes this cut; expected it with"):
        blades(tmp_path, cut + "toughness = 30.0\n")
