"""A drift that was put into an account is found, with its kind and its uncertainty."""

from dataclasses import replace

import numpy as np
import pytest

from verify.errors import InputError
from verify.study.energy.drift import secular_drift
from verify.study.energy.study import _way

PERIOD, SCALE = 0.7, 5.0


def account(slope, periods=20, amplitude=0.02, noise=0.0, steps=37.3, seed=0):
    """Energy in J: a level, a slope per period, an oscillation, and noise, all over the scale."""
    time = 3.0 + np.arange(int(periods * steps) + 2) * PERIOD / steps
    turn = (time - time[0]) / PERIOD
    random = np.random.default_rng(seed)
    share = slope * turn + amplitude * np.sin(2 * np.pi * turn + 0.4)
    share += noise * random.normal(size=len(time))
    return time, 100.0 + SCALE * share


@pytest.mark.parametrize("slope", [-3e-2, -1e-4, 2e-3])
def test_a_known_drift_is_found_under_an_oscillation(slope):
    """The aliasing of 37.3 instants per period into the means is what the tolerance allows."""
    found = secular_drift([account(slope, amplitude=0.01 * abs(slope))], PERIOD, SCALE)
    assert found.per_period == pytest.approx(slope, rel=1e-3)
    assert found.uncertainty < 1e-2 * abs(slope)
    assert found.kind == ("secular gain" if slope > 0 else "secular loss")
    assert found.periods == 20


def test_a_drift_without_oscillation_is_found_to_round_off():
    found = secular_drift([account(-1e-3, amplitude=0.0)], PERIOD, SCALE)
    # energies of 20 times the scale: round-off 1e-14 of them, over 20 periods
    assert found.per_period == pytest.approx(-1e-3, rel=1e-9)
    assert found.oscillation < 1e-12


def test_noise_widens_the_uncertainty_and_the_drift_stays_inside():
    """95 % of 200 draws, less four standard deviations of that."""
    inside = 0
    for seed in range(200):
        found = secular_drift([account(-1e-3, amplitude=0.0, noise=0.02, seed=seed)], PERIOD, SCALE)
        inside += abs(found.per_period + 1e-3) <= found.uncertainty
    assert inside >= 177


def test_a_pure_oscillation_is_bounded_and_has_its_amplitude():
    found = secular_drift([account(0.0, amplitude=0.03)], PERIOD, SCALE)
    assert found.kind == "bounded oscillation"
    assert found.oscillation == pytest.approx(0.03, rel=0.05)
    assert abs(found.per_period) <= found.uncertainty


def test_a_loss_that_is_no_line_is_told_by_its_trend_and_not_by_the_slope():
    """A fast decay to a level: the line through the means is as uncertain as it is steep."""
    time, energy = account(0.0, periods=8, amplitude=0.0)
    turn = (time - time[0]) / PERIOD
    # the means fall in a row until the last, which lies far above: the slope even rises
    energy = energy - SCALE * 1e-3 * np.minimum(turn, 7.0) + SCALE * 0.05 * (turn >= 7.0)
    found = secular_drift([(time, energy)], PERIOD, SCALE)
    assert abs(found.per_period) <= found.uncertainty
    assert not found.is_line
    assert found.kind != "secular gain"
    text = _way(replace(found, kind="secular loss"))
    assert "not along a line" in text
    assert "fall in a row" in text
    assert _way(secular_drift([account(-3e-2)], PERIOD, SCALE)) == "Secular loss:"


def test_a_constant_energy_is_kept():
    found = secular_drift([account(0.0, amplitude=0.0)], PERIOD, SCALE)
    assert found.kind == "kept"


def test_levels_that_differ_between_stages_are_no_drift_and_a_common_slope_is():
    stages = [account(-2e-3, 6, 0.0), account(-2e-3, 8, 0.0)]
    stages[1] = (stages[1][0] + 100.0, stages[1][1] + 3.0)
    found = secular_drift(stages, PERIOD, SCALE)
    assert found.per_period == pytest.approx(-2e-3, rel=1e-9)
    level = [(t, e * 0.0 + k) for k, (t, e) in enumerate(stages)]
    assert secular_drift(level, PERIOD, SCALE).kind == "kept"


def test_a_decay_that_ends_early_is_a_loss_although_its_line_says_little():
    time, _ = account(0.0, 12)
    found = secular_drift([(time, 5.0 * np.exp(-(time - 3.0) / 0.2))], PERIOD, SCALE)
    assert abs(found.per_period) < found.uncertainty
    assert found.kind == "secular loss"


@pytest.mark.parametrize(
    ("period", "scale", "stages", "message"),
    [
        (0.0, SCALE, [account(0.0)], "expected positive"),
        (PERIOD, 0.0, [account(0.0)], "expected positive"),
        (PERIOD, SCALE, [account(0.0, 3)], "a drift needs 5"),
        (PERIOD, SCALE, [account(0.0, 6), account(0.0, 1)], "2 in each"),
        (PERIOD, SCALE, [account(0.0, 20, steps=1.2)], "two instants"),
    ],
)
def test_what_a_drift_cannot_be_found_from_is_refused(period, scale, stages, message):
    with pytest.raises(InputError, match=message):
        secular_drift(stages, period, scale)
