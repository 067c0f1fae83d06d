"""Studies over families of scenes, by any solver: their commands, records, pages and faults."""

import pytest

from verify.result import Verdict
from verify.study.measured_scenes import Measurement
from verify.study.slivers.findings import findings


@pytest.mark.parametrize(
    ("near", "far", "verdicts"),
    [
        (1.04, 1.2, [Verdict.PASS, Verdict.PASS]),
        (1.06, 1.3, [Verdict.FAIL, Verdict.FAIL]),
        (0.94, 0.5, [Verdict.FAIL, Verdict.PASS]),
    ],
)
def test_errors_are_held_against_the_row_at_zero_and_the_conforming_mesh(near, far, verdicts):
    def row(solver, size, value):
        return Measurement("family", size, solver, "displacement_l2", "", value)

    measured = [row("own", 0.5, far), row("own", 1e-6, near), row("own", 0.0, 1.0)]
    measured += [row("conforming", 0.5, 1.0)]
    assert [f.verdict for f in findings(measured, [])] == verdicts
