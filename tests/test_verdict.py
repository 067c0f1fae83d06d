import sys
from dataclasses import replace
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parent / "compare"))
from cut_meshes import STRAIGHT, scene

from verify.result import Metric, Rate, SolveRecord, Status, Verdict
from verify.verdict import judge


def solve(level, value, width=0.0, solver="xfem", metric="energy_norm", reference=None, size=None):
    return SolveRecord(
        "a test",
        solver,
        level,
        Status.SOLVED,
        size=size or 0.1 / 2**level,
        metrics=[Metric(metric, value, "1", reference, width)],
    )


def verdicts(check, records, rates=(), judge_only=(), **more):
    asked = scene([STRAIGHT], acceptance=[{"metric": "energy_norm", **check}], **more)
    return judge(asked, records, list(rates), judge_only)


def verdict(check, records, rates=()):
    (found,) = verdicts({"solver": "xfem", **check}, records, rates)
    return found


@pytest.mark.parametrize(
    "value, width, expected",
    [
        (0.02, 0.0, Verdict.PASS),
        (0.02, 0.029, Verdict.PASS),  # the whole interval satisfies the limit
        (0.04, 0.02, Verdict.UNDECIDED),
        (0.06, 0.02, Verdict.UNDECIDED),
        (0.06, 0.001, Verdict.FAIL),
    ],
)
def test_an_error_bound_is_judged_on_the_whole_interval(value, width, expected):
    assert (
        verdict({"check": "error", "at_most": 0.05}, [solve(0, value, width)]).verdict is expected
    )


def test_an_undecided_bound_names_the_uncertainty_and_the_error_it_judges():
    found = verdict({"check": "error", "at_most": 6e-3}, [solve(0, 5e-3, 3e-3)])
    assert "uncertainty 3.0e-03 is not clearly below the error 5.0e-03" in found.reason


def test_the_finest_level_is_the_one_that_is_bounded():
    records = [solve(1, 0.01), solve(0, 0.5)]
    assert verdict({"check": "error", "at_most": 0.05}, records).observed == 0.01


@pytest.mark.parametrize(
    "value, width, expected",
    [(1.01, 0.001, Verdict.PASS), (1.1, 0.001, Verdict.FAIL), (1.05, 0.01, Verdict.UNDECIDED)],
)
def test_a_quantity_is_bounded_by_its_relative_distance_from_the_reference(value, width, expected):
    record = solve(0, value, width, metric="strain_energy", reference=1.0)
    check = {"check": "error", "metric": "strain_energy", "at_most": 0.05}
    assert verdict(check, [record]).verdict is expected


def test_a_quantity_whose_reference_is_zero_has_no_relative_error():
    record = solve(0, 1.0, metric="strain_energy", reference=0.0)
    found = verdict({"check": "error", "metric": "strain_energy", "at_most": 0.05}, [record])
    assert found.verdict is Verdict.ERROR
    assert "0" in found.reason


def test_a_quantity_without_a_reference_is_never_taken_for_an_error():
    record = replace(
        solve(0, 0.008, metric="strain_energy"), notes={"strain_energy": "reference level 2 failed"}
    )
    found = verdict({"check": "error", "metric": "strain_energy", "at_most": 0.05}, [record])
    assert found.verdict is Verdict.ERROR
    assert "no reference" in found.reason
    assert "reference level 2 failed" in found.reason


@pytest.mark.parametrize("value, expected", [(1 + 5e-10, Verdict.PASS), (1 + 2e-9, Verdict.FAIL)])
def test_a_stated_value_is_met_to_its_relative_tolerance(value, expected):
    check = {
        "check": "value",
        "metric": "strain_energy",
        "equals": 1.0,
        "relative_tolerance": 1e-9,
        "source": "theory",
    }
    assert verdict(check, [solve(0, value, metric="strain_energy")]).verdict is expected


@pytest.mark.parametrize(
    "ours, width, expected",
    [
        ([0.101, 0.0505], 0.0, Verdict.PASS),
        ([0.101, 0.06], 0.0, Verdict.FAIL),  # one level is enough
        ([0.12, 0.0505], 0.0, Verdict.FAIL),
        ([0.94, 0.47], 0.0, Verdict.FAIL),
        ([0.101, 0.0505], 0.005, Verdict.UNDECIDED),
    ],
)
def test_a_ratio_must_hold_on_every_level(ours, width, expected):
    records = [solve(i, e, width) for i, e in enumerate(ours)]
    records += [solve(i, e, width, "conforming") for i, e in enumerate([0.1, 0.05])]
    assert verdict({"check": "ratio", "within": 0.05}, records).verdict is expected


def test_a_much_smaller_error_satisfies_at_most_but_not_within():
    records = [solve(0, 0.01), solve(0, 0.1, solver="conforming")]
    assert verdict({"check": "ratio", "at_most": 1.05}, records).verdict is Verdict.PASS
    assert verdict({"check": "ratio", "within": 0.05}, records).verdict is Verdict.FAIL


