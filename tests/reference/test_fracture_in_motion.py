"""J and K of cracks in bodies in motion: inertia, domains of any size, an exact value."""

from dataclasses import replace

import numpy as np
import pytest
from reference_scenes import needs_fenicsx, polyline, square
from test_fracture import ALONG_X, ORIGIN, interpolated_tip
from test_front_fracture import FRONT, prism

from reference.exact.solution import hooke
from reference.fracture import front_intensity, stress_intensity, tips
from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.judge.quantities import Measured
from verify.judge.reference import known_quantity, size_of
from verify.scene import Material
from verify.solvers import find_solver

MOVING = Material(young=1.0, poisson=0.3, plane="strain", density=2.0)
SOLID = Material(young=1.0, poisson=0.3, density=2.0)
WAVES = 3.0  # wave number, 1/m
RADII = [0.2, 0.4, 0.8]


def with_waves(field, share):
    """Add a standing shear wave that leaves the crack free, at a moment in which it only turns.

    u = curl (cos kx cos ky): no stress but σ_xx = −σ_yy ∝ sin kx sin ky, which is zero on the crack
    y = 0; its frequency is that of waves at 45°, ω² = 2 k² μ/ρ (G. Lamé).
    """
    x, y = WAVES * field.points.T
    wave = share * WAVES * np.column_stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)])
    squared = 2 * WAVES**2 * hooke(MOVING).shear / MOVING.density
    return replace(
        field,
        displacement=field.displacement + wave,
        velocity=np.zeros_like(field.displacement),
        acceleration=-squared * wave[None],
    )


def test_waves_that_pass_the_tip_do_not_change_its_factors():
    field = interpolated_tip((0.7, -0.4), order=2)
    moving = with_waves(field, 0.5)
    found = stress_intensity(moving, MOVING, ORIGIN, ALONG_X, RADII)
    # the tip field alone is good to 2e-5 there, the wave to (k h)³ of its strain of 4.5
    assert found.domains == pytest.approx(np.tile([0.7, -0.4], (3, 1)), abs=2e-3)
    # the wave is no small one: without its inertia it would be
    still = replace(moving, velocity=None, acceleration=None)
    off = stress_intensity(still, MOVING, ORIGIN, ALONG_X, RADII).domains - [0.7, -0.4]
    assert np.abs(off).max() > 0.1


def test_a_body_in_free_fall_is_one_at_rest():
    field = interpolated_tip((0.7, -0.4), order=2)
    pull = np.array([3.0, -9.0])
    falling = replace(
        field,
        velocity=np.ones_like(field.displacement),
        acceleration=np.broadcast_to(pull / MOVING.density, field.displacement.shape),
    )
    at_rest = stress_intensity(field, MOVING, ORIGIN, ALONG_X, RADII)
    found = stress_intensity(falling, MOVING, ORIGIN, ALONG_X, RADII, pull)
    assert found.domains == pytest.approx(at_rest.domains, abs=1e-12)
    # with drag α the velocity of 1 m/s takes ρ α
    dragged = pull + 0.3 * MOVING.density
    found = stress_intensity(falling, MOVING, ORIGIN, ALONG_X, RADII, dragged, drag=0.3)
    assert found.domains == pytest.approx(at_rest.domains, abs=1e-12)


def test_a_front_in_antiplane_vibration_has_its_factor_in_every_tube():
    # w = sin(kr)/√r sin(θ/2) is a standing wave with free faces (the Bessel function J½), and
    # k √r sin(θ/2) at the front: K_III = μ k √(π/2)
    field = prism((0, 0, 0), n=16)
    points = field.points
    middles = np.repeat(points[field.cells[:, :4]].mean(axis=1), 10, axis=0)
    y = np.where(np.abs(points[:, 1]) < 1e-12, np.sign(middles[:, 1]) * 1e-300, points[:, 1])
    r, angle = np.hypot(points[:, 0], y), np.arctan2(y, points[:, 0])
    with np.errstate(invalid="ignore"):
        wave = np.where(r > 0, np.sin(WAVES * r) / np.sqrt(r) * np.sin(angle / 2), 0.0)
    u = np.column_stack([0 * r, 0 * r, wave])[None]
    shear = hooke(SOLID).shear
    squared = WAVES**2 * shear / SOLID.density
    moving = replace(field, displacement=u, velocity=0 * u, acceleration=-squared * u)
    found = front_intensity(moving, SOLID, FRONT, [0.3, 0.5, 0.8], stations=2)
    expected = shear * WAVES * np.sqrt(np.pi / 2)
    # as in statics: 6e-3 of the factor at that mesh
    assert found.domains[:, :, 2] == pytest.approx(np.full((3, 2), expected), rel=6e-3)
    still = replace(moving, velocity=None, acceleration=None)
    off = front_intensity(still, SOLID, FRONT, [0.8], stations=2).modes[:, 2] / expected - 1
    assert np.abs(off).min() > 0.05


