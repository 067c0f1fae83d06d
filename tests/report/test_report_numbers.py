"""A number and the interval that it lies in are written so that the width can be seen."""

import pytest

from verify.report.notation import with_interval
from verify.report.stability_map import graded
from verify.report.tables import check_row
from verify.result import Verdict, VerdictRecord


@pytest.mark.parametrize(
    ("value", "half", "written"),
    [
        (1.995, 0.03, "1.995 [1.965, 2.025]"),
        (7.3651e-4, 1e-7, "7.365×10⁻⁴ [7.364×10⁻⁴, 7.366×10⁻⁴]"),
        (1.0017, 2e-5, "1.00170 [1.00168, 1.00172]"),
        (1.0443504632, 4e-11, "1.044 ± 4×10⁻¹¹"),
        (1.0, 0.0, "1.000"),
    ],
)
def test_an_interval_is_written_with_the_digits_that_tell_its_ends_apart(value, half, written):
    assert with_interval(value, value - half, value + half) == written


def test_a_value_is_written_with_the_digits_of_the_one_it_shall_have():
    """8.079 beside 8.078757937 ± 1e-05 would look like a failure."""
    found = VerdictRecord(
        "value", "reference", "strain_energy", Verdict.PASS, 8.0787592969, 8.0787592969,
        8.0787592969, "8.078757937 ± 1e-05 (relative)", "",
    )  # fmt: skip
    assert check_row(found)[1].text == "8.078759297"


@pytest.mark.parametrize(
    ("value", "grade", "written"),
    [
        (1.0, "good", "1"),
        (0.9, "good", "0.9"),
        (0.8973, "fair", "0.897"),
        (0.4968, "poor", "0.497"),
        (0.34, "poor", "0.34"),
        (0.0996, "bad", "9.96e-02"),
        (9.7e-13, "bad", "1e-12"),
        (0.0, "bad", "0e+00"),
    ],
)
def test_a_graded_number_is_not_rounded_up_to_the_grade_that_it_misses(value, grade, written):
    steps = [(0.9, "good"), (0.5, "fair"), (0.1, "poor")]
    assert graded(value, steps)[:2] == (grade, written)