def test_a_ratio_of_round_off_means_nothing():
    records = [solve(0, 2e-15), solve(0, 5e-16, solver="conforming")]
    found = verdict({"check": "ratio", "within": 0.05}, records)
    assert found.verdict is Verdict.UNDECIDED
    assert "round-off" in found.reason


def test_a_ratio_at_unequal_mesh_sizes_is_undecided():
    records = [solve(0, 0.1), solve(0, 0.1, solver="conforming", size=0.07)]
    found = verdict({"check": "ratio", "within": 0.05}, records)
    assert found.verdict is Verdict.UNDECIDED
    assert "sizes" in found.reason


def test_a_ratio_to_an_error_below_its_uncertainty_is_undecided():
    records = [solve(0, 0.1), solve(0, 1e-3, 2e-3, "conforming")]
    assert verdict({"check": "ratio", "within": 0.05}, records).verdict is Verdict.UNDECIDED


@pytest.mark.parametrize(
    "order, width, limits, expected",
    [
        (1.98, 0.01, {"at_least": 1.95}, Verdict.PASS),
        (1.96, 0.05, {"at_least": 1.95}, Verdict.UNDECIDED),
        (1.50, 0.05, {"at_least": 1.95}, Verdict.FAIL),
        (0.51, 0.01, {"equals": 0.5, "within": 0.05}, Verdict.PASS),
        (0.60, 0.01, {"equals": 0.5, "within": 0.05}, Verdict.FAIL),
        (0.54, 0.02, {"equals": 0.5, "within": 0.05}, Verdict.UNDECIDED),
    ],
)
def test_a_rate_is_judged_on_its_interval(order, width, limits, expected):
    rate = Rate("xfem", "energy_norm", order, width, "", [order, order])
    found = verdict({"check": "rate", **limits}, [solve(0, 0.1), solve(1, 0.05)], [rate])
    assert found.verdict is expected


@pytest.mark.parametrize(
    "reason, expected",
    [
        ("diverging: slopes -1", Verdict.FAIL),
        ("oscillating: slopes -1, 1", Verdict.UNDECIDED),
        ("floor: errors 1e-15", Verdict.UNDECIDED),
    ],
)
def test_an_order_that_means_nothing_never_passes(reason, expected):
    rate = Rate("xfem", "energy_norm", None, 0.0, reason, [-1.0, -1.1])
    found = verdict({"check": "rate", "at_least": 1.0}, [solve(0, 0.1), solve(1, 0.2)], [rate])
    assert found.verdict is expected
    assert reason in found.reason


@pytest.mark.parametrize(
    "limits, width, expected",
    [
        ({"at_least": 1.95}, 0.05, Verdict.FAIL),
        ({"equals": 0.5, "within": 0.05}, 0.05, Verdict.FAIL),
        ({"at_least": 1.95}, 2.0, Verdict.UNDECIDED),
        ({"equals": 0.0, "within": 0.1}, 0.05, Verdict.UNDECIDED),
    ],
)
def test_an_error_that_stops_falling_fails_if_the_order_is_below_the_limit_at_most(
    limits, width, expected
):
    rate = Rate("uncut", "energy_norm", None, width, "slowing: slopes 0.08, 0.01", [0.08, 0.01])
    records = [solve(0, 0.1, solver="uncut"), solve(1, 0.09, solver="uncut")]
    found = verdict({"check": "rate", "solver": "uncut", **limits}, records, [rate])
    assert found.verdict is expected
    assert found.reason.startswith("slowing")


@pytest.mark.parametrize("status", [Status.FAILED, Status.TIMEOUT, Status.REFUSED, Status.MEMORY])
@pytest.mark.parametrize(
    "check",
    [
        {"check": "error", "at_most": 1.0},
        {"check": "rate", "at_least": 0.0},
        {"check": "ratio", "within": 0.05},
    ],
    ids=lambda c: c["check"],
)
def test_a_solve_that_did_not_finish_is_an_error_with_its_reason(status, check):
    records = [solve(0, 0.1), SolveRecord("a test", "xfem", 1, status, "out of luck")]
    records.append(solve(0, 0.1, solver="conforming"))
    found = verdict(check, records)
    assert found.verdict is Verdict.ERROR
    assert "out of luck" in found.reason


def test_a_metric_that_was_not_measured_is_an_error():
    check = {"check": "error", "at_most": 1.0}
    bare = SolveRecord("a test", "xfem", 0, Status.SOLVED, notes={"energy_norm": "no reference"})
    found = verdict(check, [bare])
    assert found.verdict is Verdict.ERROR
    assert "no reference" in found.reason


