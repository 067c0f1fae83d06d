"""What was not measured is no finding: nothing passes on an empty set or is asserted unseen."""

import pytest

from verify.result import Verdict
from verify.study.finding import kept_by_all
from verify.study.slivers.findings import findings
from verify.study.slivers.measurement import Measurement


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_sweep_that_measured_nothing_decides_nothing(dimension):
    """The body without a cut is all there is."""
    names = ("critical step", "critical step of the smallest element")
    uncut = [Measurement(dimension, "uncut", 0.0, "keep", "", name, 0.1) for name in names]
    found = findings(uncut, [], [dimension])
    assert len(found) > 15
    assert {one.verdict for one in found} == {Verdict.UNDECIDED}


def test_a_sentence_holds_whatever_came_out():
    """An exponent that contradicts the expectation stands in a sentence that does not assert it."""
    names = ("critical step", "critical step of the smallest element")
    uncut = [Measurement(2, "uncut", 0.0, "keep", "", name, 0.1) for name in names]
    place = {"dimension": 2, "treatment": "keep", "placement": "along faces"}
    law = {"quantity": "critical step", "exponent": 1.0, "uncertainty": 0.01, "reason": "", **place}
    found = findings(uncut, [{**law, "variant": "side-wise"}, {**law, "variant": "HRZ"}], [2])
    said = {one.topic: one for one in found}
    bounded = said["2D critical step, side-wise"]
    assert bounded.verdict is Verdict.FAIL
    assert "stays bounded" not in bounded.sentence
    assert "1.000" in bounded.sentence
    assert "goes to zero" not in said["2D critical step that vanishes"].sentence


def test_all_of_nothing_is_undecided():
    assert kept_by_all([]) is Verdict.UNDECIDED
    assert kept_by_all([True, True]) is Verdict.PASS
    assert kept_by_all([True, False]) is Verdict.FAIL
