"""The exit code says the worst that is certain."""

import itertools
from dataclasses import replace

import pytest

from verify.reference_record import ReferenceRecord
from verify.result import CaseResult, SolveRecord, Status, Verdict, VerdictRecord
from verify.runner import exit_code


def result(verdicts=(), statuses=()):
    judged = [VerdictRecord("value", "xfem", "m", v, 1, 1, 1, "", "") for v in verdicts]
    solves = [SolveRecord("c", "xfem", i, status) for i, status in enumerate(statuses)]
    return CaseResult("c", "", "", "", {}, ReferenceRecord(), solves, [], judged)


PASS, FAIL, UNDECIDED, ERROR = Verdict.PASS, Verdict.FAIL, Verdict.UNDECIDED, Verdict.ERROR
SOLVED, REFUSED = Status.SOLVED, Status.REFUSED


@pytest.mark.parametrize(
    "verdicts, statuses, normal, strict",
    [
        ([PASS], [SOLVED], 0, 0),
        ([PASS, UNDECIDED], [SOLVED], 0, 5),
        ([PASS], [SOLVED, REFUSED], 0, 5),
        ([], [SOLVED], 0, 5),
        ([PASS, FAIL], [SOLVED], 1, 1),
        ([ERROR], [SOLVED], 3, 3),
        ([PASS], [SOLVED, Status.TIMEOUT], 3, 3),
        ([PASS], [SOLVED, Status.MEMORY], 3, 3),
        ([PASS], [SOLVED, Status.FAILED], 3, 3),
        ([FAIL, ERROR], [SOLVED, Status.FAILED], 1, 1),
        ([], [REFUSED], 4, 4),
        ([], [], 4, 4),
    ],
)
def test_the_exit_code_of_one_case(verdicts, statuses, normal, strict):
    assert exit_code([result(verdicts, statuses)]) == normal
    assert exit_code([result(verdicts, statuses)], strict=True) == strict


def test_a_known_finding_does_not_count_and_another_failure_does():
    case = result([PASS, FAIL], [SOLVED])
    case.verdicts[1] = replace(case.verdicts[1], known="its reason")
    assert case.verdict is FAIL
    assert exit_code([case], strict=True) == 0
    assert exit_code([case, result([FAIL], [SOLVED])]) == 1


def test_the_order_of_the_cases_does_not_matter():
    cases = [result([FAIL], [SOLVED]), result([ERROR], [Status.FAILED]), result([PASS], [SOLVED])]
    assert {exit_code(list(order)) for order in itertools.permutations(cases)} == {1}
    assert {exit_code(list(order)) for order in itertools.permutations(cases[1:])} == {3}