def test_a_value_that_is_not_a_number_fails():
    found = verdict({"check": "error", "at_most": 1.0}, [solve(0, float("nan"))])
    assert found.verdict is Verdict.FAIL
    assert "not finite" in found.reason


BOUND = {"check": "error", "at_most": 0.05}
WITHIN = {"check": "ratio", "at_most": 2.0}


def by_solver(found):
    return {one.solver: one.verdict for one in found}


def test_a_check_that_names_no_solver_is_made_of_each_but_the_reference():
    records = [
        solve(0, e, solver=s) for s, e in {"mine": 1.0, "xfem": 0.01, "reference": 9}.items()
    ]
    assert by_solver(verdicts(BOUND, records)) == {"mine": Verdict.FAIL, "xfem": Verdict.PASS}


def test_a_rate_is_judged_for_each_solver_by_its_own():
    records = [solve(i, 0.1, solver=s) for s in ("mine", "xfem") for i in (0, 1)]
    rates = [Rate(s, "energy_norm", p, 0.01, "", [p, p]) for s, p in (("mine", 0.1), ("xfem", 1.0))]
    found = verdicts({"check": "rate", "at_least": 0.9}, records, rates)
    assert by_solver(found) == {"mine": Verdict.FAIL, "xfem": Verdict.PASS}


def test_a_ratio_is_made_of_all_but_the_one_compared_with():
    records = [
        solve(0, e, solver=s) for s, e in {"mine": 1.0, "xfem": 0.1, "conforming": 0.1}.items()
    ]
    assert by_solver(verdicts(WITHIN, records)) == {"mine": Verdict.FAIL, "xfem": Verdict.PASS}


def test_a_solver_that_refuses_the_case_is_not_judged_and_one_that_failed_is():
    refused = SolveRecord("a test", "no", 0, Status.REFUSED, "only space")
    failed = SolveRecord("a test", "broken", 0, Status.FAILED, "singular")
    found = verdicts(BOUND, [refused, failed, solve(0, 0.01)])
    assert by_solver(found) == {"broken": Verdict.ERROR, "xfem": Verdict.PASS}


def test_a_check_that_holds_for_nobody_is_undecided_and_says_so():
    (found,) = verdicts(WITHIN, [solve(0, 0.1, solver="conforming")])
    assert (found.solver, found.verdict) == ("", Verdict.UNDECIDED)
    assert "no solver" in found.reason
    refused = SolveRecord("a test", "no", 0, Status.REFUSED, "only space")
    (found,) = verdicts(BOUND, [refused, solve(0, 0.1, solver="reference")])
    assert found.verdict is Verdict.UNDECIDED
    assert "refuses" in found.reason


def test_who_was_not_asked_is_undecided_and_judge_only_narrows():
    records = [solve(0, 1.0, solver=s) for s in ("mine", "xfem", "reference")]
    (found,) = verdicts({**BOUND, "solver": "yours"}, records)
    assert (found.verdict, found.reason) == (
        Verdict.UNDECIDED,
        "the run was not asked for solver 'yours'",
    )
    assert "conforming" in verdicts(WITHIN, records)[0].reason
    assert list(by_solver(verdicts(BOUND, records, judge_only=["mine"]))) == ["mine"]
    (found,) = verdicts({**BOUND, "solver": "xfem"}, records, judge_only=["mine"])
    assert found.verdict is Verdict.UNDECIDED
    # the reference is what all rest on: a check of it is never narrowed away
    (found,) = verdicts({**BOUND, "solver": "reference"}, records, judge_only=["mine"])
    assert found.verdict is Verdict.FAIL


def known(solver="mine", check="error"):
    return [
        {"solver": solver, "check": check, "metric": "energy_norm", "reason": "it drops slivers"}
    ]


def test_a_known_finding_fails_with_its_reason_and_passes_with_a_hint():
    records = [solve(0, e, solver=s) for s, e in {"mine": 1.0, "xfem": 1.0}.items()]
    mine, xfem = verdicts(BOUND, records, known_findings=known())
    assert mine.verdict is xfem.verdict is Verdict.FAIL
    assert (mine.known, mine.counts_as_failed) == ("it drops slivers", False)
    assert (xfem.known, xfem.counts_as_failed) == ("", True)
    (mine,) = verdicts(BOUND, [solve(0, 0.01, solver="mine")], known_findings=known())
    assert mine.verdict is Verdict.PASS
    assert "entry" in mine.reason


@pytest.mark.parametrize(
    "check, finding",
    [
        (BOUND, known(check="rate")),
        ({**BOUND, "solver": "xfem"}, known()),
        (WITHIN, known("conforming", "ratio")),
    ],
)
def test_a_known_finding_that_names_no_check_of_the_case_is_refused(check, finding):
    with pytest.raises(ValueError, match=r"known_findings\[0\]: no check"):
        verdicts(check, [], known_findings=finding)
