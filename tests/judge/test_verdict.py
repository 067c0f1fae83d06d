from dataclasses import replace
from math import inf

import numpy as np
import pytest
from cut_meshes import STRAIGHT, scene

from verify.judge.checks import result_of
from verify.judge.intervals import error_interval
from verify.judge.verdict import judge
from verify.result import Metric, Rate, ReferenceRecord, SolveRecord, Status, Verdict
from verify.scene import Scene


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


PASS, FAIL, UNDECIDED, ERROR = Verdict.PASS, Verdict.FAIL, Verdict.UNDECIDED, Verdict.ERROR
BOUND = {"check": "error", "at_most": 0.05}
ENERGY = {**BOUND, "metric": "strain_energy"}
STATED = {"check": "value", "metric": "strain_energy", "equals": 1.0, "relative_tolerance": 1e-9,
          "source": "theory"}  # fmt: skip
WITHIN = {"check": "ratio", "within": 0.05}
UNKNOWN = {"energy_norm": "no reference", "strain_energy": "reference level 2 failed"}


def energy(value, width=0.0, reference=1.0):
    return [solve(0, value, width, metric="strain_energy", reference=reference)]


def beside(ours, theirs, width=0.0, **size):
    """Errors of both solvers on levels that they have in common."""
    rows = [solve(i, e, width) for i, e in enumerate(ours)]
    return rows + [solve(i, e, width, "conforming", **size) for i, e in enumerate(theirs)]


@pytest.mark.parametrize(
    ("value", "reference", "width", "low", "high"),
    [
        (1.5, 1.0, 0.1, 4 / 11, 2 / 3),
        (-1.5, -1.0, 0.1, 4 / 11, 2 / 3),
        (0.5, 1.0, 0.1, 4 / 9, 6 / 11),
        (1.05, 1.0, 0.1, 0.0, 1 / 6),
        (-0.5, 1.0, 0.1, 16 / 11, 14 / 9),
        (3.0, 1.0, 1.0, 0.5, inf),  # the truth may be 0
        (3.0, 1.0, 1.5, 0.2, inf),
    ],
)
def test_what_divides_an_error_is_uncertain_too(value, reference, width, low, high):
    found = error_interval(Metric("work", value, "J", reference, width))
    assert (found.low, found.high) == pytest.approx((low, high), rel=1e-14, abs=1e-15)
    true = reference + width * np.linspace(-1, 1, 2001)[1:-1]
    errors = np.abs(value - true) / np.abs(true)
    assert found.low * (1 - 1e-14) <= errors.min() <= found.low + 2e-3
    assert errors.max() <= found.high * (1 + 1e-14)


def test_a_verdict_counts_the_uncertainty_of_the_divisor():
    # 1.045 over 1 ± 0.02: 0.045 ± 0.02 would pass 0.066; the truth reaches 0.0663
    record = energy(1.045, 0.02)
    assert verdicts({**ENERGY, "at_most": 0.066}, record)[0].verdict is UNDECIDED
    assert verdicts({**ENERGY, "at_most": 0.0664}, record)[0].verdict is PASS


@pytest.mark.parametrize(
    ("check", "records", "share", "badge"),
    [
        (BOUND, [solve(0, 0.02, 9.8e-3)], 0.49, "reference: 0.49 of the error"),
        (BOUND, [solve(0, 0.02, 2e-3)], 0.1, ""),
        (BOUND, [solve(0, 0.9, 0.9), solve(1, 0.02, 0.001)], 0.05, ""),  # on the finest level
        (BOUND, [solve(0, 1e-14, 1e-13)], None, ""),  # round-off
        # what levels differ by at round-off, times its safety factor, is round-off; 1e-8 is not
        (BOUND, [solve(0, 2.5e-13, 3.3e-10)], None, ""),
        (BOUND, [solve(0, 2.5e-13, 1e-8)], inf, "reference: not known as well as the error"),
        (ENERGY, energy(1.02, 0.01), 0.5, "reference: 0.5 of the error"),
        (STATED, energy(1.0, 0.01), None, ""),  # no reference judges
        ({"check": "ratio", "at_most": 2.0},
         [solve(0, 0.03, 0.003), solve(0, 0.02, 0.003, "conforming")], 0.15,
         "reference: 0.15 of the error"),
    ],
)  # fmt: skip
def test_the_share_of_the_reference_stands_beside_the_verdict(check, records, share, badge):
    records = [replace(r, metrics=[replace(m, source="it") for m in r.metrics]) for r in records]
    found = verdicts(check, records)[0]
    assert found.reference_share == (None if share is None else pytest.approx(share, rel=1e-6))
    assert found.badge == badge