POISSON = 0.3
PRESSURE_WAVE = float(np.sqrt((1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))))


def opened_suddenly():
    """Give a plate under tension in which an inclined crack of length 1 opens at the time 0.

    Until a pressure wave has come from the other end, each end is that of a half-infinite crack
    under a pressure that acts suddenly.
    """
    ahead = 0.5 * np.array([np.cos(np.deg2rad(20.0)), np.sin(np.deg2rad(20.0))])
    middle = np.array([1.5, 1.0])
    duration = 0.9 / PRESSURE_WAVE
    factor = {"kind": "stress_intensity", "name": "K_I", "end": "end"}
    return square(
        [polyline("cut", middle - ahead, middle + ahead)],
        geometry={"kind": "rectangle", "lower": [0, 0], "upper": [3, 2]},
        mesh={"pattern": "unstructured", "sizes": [0.1]},
        supports=[
            {"where": "bottom", "components": ["y"], "displacement": [0]},
            {"where": "left", "components": ["x"], "displacement": [0]},
        ],
        loads=[{"kind": "traction", "where": "top", "traction": [0, 1]}],
        initial={"kind": "equilibrium"},
        analysis={"kind": "dynamic", "kinematics": "linear", "duration": duration, "outputs": 4},
        reference={"size": 0.4},
        quantities=[factor, {**factor, "name": "K_I before", "time": duration * 2 / 3}],
    )


def sudden_factor(time, pressure):
    """K_I of a half-infinite crack a time after a pressure begins to act on its faces.

    L. B. Freund, Dynamic Fracture Mechanics (1990), section 2.5.
    """
    root = np.sqrt((1 - 2 * POISSON) * PRESSURE_WAVE * time / np.pi)
    return 2 * pressure * root / (1 - POISSON)


class TestOnTheReference:
    pytestmark = needs_fenicsx

    def test_domains_of_any_size_give_the_same_factor_of_a_suddenly_opened_crack(self):
        scene = opened_suddenly()
        solution = find_solver("reference").solve(scene, 0, repetitions=0)
        tip = tips(scene)[1]
        at = scene.material, tip.point, tip.direction
        shares = (1.0, 0.5, 0.25, 0.125)
        for step in (1, 3):
            found = [stress_intensity(solution, *at, s * tip.radii(), step=step) for s in shares]
            k = np.concatenate([one.domains[:, 0] for one in found])
            # what is left is how well the fields of both modes are interpolated, as in statics;
            # without inertia they are 20 % apart
            assert np.ptp(k) < 2e-3 * k.mean()

    @pytest.mark.heavy
    def test_the_stated_uncertainty_of_a_suddenly_opened_crack_covers_the_exact_factor(self):
        scene = opened_suddenly()
        body, law = body_of(scene), law_of(scene)
        solver = find_solver("reference")
        levels = [solver.solve(scene, level, repetitions=0) for level in range(3)]
        across = np.cos(np.deg2rad(20.0)) ** 2  # of the tension
        measured = [Measured(one, body, law, scene) for one in levels]
        sizes = [size_of(one) for one in levels]
        for asked in scene.quantities:
            values = [one.quantity(asked) for one in measured]
            known = known_quantity(asked, measured, values, sizes, falls=4.0)
            time = asked.time or scene.analysis.duration
            exact = sudden_factor(time, across)
            assert abs(known.value - exact) < known.half_width
            assert known.half_width < 0.03 * exact
