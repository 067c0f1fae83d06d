"""Closed forms of a crack that is loaded suddenly, against other ways to the same numbers."""

from dataclasses import replace

import numpy as np
import pytest
from reference_scenes import needs_fenicsx

from reference.exact.moving_cracks import sudden_intensity, sudden_slip
from reference.exact.solution import Hooke, hooke
from verify.compare.body import body_of
from verify.compare.hooke import law_of
from verify.judge.convergence import extrapolate
from verify.judge.notices import ringing_factors
from verify.judge.quantities import Measured
from verify.judge.reference import known_quantity, size_of
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.solvers.conforming import _RADIUS_OF_JUMPS
from verify.study.calibration import trials
from verify.study.calibration_families import families

LAW = Hooke(lame=0.7, shear=0.4, dimension=2, density=2.0)
TIME = 0.9
WAVE = np.sqrt(0.2)


def test_the_slip_near_the_tip_is_that_of_the_factor():
    """K_III = (μ/4) √(2π/r) times the jump, to the order r/ct."""
    r = 1e-8
    found = 0.25 * LAW.shear * np.sqrt(2 * np.pi / r) * sudden_slip(1.3, LAW, r, TIME)
    assert found == pytest.approx(sudden_intensity("III", 1.3, LAW, TIME), rel=1e-7)


def test_factors_are_those_of_wiener_and_hopf_in_slownesses():
    a, b = np.sqrt(2.0 / 1.5), 1 / WAVE
    rayleigh = b**4 / (2 * (b**2 - a**2))
    split = {"I": rayleigh / a, "II": rayleigh / b, "III": b}  # F₊(0)²
    for mode, squared in split.items():
        expected = 2 * np.sqrt(2 * TIME / np.pi / squared)
        assert sudden_intensity(mode, 1.0, LAW, TIME) == pytest.approx(expected, rel=1e-12)
    nu = 0.7 / 2.2  # in mode I as Freund prints it
    printed = 2 * np.sqrt((1 - 2 * nu) / a * TIME / np.pi) / (1 - nu)
    assert sudden_intensity("I", 1.0, LAW, TIME) == pytest.approx(printed, rel=1e-12)


def faces_by_differences(n):
    """Distances (n,) behind the tip, jumps (n,), time: leapfrog for the half above the crack.

    A square of 1.2 m around the tip, farther than waves go; ahead of the tip the half is held.
    """
    h, reach = 0.6 / n, WAVE * TIME
    assert reach < 0.6
    x = (np.arange(-n, n) + 0.5) * h
    step = 0.5 * h / WAVE
    count = round(TIME / step)
    old = new = np.zeros((2 * n, n))
    for k in range(count):
        flux_x = np.diff(new, axis=0, prepend=new[:1], append=new[-1:])
        across = np.diff(new, axis=1, append=new[:, -1:])
        # values lie in the middle of cells: half a cell to what is held, −τ/μ on the free face
        below = np.where(x > 0.0, 2.0 * new[:, 0], -h / LAW.shear)
        flux_y = np.concatenate([below[:, None], across], axis=1)
        change = np.diff(flux_x, axis=0) + np.diff(flux_y, axis=1)
        # from rest: half of the change in the first step
        old, new = new, 2 * new - old + (0.25 if k else 0.125) * change
    behind = x < 0.0
    face = new[behind, 0] + 0.5 * h / LAW.shear
    return -x[behind], 2 * face, count * step


def test_the_slip_is_that_of_finite_differences():
    """Singular at the tip, so of first order in h: off by the tip's shift, a share of a cell."""
    off = []
    for n in (60, 120):
        r, jump, time = faces_by_differences(n)
        expected = np.array([sudden_slip(1.0, LAW, one, time) for one in r])
        far = r > 0.1
        off.append(np.abs(jump - expected)[far].max() / expected.max())
    assert off[1] < 0.6 * off[0]
    assert off[1] < 0.01


def factor_after_steps(radius, count):
    """Errors (count,) of K over K after 1, 2 … steps of generalised-α from a sudden load.

    K ∝ √t, the load 1/s times s^-½ in Laplace's transform, is the integral over ω of 1 − cos ωt,
    the answer of an oscillator, times ω^-3/2: neither mode nor mesh nor wave speed is left in it.
    Parameters of J. Chung, G. M. Hulbert, J. Appl. Mech. 60 (1993), 371-375.
    """
    old_mass, old_force = (2 * radius - 1) / (radius + 1), radius / (radius + 1)
    gamma, beta = 0.5 - old_mass + old_force, 0.25 * (1 - old_mass + old_force) ** 2
    omega, spacing = np.logspace(-7, 9, 8001), 16 * np.log(10) / 8000
    squared = omega**2
    u, v, a = np.zeros_like(omega), np.zeros_like(omega), squared.copy()
    found = []
    for _ in range(count):
        ahead = u + v + (0.5 - beta) * a
        mean = (1 - old_force) * ahead + old_force * u
        new = squared - old_mass * a - squared * mean
        new /= 1 - old_mass + squared * (1 - old_force) * beta
        u, v, a = ahead + beta * new, v + (1 - gamma) * a + gamma * new, new
        found.append(np.sum(u / np.sqrt(omega)) * spacing)
    return np.array(found) / np.sqrt(2 * np.pi * np.arange(1, count + 1)) - 1