JUDGED = {
    "below the limit": (BOUND, [solve(0, 0.02)], PASS, ""),
    "the whole interval satisfies it": (BOUND, [solve(0, 0.02, 0.029)], PASS, ""),
    "the interval crosses it": (BOUND, [solve(0, 0.04, 0.02)], UNDECIDED, ""),
    "it crosses it from above": (BOUND, [solve(0, 0.06, 0.02)], UNDECIDED, ""),
    "the whole interval is above": (BOUND, [solve(0, 0.06, 0.001)], FAIL, ""),
    "the uncertainty that leaves it open is named": (
        {**BOUND, "at_most": 6e-3}, [solve(0, 5e-3, 3e-3)], UNDECIDED,
        "uncertainty 3.0e-03 is not clearly below the error 5.0e-03"),
    "the finest level is the one that is bounded": (
        BOUND, [solve(1, 0.01), solve(0, 0.5)], PASS, ""),
    "no number": (BOUND, [solve(0, float("nan"))], FAIL, "not finite"),
    "not measured": (
        BOUND, [SolveRecord("a test", "xfem", 0, Status.SOLVED, notes=UNKNOWN)], ERROR,
        "no reference"),
    "a quantity is bounded by its relative distance": (ENERGY, energy(1.01, 0.001), PASS, ""),
    "and fails by it": (ENERGY, energy(1.1, 0.001), FAIL, ""),
    "or is left open": (ENERGY, energy(1.05, 0.01), UNDECIDED, ""),
    "a reference of zero has no relative error": (ENERGY, energy(1.0, 0.0, 0.0), ERROR, "0"),
    "a value without a reference is no error": (
        ENERGY, [replace(*energy(0.008, reference=None), notes=UNKNOWN)], ERROR,
        "reference level 2 failed"),
    "a stated value is met": (STATED, energy(1 + 5e-10, reference=None), PASS, ""),
    "it is missed": (STATED, energy(1 + 2e-9, reference=None), FAIL, ""),
    "a ratio holds on every level": (WITHIN, beside([0.101, 0.0505], [0.1, 0.05]), PASS, ""),
    "one level is enough to fail": (WITHIN, beside([0.101, 0.06], [0.1, 0.05]), FAIL, ""),
    "or the other": (WITHIN, beside([0.12, 0.0505], [0.1, 0.05]), FAIL, ""),
    "within is on both sides": (WITHIN, beside([0.094, 0.047], [0.1, 0.05]), FAIL, ""),
    "at most on one": ({"check": "ratio", "at_most": 1.05}, beside([0.01], [0.1]), PASS, ""),
    "of at most the largest is the worst": (
        {"check": "ratio", "at_most": 2.0}, beside([0.01, 0.075, 0.01], [0.1, 0.05, 0.02]), PASS,
        "worst at level 1; by level 0.1, 1.5, 0.5"),
    "and the farthest from 1 of within": (
        WITHIN, beside([0.101, 0.048, 0.0204], [0.1, 0.05, 0.02]), PASS, "worst at level 1"),
    "be it above or below": (
        WITHIN, beside([0.097, 0.052, 0.02], [0.1, 0.05, 0.02]), PASS, "worst at level 1"),
    "a much smaller error is not within": (WITHIN, beside([0.01], [0.1]), FAIL, ""),
    "intervals leave a ratio open": (
        WITHIN, beside([0.101, 0.0505], [0.1, 0.05], 0.005), UNDECIDED, ""),
    "a ratio of round-off means nothing": (
        WITHIN, beside([2e-15], [5e-16]), UNDECIDED, "round-off"),
    "nor one at unequal sizes": (WITHIN, beside([0.1], [0.1], size=0.07), UNDECIDED, "sizes"),
    "nor one to an error below its uncertainty": (
        WITHIN, [solve(0, 0.1), solve(0, 1e-3, 2e-3, "conforming")], UNDECIDED, ""),
}  # fmt: skip


def verdict(check, records, rates=()):
    (found,) = verdicts({"solver": "xfem", **check}, records, rates)
    return found


@pytest.mark.parametrize("claim", JUDGED)
def test_an_interval_is_judged_as_a_whole_and_what_means_nothing_is_not(claim):
    check, records, expected, reason = JUDGED[claim]
    found = verdict(check, records)
    assert found.verdict is expected
    assert reason in found.reason


