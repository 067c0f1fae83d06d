"""The four answers of a run, against numbers chosen beforehand: ratios, medians, times, slivers."""

import math
import random
from dataclasses import replace
from statistics import median

import pytest

from verify.report.answers import Ratio, _over_cases, answers, energy_curve, sliver_curves
from verify.report.error_plots import answer_panels
from verify.report.plots import Palette
from verify.result import (
    CRITICAL_STEP,
    CaseResult,
    Metric,
    ReferenceRecord,
    SolveRecord,
    Status,
    Verdict,
    VerdictRecord,
)


def solve(solver, level, error, off=0.0, seconds=None, **more):
    metrics = [Metric("displacement_l2", error, "1", None, off)] if error else []
    timings = {"solve": list(seconds), "meshing": [0.0]} if seconds else {}
    metrics += more.pop("metrics", [])
    return SolveRecord(
        case="a", solver=solver, parameters={}, level=level, status=Status.SOLVED, reason="",
        size=0.1 / 2**level, unknowns=100 * 4**level, timings=timings, metrics=metrics, **more,
    )  # fmt: skip


def case(name, *solves, row=None):
    return CaseResult(
        case=name, title=name, requirement="", scene_hash="", scene={},
        reference=ReferenceRecord("none"), solves=list(solves), rates=[], verdicts=[], row=row,
    )  # fmt: skip


def test_the_error_is_held_against_conforming_elements_and_its_interval_is_that_over_cases():
    cases = [
        case("a", solve("xfem", 1, 0.02, 0.002), solve("conforming", 1, 0.01, 0.001)),
        case("b", solve("xfem", 1, 0.03), solve("conforming", 1, 0.01)),
        case("c", solve("xfem", 1, 0.05), solve("conforming", 1, 0.01)),
        # not resolved, and exact to round-off: no ratio
        case("d", solve("xfem", 1, 0.01, 0.02), solve("conforming", 1, 0.01)),
        case("e", solve("xfem", 1, 1e-15), solve("conforming", 1, 1e-15)),
    ]
    found = answers(cases)[0]
    # between the smallest and the largest of three: 90 % need five
    assert "XFEM has 3.00 (2.00–5.00) times the displacement error" in found.sentence
    assert "in the median of 3 cases" in found.sentence
    assert found.example == "b"
    # d is counted, e is exact
    assert found.sentence.endswith("In 1 more case the uncertainty is as large as an error.")
    # of one case: 0.018/0.011 = 1.64 and 0.022/0.009 = 2.44
    assert "2.00 (1.64–2.44) times" in answers(cases[:1])[0].sentence
    # a finer level of one solver alone compares with nothing
    finer = case("a", *cases[0].solves, solve("xfem", 2, 0.001))
    assert answers([finer])[0].sentence == answers(cases[:1])[0].sentence


def test_solvers_that_are_not_named_are_bounded_and_those_that_fail_a_check_are_named():
    """A softer body may have the smaller error: what cancels in one measure shows in a check."""
    errors = {"xfem": 0.03, "soft": 0.005, "other": 0.02, "flipped": 0.87, "conforming": 0.01}
    result = case("a", *(solve(name, 1, error) for name, error in errors.items()))
    checks = [
        VerdictRecord("error", name, "reaction", verdict, 1.0, 1.0, 1.0, "at most 0.1", "")
        for name, verdict in (("soft", Verdict.FAIL), ("other", Verdict.PASS))
    ]
    checks.append(replace(checks[0], solver="xfem", known="a known finding"))
    said = answers([replace(result, verdicts=checks)])[0].sentence
    assert "soft 0.500 (1), other 2.00 (1); 1 more at most 87.0 in a case." in said
    assert said.endswith("Solvers that fail a check: soft.")


