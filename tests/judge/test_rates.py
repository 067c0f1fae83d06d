"""Notice of velocities that are not the rates of displacements."""

import re

import numpy as np
import pytest
from cut_meshes import grid
from scenes import scene

from verify.judge.notices import rate_notices
from verify.solution import Solution

DURATION, STEP = 3.2, 1e-3
OMEGA = 2 * np.pi  # of the slow of two modes, 1/s


def notices(path, rate, outputs, step=STEP):
    """Notices of a body all of whose nodes move by `path` along modes, and say `rate`."""
    analysis = {"kind": "dynamic", "duration": DURATION, "time_step": step, "outputs": outputs}
    material = {"young": 1.0, "poisson": 0.3, "density": 1.0, "plane": "strain"}
    case = scene([], analysis=analysis, material=material)
    points, cells = grid(3, 2)
    times = np.linspace(0.0, DURATION, outputs)
    modes = np.random.default_rng(2).normal(size=(2, *points.shape))
    u, v = (np.einsum("mt,mna->tna", np.array(f(times)), modes) for f in (path, rate))
    one = Solution(points, cells, u, times, velocity=v)
    return rate_notices(case, {"mine": {0: one}})


def oscillation(scale=1.0, quick=0.0):
    """Displacements and velocities of an exact oscillation, displacements on a clock of `scale`."""
    w = np.array([OMEGA, 29.0 * OMEGA])[:, None]
    size = np.array([1.0, quick / 29.0])[:, None]
    return (
        lambda t: size * np.sin(w * scale * t + 0.3),
        lambda t: size * w * np.cos(w * t + 0.3),
    )


@pytest.mark.parametrize("quick", [0.0, 0.2, 1.0])
@pytest.mark.parametrize("outputs", [2, 4, 5, 9, 17, 33, 65, 129, 257])
def test_an_exact_oscillation_is_not_warned_of_with_few_or_many_outputs(outputs, quick):
    assert not notices(*oscillation(quick=quick), outputs)


@pytest.mark.parametrize("outputs", [65, 129, 257])
def test_velocities_on_another_clock_are_warned_of(outputs):
    """Velocities 1 % too small: as where time runs 1 % faster than it says."""
    path, _ = oscillation(1.01)
    (found,) = notices(path, lambda t: oscillation()[1](1.01 * t), outputs)
    assert (found.about, found.solver) == ("velocities", "mine")
    said = re.search(r"not the rates of its displacements: off by (\S+) of", found.text)
    assert said
    assert float(said[1]) == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("outputs", [9, 33, 129])
def test_a_jump_of_velocity_between_outputs_is_not_warned_of(outputs):
    for at in np.linspace(0.05, 3.1, 97):

        def path(t, at=at):
            return np.array(
                [np.sin(t) - 1.7 * np.maximum(t - at, 0.0), 0.3 * np.maximum(t - 1.1, 0.0)]
            )

        def rate(t, at=at):
            return np.array([np.cos(t) - 1.7 * (t > at), 0.3 * (t > 1.1)])

        assert not notices(path, rate, outputs), at


@pytest.mark.parametrize("outputs", [33, 129])
def test_a_displacement_that_jumps_once_is_not_warned_of(outputs):
    path, rate = oscillation()
    assert not notices(lambda t: path(t) + 0.1 * (t > 1.23), rate, outputs)


def test_velocities_of_a_scheme_of_first_order_are_not_warned_of():
    """They are half a step late."""
    path, rate = oscillation()
    step = 0.02
    assert not notices(path, lambda t: rate(t - 0.49 * step), 129, step)
    assert notices(path, lambda t: rate(t - 2.0 * step), 129, step)