NEAR_HALF = {"equals": 0.5, "within": 0.05}
SLOWING = "slowing: slopes 0.08, 0.01"


@pytest.mark.parametrize(
    ("order", "width", "reason", "limits", "expected"),
    [
        (1.98, 0.01, "", {"at_least": 1.95}, PASS),
        (1.96, 0.05, "", {"at_least": 1.95}, UNDECIDED),
        (1.50, 0.05, "", {"at_least": 1.95}, FAIL),
        (0.51, 0.01, "", NEAR_HALF, PASS),
        (0.60, 0.01, "", NEAR_HALF, FAIL),
        (0.54, 0.02, "", NEAR_HALF, UNDECIDED),
        # what means nothing never passes
        (None, 0.0, "diverging: slopes -1", {"at_least": 1.0}, FAIL),
        (None, 0.0, "oscillating: slopes -1, 1", {"at_least": 1.0}, UNDECIDED),
        (None, 0.0, "floor: errors 1e-15", {"at_least": 1.0}, UNDECIDED),
        # what stops falling fails if the order is below the limit at most
        (None, 0.05, SLOWING, {"at_least": 1.95}, FAIL),
        (None, 0.05, SLOWING, NEAR_HALF, FAIL),
        (None, 2.0, SLOWING, {"at_least": 1.95}, UNDECIDED),
        (None, 0.05, SLOWING, {"equals": 0.0, "within": 0.1}, UNDECIDED),
    ],
)
def test_a_rate_is_judged_on_its_interval(order, width, reason, limits, expected):
    slopes = [-1.0, -1.1] if "diverging" in reason else [0.08, 0.01]
    rate = Rate("xfem", "energy_norm", order, width, reason, slopes)
    found = verdict({"check": "rate", **limits}, [solve(0, 0.1), solve(1, 0.09)], [rate])
    assert found.verdict is expected
    assert reason in found.reason


@pytest.mark.parametrize(
    ("reason", "slopes", "shown"),
    [
        ("diverging: slopes", [-1.0, -1.3, -1.2], (-1.2, -1.3, -1.0)),
        ("slowing: slopes", [0.3, 0.2, 0.15], (0.15, 0.1, 0.2)),
    ],
)
def test_a_rate_that_fails_without_an_order_is_shown_from_its_last_slope(reason, slopes, shown):
    """Between its slopes where it diverges; by what the slope may still change if it falls."""
    rate = Rate("xfem", "energy_norm", None, 0.05, reason, slopes)
    found = verdict({"check": "rate", "at_least": 1.0}, [solve(0, 0.1), solve(1, 0.09)], [rate])
    assert found.verdict is FAIL
    assert (found.observed, found.low, found.high) == pytest.approx(shown)


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
    assert found.verdict is ERROR
    assert "out of luck" in found.reason


AT_MOST_TWICE = {"check": "ratio", "at_most": 2.0}


def by_solver(found):
    return {one.solver: one.verdict for one in found}


def test_a_check_that_names_no_solver_is_made_of_each_by_its_own():
    """But of the reference; a ratio of all but the one that they are compared with."""
    half = {"mine": FAIL, "xfem": PASS}
    records = [solve(0, e, solver=s) for s, e in (("mine", 1.0), ("xfem", 0.01), ("reference", 9))]
    assert by_solver(verdicts(BOUND, records)) == half
    records[2] = solve(0, 0.01, solver="conforming")
    assert by_solver(verdicts(AT_MOST_TWICE, records)) == half
    rates = [Rate(s, "energy_norm", p, 0.01, "", [p, p]) for s, p in (("mine", 0.1), ("xfem", 1.0))]
    records = [solve(i, 0.1, solver=s) for s in half for i in (0, 1)]
    assert by_solver(verdicts({"check": "rate", "at_least": 0.9}, records, rates)) == half


def test_what_a_reference_misses_that_was_left_out_is_undecided():
    """And an error where a solver has failed as well, or the reference was not asked to stop."""
    own = SolveRecord("a test", "xfem", 0, Status.SOLVED, notes=UNKNOWN)
    out = SolveRecord("a test", "reference", 1, Status.REFUSED, "left out")
    failed = SolveRecord("a test", "xfem", 1, Status.FAILED, "it died")
    for records, expected in (
        ([own], ERROR),
        ([own, out], UNDECIDED),
        ([own, failed, out], ERROR),
        ([own, replace(out, status=Status.TIMEOUT)], ERROR),
    ):
        assert verdicts(BOUND, records)[0].verdict is expected


