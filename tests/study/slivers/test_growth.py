"""Exponents of synthetic power laws are found, and what is no power law gets none."""

import numpy as np
import pytest

from verify.study.slivers.growth import growth

SIZES = [0.5, 1e-1, *(10.0**-k for k in range(2, 13)), 0.0]


@pytest.mark.parametrize("exponent", [-3.0, -2.0, -0.5, 0.0, 1.0])
def test_an_exact_power_law_is_found_to_round_off(exponent):
    law = growth(SIZES, [7.0 * s**exponent if s else 7.0 for s in SIZES])
    assert law.exponent == pytest.approx(exponent, abs=1e-12)
    assert law.uncertainty < 1e-11
    assert law.points == 10


def test_scatter_widens_the_uncertainty_and_the_true_exponent_stays_inside():
    """A factor of up to 1.2 each way; 95 % of 200 draws, less four standard deviations of that."""
    random = np.random.default_rng(3)
    inside = 0
    for _ in range(200):
        law = growth(SIZES, [max(s, 1e-99) ** -2 * random.uniform(0.8, 1.25) for s in SIZES])
        assert law.uncertainty > 1e-3
        inside += abs(law.exponent + 2.0) <= law.uncertainty
    assert inside >= 177


def test_a_bend_is_no_power_law():
    law = growth(SIZES, [max(s, 1e-7) for s in SIZES])
    assert law.exponent is None
    assert "no single exponent" in law.reason


def test_sizes_without_a_value_are_named_and_too_few_give_no_exponent():
    values = [s**1.5 if s > 1e-9 else None for s in SIZES]
    law = growth(SIZES, values)
    assert law.exponent == pytest.approx(1.5, abs=1e-12)
    assert "1e-12" in law.reason
    law = growth([1e-3, 1e-4, 1e-5], [1.0, None, 2.0])
    assert law.exponent is None
    assert law.reason.startswith("2 positive values")
