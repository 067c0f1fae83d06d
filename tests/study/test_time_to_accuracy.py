"""Every level of a reference: what it cost, and a bound of its error that the finest gives."""

from dataclasses import replace

import numpy as np
import pytest

from verify.assess.time_to_accuracy import time_to_accuracy
from verify.solution import Solution

TRIANGLE = Solution(np.eye(3)[:, :2], np.array([[0, 1, 2]]), np.zeros((1, 3, 2)))
LEVELS = {
    level: replace(TRIANGLE, unknowns=10 * 4**level, timings={"solve": [3.0, 1.0, 2.0 + level]})
    for level in range(3)
}


def test_bounds_hold_for_the_limit_of_a_sequence_and_fall_with_the_level():
    values = [2 + 0.4 * 4.0**-k for k in range(3)]  # the limit is 2
    norms = [0.12, 0.03]  # of a field whose errors are .16, .04, .01
    metrics = {
        "strain_energy": {"values": values, "uncertainty": 0.03},
        "energy_norm": {"values": norms, "uncertainty": 0.0125},
    }
    rows = time_to_accuracy(LEVELS, metrics)
    assert [row["unknowns"] for row in rows.values()] == [10, 40, 160]
    assert [row["seconds"] for row in rows.values()] == [2.0, 3.0, 3.0]
    for k, row in enumerate(rows.values()):
        assert abs(values[k] - 2) <= row["strain_energy"] * values[-1] <= 0.44 / 4**k + 0.03
        assert 0.16 / 4**k <= row["energy_norm"] <= 0.16 / 4**k + 0.0126


@pytest.mark.parametrize("finest", [1.0, -1.0])
def test_the_bound_of_the_finest_level_is_its_own_half_width(finest):
    metrics = {"u": {"values": [1.3, 1.1, finest], "uncertainty": 0.02}}
    assert time_to_accuracy(LEVELS, metrics)["level 2"]["u"] == pytest.approx(0.02)