def test_larger_elements_of_the_reference_are_the_first_cause():
    own = solve(0, 0.04, 0.02)
    own = replace(own, metrics=[replace(metric, source="it") for metric in own.metrics])
    coarse = replace(solve(0, 1.0, solver="reference"), notes={"within": "elements 4 times"})
    for records, begins in (([own], "error"), ([own, coarse], "a reference of elements 4 times;")):
        (found,) = verdicts(BOUND, records)
        assert found.verdict is UNDECIDED
        assert found.reason.startswith(begins)


def test_a_solver_that_refuses_the_case_is_not_judged_and_one_that_failed_is():
    refused = SolveRecord("a test", "no", 0, Status.REFUSED, "only space")
    failed = SolveRecord("a test", "broken", 0, Status.FAILED, "singular")
    found = verdicts(BOUND, [refused, failed, solve(0, 0.01)])
    assert by_solver(found) == {"broken": ERROR, "xfem": PASS}


def test_a_check_that_holds_for_nobody_is_undecided_and_says_so():
    (found,) = verdicts(AT_MOST_TWICE, [solve(0, 0.1, solver="conforming")])
    assert (found.solver, found.verdict) == ("", UNDECIDED)
    assert "no solver" in found.reason
    refused = SolveRecord("a test", "no", 0, Status.REFUSED, "only space")
    (found,) = verdicts(BOUND, [refused, solve(0, 0.1, solver="reference")])
    assert found.verdict is UNDECIDED
    assert "refuses" in found.reason


def test_who_was_not_asked_is_undecided_and_judge_only_narrows():
    records = [solve(0, 1.0, solver=s) for s in ("mine", "xfem", "reference")]
    (found,) = verdicts({**BOUND, "solver": "yours"}, records)
    assert (found.verdict, found.reason) == (UNDECIDED, "the run was not asked for solver 'yours'")
    assert "conforming" in verdicts(AT_MOST_TWICE, records)[0].reason
    assert list(by_solver(verdicts(BOUND, records, judge_only=["mine"]))) == ["mine"]
    (found,) = verdicts({**BOUND, "solver": "xfem"}, records, judge_only=["mine"])
    assert found.verdict is UNDECIDED
    # the reference is what all rest on: a check of it is never narrowed away
    (found,) = verdicts({**BOUND, "solver": "reference"}, records, judge_only=["mine"])
    assert found.verdict is FAIL


def known(solver="mine", check="error"):
    return [
        {"solver": solver, "check": check, "metric": "energy_norm", "reason": "it drops slivers"}
    ]


def test_a_known_finding_fails_with_its_reason_and_passes_with_a_hint():
    records = [solve(0, e, solver=s) for s, e in {"mine": 1.0, "xfem": 1.0}.items()]
    mine, xfem = verdicts(BOUND, records, known_findings=known())
    assert mine.verdict is xfem.verdict is FAIL
    assert (mine.known, mine.counts_as_failed) == ("it drops slivers", False)
    assert (xfem.known, xfem.counts_as_failed) == ("", True)
    (mine,) = verdicts(BOUND, [solve(0, 0.01, solver="mine")], known_findings=known())
    assert mine.verdict is PASS
    assert "entry" in mine.reason


@pytest.mark.parametrize(
    "check, finding",
    [
        (BOUND, known(check="rate")),
        ({**BOUND, "solver": "xfem"}, known()),
        (AT_MOST_TWICE, known("conforming", "ratio")),
    ],
)
def test_a_known_finding_that_names_no_check_of_the_case_is_refused(check, finding):
    with pytest.raises(ValueError, match=r"known_findings\[0\]: no check"):
        verdicts(check, [], known_findings=finding)


def blades(solver, *levels, **more):
    """Make solves of what forces at a cut took, by level; `more` metrics are of every level."""
    names = {f"released_{name}": value for name, value in more.items()}
    return [
        SolveRecord("a test", solver, k, Status.SOLVED, metrics=[
            Metric(name, value, "J/m²")
            for name, value in ({"released_to_cut": taken} | names).items()
        ])
        for k, taken in enumerate(levels)
    ]  # fmt: skip


RELEASED = blades("reference", 0.28, 0.3, to_scheme=0.05, to_short_waves=0.01)