def test_factors_are_of_second_order_from_the_second_step_after_a_jump():
    """With ½, what no step resolves dies out by 150 times where the order would give 16."""
    errors = np.abs(factor_after_steps(_RADIUS_OF_JUMPS, 32))[[1, 3, 7, 15, 31]]
    falls = errors[:-1] / errors[1:]
    assert (falls[1:] > 4.0).all()
    assert falls[2:] == pytest.approx([4.0, 4.0], rel=0.2)
    half = np.abs(factor_after_steps(0.5, 32))[[3, 7, 15]]
    assert half[0] / half[2] > 150.0


@pytest.mark.parametrize("steps", [2, 3, 4, 5, 6, 8, 10])
def test_half_widths_of_a_factor_after_so_many_steps_of_the_coarsest_level(steps):
    """They cover its error and are at most five times it; with ½ they were 11 to 1350 times."""
    errors = factor_after_steps(_RADIUS_OF_JUMPS, 4 * steps)[[steps - 1, 2 * steps - 1, -1]]
    known = extrapolate((1.0 + errors).tolist(), [4.0, 2.0, 1.0], formal=2.0, falls=4.0)
    assert 1.0 < known.half_width / abs(errors[-1]) < 5.0


@pytest.mark.parametrize("name", ["pressed", "sheared", "torn"])
def test_cases_state_the_numbers_of_the_closed_forms(name):
    scene = load_scene(f"dynamics/crack_{name}_suddenly")
    law, asked = hooke(scene.material), {one.name: one for one in scene.quantities}
    checks = [check for check in scene.acceptance if check.check == "value"]
    assert len(checks) >= len(asked)
    for check in checks:
        one = asked[check.metric]
        time = one.time or scene.analysis.duration
        if one.kind == "opening":
            expected = sudden_slip(1e-3, law, -one.point[0], time)  # the front is x = 0
        else:
            expected = sudden_intensity(one.mode, 1e-3, law, time)
        assert check.equals == pytest.approx(expected, rel=1e-5), check.metric


class TestOnTheReference:
    pytestmark = needs_fenicsx

    def test_steps_far_below_the_time_across_an_element_are_warned_of(self):
        """With 5 outputs a step is 0.84 h/c, with 40 a tenth of that."""
        scene = load_scene("dynamics/crack_pressed_suddenly")
        few = find_solver("reference").solve(scene, 0, repetitions=0)
        assert few.iterations["steps"] == 4
        assert not ringing_factors(scene, {0: few})
        many = replace(few, iterations={"steps": 39})
        (notice,) = ringing_factors(scene, {0: many})
        assert notice.about == "K_I_early, K_I_later, K_I_late"
        assert "0.0316 s, is 0.087 of the time" in notice.text
        rest = scene.model_copy(update={"quantities": []})
        assert not ringing_factors(rest, {0: many})

    def test_the_error_of_a_factor_is_that_of_its_steps_after_the_jump(self):
        """1.8 and 0.7 % at the fourth and sixth; elements leave less.

        Not at the last: a wave from the mouth is near, and steps smear it.
        """
        scene = load_scene("dynamics/crack_pressed_suddenly")
        solution = find_solver("reference").solve(scene, 1, repetitions=0)
        measured = Measured(solution, body_of(scene), law_of(scene), scene)
        expected = factor_after_steps(_RADIUS_OF_JUMPS, 6)[[3, 5]]
        for asked, error in zip(scene.quantities[:2], expected, strict=True):
            exact = sudden_intensity("I", 1e-3, hooke(scene.material), asked.time)
            assert measured.quantity(asked) / exact - 1 == pytest.approx(error, abs=1e-3)

    @pytest.mark.heavy
    def test_half_widths_of_factors_are_not_those_of_wave_fronts_elsewhere(self):
        """They were 46 to 440 times the errors with the order of the field in the whole body."""
        (family,) = (one for one in families(quick=False) if one.name == "sudden crack")
        found = trials(family, 3, seed=0)
        assert len(found) == 4
        for trial in found:
            assert 1.0 <= trial.ratio < 20.0, trial

    @pytest.mark.heavy
    @pytest.mark.parametrize(
        ("case", "mode"),
        [("crack_pressed_suddenly", "I"), ("crack_sheared_suddenly", "II")],
    )
    def test_half_widths_cover_the_factor_at_every_output(self, case, mode):
        """Outputs 0.45 h/c apart, closer than the natural step: ten factors per mode.

        Promised is 90 % of a family: nine of ten. In mode II the three levels at 1.08 s agree
        to 4e-4 by chance, and K is off by 1.1e-4, 2.4 half-widths.
        """
        scene = load_scene(f"dynamics/{case}")
        size, outputs = 0.3, 11
        times = np.linspace(0.0, scene.analysis.duration, outputs)[1:]
        (asked,) = scene.quantities[-1:]
        scene = scene.model_copy(update={
            "analysis": scene.analysis.model_copy(update={"outputs": outputs}),
            "reference": scene.reference.model_copy(update={"size": size}),
        })  # fmt: skip
        body, law = body_of(scene), law_of(scene)
        solver = find_solver("reference")
        solutions = [solver.solve(scene, level, repetitions=0) for level in range(3)]
        measured = [Measured(one, body, law, scene) for one in solutions]
        sizes, covered = [size_of(one) for one in solutions], []
        for time in times:
            one = asked.model_copy(update={"time": float(time)})
            values = [level.quantity(one) for level in measured]
            known = known_quantity(one, measured, values, sizes, falls=4.0)
            exact = sudden_intensity(mode, 1e-3, hooke(scene.material), time)
            covered.append(abs(known.value - exact) < known.half_width)
        assert np.mean(covered) >= 0.9, list(zip(times, covered, strict=True))
