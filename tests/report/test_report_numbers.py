"""A number and the interval that it lies in are written so that the width can be seen."""

import pytest

from verify.report.notation import error_text, number, with_interval
from verify.report.sliver_view import graded
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


def checked_error(value, half):
    return VerdictRecord(
        "error", "xfem", "energy_norm", Verdict.PASS, value, max(0.0, value - half), value + half,
        "relative error ≤ 0.1", "",
    )  # fmt: skip


def test_an_error_that_is_not_above_its_uncertainty_is_no_number():
    assert error_text(2e-3, 5e-3) == "not resolved (< 0.0070)"
    assert check_row(checked_error(2e-3, 5e-3))[1].text == "not resolved (< 0.0070)"
    assert error_text(6e-3, 5e-3) == "0.006000 ± 0.0050"
    assert "[" in check_row(checked_error(6e-3, 5e-3))[1].text


def test_the_bound_of_what_is_not_resolved_is_rounded_up():
    assert error_text(0.0, 1.01e-3) == "not resolved (< 0.0011)"
    assert error_text(0.0, 9.91e-2) == "not resolved (< 0.10)"


def test_an_exact_zero_without_uncertainty_stays_a_number():
    assert error_text(0.0, 0.0) == "0"


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
        (1.0, "good", "1.0"),
        (0.9, "good", "0.90"),
        (0.8973, "fair", "0.897"),
        (0.4968, "poor", "0.497"),
        (0.34, "poor", "0.34"),
        (0.0996, "bad", "0.0996"),
        (9.7e-13, "bad", "9.7×10⁻¹³"),
        (0.0, "bad", "0"),
    ],
)
def test_a_graded_number_is_not_rounded_up_to_the_grade_that_it_misses(value, grade, written):
    cell = graded(value, (0.9, 0.5, 0.1))
    assert (cell.grade, cell.text.split(" ")[1]) == (grade, written)


@pytest.mark.parametrize(
    ("value", "grade", "written"),
    [(1000.0, "good", "1000"), (1004.0, "fair", "1004"), (1.004e6, "bad", "1.004×10⁶")],
)
def test_a_graded_number_is_not_rounded_down_to_what_it_exceeds(value, grade, written):
    cell = graded(value, (1e3, 1e4, 1e6), most=True)
    assert (cell.grade, cell.text.split(" ")[1]) == (grade, written)


def test_an_error_that_is_no_number_is_shown_as_none():
    assert error_text(float("nan"), 1e-3) == number(float("nan"))