@pytest.mark.parametrize(
    ("records", "expected"),
    [
        (blades("xfem", 0.32, 0.34), Verdict.UNDECIDED),  # nobody knows what is released
        ([*blades("xfem", 0.32, 0.34), *blades("reference", 0.3)], Verdict.UNDECIDED),
        # the reference: 0.30 ± 0.02 at the cut, 0.05 by its scheme, 0.01 left as short waves
        ([*blades("xfem", 0.31, 0.32), *RELEASED], Verdict.PASS),
        ([*blades("xfem", 0.32, 0.34), *RELEASED], Verdict.UNDECIDED),  # both are uncertain
        ([*blades("xfem", 0.45, 0.44), *RELEASED], Verdict.FAIL),
        ([*blades("xfem", 0.60, 0.44), *RELEASED], Verdict.UNDECIDED),  # 0.44 ± 0.16
        # it may have left more as waves, so that more may have been released
        ([*blades("xfem", 0.45, 0.44), *blades("reference", 0.28, 0.3, to_scheme=0.05)],
         Verdict.UNDECIDED),
        ([*blades("xfem", 0.29, 0.30), *blades("reference", 0.28, 0.3, to_scheme=0.05)],
         Verdict.PASS),
        ([*blades("xfem", 0.45, 0.44), SolveRecord("a test", "xfem", 2, Status.FAILED, "it died"),
          *RELEASED], Verdict.ERROR),
    ],
)  # fmt: skip
def test_forces_at_a_cut_take_no_more_than_the_blade_releases(records, expected):
    (found,) = judge(scene([STRAIGHT]), records, ())
    assert (found.check, found.metric, found.solver) == ("excess", "released_to_cut", "xfem")
    assert found.verdict is expected


def test_what_the_balance_of_the_reference_misses_is_as_uncertain_as_its_parts():
    """Few outputs do not tell what damping took: then 0.44 may have been released."""
    for uncertainty, expected in ((0.05, Verdict.FAIL), (0.2, Verdict.UNDECIDED)):
        reference = blades("reference", 0.28, 0.3, to_short_waves=0.0)
        for record in reference:
            balance = Metric("released_to_scheme", -0.05, "J/m²", uncertainty=uncertainty)
            record.metrics.append(balance)
        records = [*blades("xfem", 0.45, 0.44), *reference]
        (found,) = judge(scene([STRAIGHT]), records, ())
        assert found.verdict is expected


@pytest.mark.parametrize(
    ("levels", "expected"),
    [
        ((0.32, 0.33), Verdict.PASS),
        ((0.30, 0.34), Verdict.UNDECIDED),  # 0.34 ± 0.04
        ((0.37, 0.365), Verdict.UNDECIDED),  # 0.365 ± 0.005
        ((0.38, 0.375), Verdict.FAIL),
        ((0.35,), Verdict.UNDECIDED),  # one level does not say how well that is known
    ],
)
def test_an_exact_energy_release_rate_is_the_most_that_is_taken(levels, expected):
    records = blades("xfem", *levels)
    for record in records:
        record.metrics.append(Metric("released", 0.36, "J/m²"))
    (found,) = judge(scene([STRAIGHT]), records, ())
    assert found.verdict is expected
    assert judge(scene([STRAIGHT]), records, (), judge_only=("conforming",)) == []


def test_a_result_holds_its_scene_as_a_file_states_it():
    """Names as in case files: the scene can be made from the result again."""
    own = scene([STRAIGHT])
    found = result_of(own, ReferenceRecord(), [])
    assert found.scene["schema"] == 1
    assert Scene.model_validate(found.scene) == own


def test_an_excess_can_be_listed_as_known():
    path = {"kind": "tool_path", "points": STRAIGHT["points"], "times": [0.0, 1.0]}
    finding = {"solver": "xfem", "check": "excess", "metric": "released_to_cut", "reason": "so"}
    more = {
        "material": {"young": 1.0, "poisson": 0.3, "plane": "strain", "density": 1.0},
        "analysis": {"kind": "dynamic", "duration": 1.0},
        "known_findings": [finding],
    }
    (found,) = judge(scene([path], **more), [*blades("xfem", 0.45, 0.44), *RELEASED], ())
    assert (found.verdict, found.known, found.counts_as_failed) == (FAIL, "so", False)
    (found,) = judge(scene([path], **more), [*blades("xfem", 0.31, 0.32), *RELEASED], ())
    assert "listed as a known finding" in found.reason
    with pytest.raises(ValueError, match="no check 'excess of released_to_cut'"):
        scene([STRAIGHT], **more)  # no blade is on its way