def test_time_is_compared_at_an_equal_error_between_levels_by_a_power_law():
    # error = 1/t and 1/(4 t): at every error the second takes a quarter, whatever its levels
    slow = [solve("xfem", k, 1.0 / t, seconds=[t]) for k, t in enumerate((10.0, 40.0, 160.0))]
    fast = [
        solve("conforming", k, 1.0 / (4.0 * t), seconds=[t])
        for k, t in enumerate((3.0, 12.0, 48.0))
    ]
    found = answers([case("a", *slow, *fast)])[3]
    assert "XFEM takes 4.00 times the time of conforming P1" in found.sentence
    # repetitions from half to twice the median: four times either way
    wide = [
        solve("xfem", k, 1.0 / t, seconds=[t / 2, t, 2 * t]) for k, t in enumerate((10.0, 40.0))
    ]
    same = [
        solve("conforming", s.level, s.metrics[0].value, seconds=s.timings["solve"]) for s in wide
    ]
    assert "1.00 (0.250–4.00) times" in answers([case("a", *wide, *same)])[3].sentence
    # a solver that is better on its coarsest level than the other ever is has no time there
    better = [solve("conforming", 0, 1e-4, seconds=[1.0])]
    assert (
        "no other solver reaches an equal error" in answers([case("a", *slow, *better)])[3].sentence
    )


def test_the_interval_of_times_holds_the_median_of_other_cases_of_the_same_kind():
    """Ratios are drawn about 1: nine in ten intervals hold it, though no repetition tells."""
    draw, held = random.Random(3), 0
    for _ in range(200):
        values = [math.exp(draw.gauss(0.0, 0.3)) for _ in range(9)]
        own = _over_cases({str(k): Ratio(v, v, v) for k, v in enumerate(values)})
        low, high = (median(getattr(r, end) for r in own.values()) for end in ("low", "high"))
        assert low <= median(values) <= high
        held += low <= 1.0 <= high
    assert 0.9 * 200 <= held < 200


def test_the_worst_drift_is_named_with_its_case_and_drawn_at_its_size():
    def moving(name, drift, *more):
        total = [1.0, 1.0 - drift, 1.0 + 2 * drift]
        account = {"time": [0.0, 1.0, 4.0], "total": total}
        metrics = [Metric("energy_drift", 7 * drift, "1"), *more]
        return case(name, solve("xfem", 0, None, metrics=metrics, account=account))

    cases = [moving("calm", 1e-6), moving("wild", 1e-3)]
    assert "XFEM 7.0×10⁻³ (wild)" in answers(cases)[1].sentence.replace("0.0070", "7.0×10⁻³")
    assert "in 2 cases in motion" in answers(cases)[1].sentence
    # scaled to the drift: the largest change, at the end, is 7e-3, that at a quarter half of it
    assert energy_curve(cases[1].solves[0]) == [
        (0.25, pytest.approx(3.5e-3)),
        (1.0, pytest.approx(7e-3)),
    ]
    # what a blade takes is no drift
    bladed = moving("cut", 0.3, Metric("released_to_cut", 0.2, "N"))
    said = answers([*cases, bladed])[1].sentence
    assert "(wild). Left out: 1 case in which a blade takes energy." in said.replace(",", "")
    assert "a blade takes energy" in answers([bladed])[1].sentence
    # nor what a sum over few outputs misses of damping
    damped = moving("damped", 0.3)
    damped.solves[0].account["damping"] = [0.0, 0.2, 0.3]
    said = answers([*cases, damped])[1].sentence
    assert "(wild). Left out: 1 case in which damping takes energy." in said
    # nor is a change known whose interval is wider than all energy that moves
    words = moving("words", 1e-5)
    words.solves[0].metrics[0] = Metric("energy_drift", 0.5, "1", uncertainty=1000.5)
    said = answers([*cases, words])[1].sentence
    assert "in 2 cases in motion" in said
    assert "(wild). Left out: 1 case in which the energy is not known from the outputs." in said
    assert "not known from the outputs" in answers([words])[1].sentence


