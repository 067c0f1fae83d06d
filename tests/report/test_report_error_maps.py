"""Claims about the error maps: a scale that shows every solver, and the surroundings of a tip."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_run import cut_square

from verify.report.bodies import deformed_body
from verify.report.error_maps import scale_top


def body_with(values):
    body = deformed_body(cut_square(8), 0.0)
    return replace(body, values=np.resize(values, len(body.points)))


def test_a_solver_that_errs_a_hundred_times_more_does_not_wash_the_others_out():
    others = [body_with(np.linspace(0.0, most, 50)) for most in (1.0, 1.2, 1.5)]
    assert scale_top(others) == 1.5
    assert scale_top([*others, body_with([100.0])]) == pytest.approx(2 * 1.2, rel=0.05)
