"""A number and the interval that it lies in are written so that the width can be seen."""

import re

import pytest

from verify.report.notation import with_interval


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
    markup = str(with_interval(value, value - half, value + half))
    raised = markup
    for power, small in (("−4", "⁻⁴"), ("−11", "⁻¹¹")):
        raised = raised.replace(f"<sup>{power}</sup>", small)
    assert re.sub(r"<[^>]+>", "", raised) == written