def test_slivers_are_held_against_the_largest_epsilon_and_rows_without_slivers_are_left_out():
    def row(epsilon, error, step):
        return case(f"s[{epsilon}]", solve("xfem", 0, error, notes={CRITICAL_STEP: step}),
                    row={"family": "s", "parameter": "epsilon", "value": epsilon})  # fmt: skip

    cases = [row(1e-6, 0.05, "0.003 s"), row(0.5, 0.04, "0.004 s"), row(0.0, 9.0, "9 s")]
    curves = {curve.measure: curve.places for curve in sliver_curves(cases)}
    assert curves["error"] == [(0.5, 1.0), (1e-6, pytest.approx(1.25))]
    assert curves["critical step"] == [(0.5, 1.0), (1e-6, pytest.approx(0.75))]
    said = answers(cases)[2].sentence
    assert "error at most 1.25 times" in said
    assert "critical step at least 0.750 times" in said
    unknown = [row(1e-6, 0.05, "not known: no"), row(0.5, 0.04, "0.004 s")]
    assert [curve.measure for curve in sliver_curves(unknown)] == ["error"]


def test_a_sentence_hides_no_worse_solver():
    """Of more than three solvers those that are not named are told by their worst number."""
    names = ("xfem", "conforming", "snapping", "subdivision", "removal")
    off = dict(zip(names, (4e-3, 1e-3, 2e-3, 5e-2, 3e-3), strict=True))
    account = {"time": [0.0, 1.0], "total": [1.0, 1.0]}
    drifts = [
        solve(name, 0, None, metrics=[Metric("energy_drift", off[name], "1")], account=account)
        for name in names
    ]
    drifts[-1].metrics[0] = Metric("energy_drift", 1e-3, "1", uncertainty=2e-3)  # removal
    said = answers([case("moving", *drifts)])[1].sentence
    assert said.endswith("XFEM 0.0040; snapping 0.0020; subdivision 0.050; 2 more at most 0.0030.")
    alone = [solve(f"my_{name}", 0, off[name], 6e-4) for name in names]  # beside no conforming
    said = answers([case("rest", *alone)])[0].sentence
    assert said.endswith("; 2 more at most 0.051."), said
    rows = [
        case(f"s[{epsilon}]",
             *(solve(name, 0, 0.01 * (1 + off[name] * (epsilon < 0.1) * 100),
                     notes={CRITICAL_STEP: f"{1 - (epsilon < 0.1) * off[name]} s"})
               for name in names),
             row={"family": "s", "parameter": "epsilon", "value": epsilon})
        for epsilon in (0.5, 1e-6)
    ]  # fmt: skip
    said = answers(rows)[2].sentence
    assert "subdivision: error at most 6.00 times, critical step at least 0.950 times" in said
    assert said.endswith("; 2 more: error at most 1.30 times, critical step at least 0.997 times.")


def test_what_a_run_has_not_is_said_and_which_case_would_fill_it():
    found = answers([])
    assert [one.question for one in found] == ["Accuracy", "Energy", "Slivers", "Cost"]
    assert all("would tell" in one.sentence for one in found)
    assert answer_panels([], found, Palette()) == [None] * 4
    exact = case("a", solve("xfem", 0, 1e-15), solve("conforming", 0, 2e-15))
    assert answers([exact])[0].sentence == "All displacement errors are at round-off."


def test_panels_say_in_words_what_they_draw():
    named = (("xfem", 0.1, 1.0), ("conforming", 0.2, 3.0))
    levels = [solve(name, k, e, 1e-3, seconds=[t]) for name, e, t in named for k in (0, 1)]
    cases = [case("a", *levels)]
    drawn = answer_panels(cases, answers(cases), Palette())
    assert drawn[1:3] == [None, None]
    assert "XFEM: 0.1 at 0.1 to 0.1 at 0.05" in drawn[0].alt
    assert "conforming P1: 0.2 at 3 to 0.2 at 3" in drawn[3].alt
