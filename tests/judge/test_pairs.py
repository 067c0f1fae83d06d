"""Claims about pairs: made tables with known wins, ties, losses and medians; groups; coverage."""

import math
import random

import pytest

from verify.judge.pairs import coverage_of, groups_of, pairs_of
from verify.result import CaseResult, Metric, ReferenceRecord, SolveRecord, Status

MOVING = {"analysis": {"kind": "dynamic"}}


def solve(solver, level=0, error=None, width=0.0, status=Status.SOLVED, **more):
    """A solve with an error of the displacement, and quantities {name: (value, reference)}."""
    metrics = [] if error is None else [Metric("displacement_l2", error, "1", None, width, "exact")]
    metrics += [Metric(n, *given) for n, given in more.pop("quantities", {}).items()]
    size = more.pop("size", 0.1 * 0.5**level)
    return SolveRecord("", solver, level, status, size=size, metrics=metrics, **more)


def case(name, *solves, scene=None, family=None):
    row = None if family is None else {"family": family, "parameter": "e", "value": 1.0}
    return CaseResult(name, name, "", "", scene or {}, ReferenceRecord(), list(solves), [], [],
                      row=row)  # fmt: skip


def of(errors, width=0.0):
    """Cases from tables of the error by solver."""
    return [
        case(f"case {k}", *(solve(name, error=e, width=width) for name, e in by.items()))
        for k, by in enumerate(errors)
    ]


def pair(results, solver="x", rival="y", metric="displacement_l2", kind="rest"):
    names = dict.fromkeys(s.solver for r in results for s in r.solves)
    found = [p for p in pairs_of(results, list(names))
             if (p.solver, p.rival, p.metric, p.kind) == (solver, rival, metric, kind)]  # fmt: skip
    assert len(found) <= 1
    return found[0] if found else None


def counts(found):
    return found.wins, found.ties, found.losses


def test_a_table_made_by_hand_has_its_wins_ties_losses_and_median():
    ratios = [0.5, 0.8, 2.0, 3.0, 1.0 + 1e-7]
    found = pair(of([{"x": r * 0.01 * (k + 1), "y": 0.01 * (k + 1)}
                     for k, r in enumerate(ratios)]))  # fmt: skip
    assert counts(found) == (2, 1, 2)
    assert (found.ratio, found.low, found.high) == pytest.approx((1.0 + 1e-7, 0.5, 3.0))
    assert found.count == 5


def test_of_ten_scenes_the_range_is_from_the_5th_to_the_95th_percentile():
    found = pair(of([{"x": 2.0**k, "y": 1.0} for k in range(21)]))
    assert (found.ratio, found.low, found.high) == pytest.approx((2.0**10, 2.0, 2.0**19))
    found = pair(of([{"x": 2.0**k, "y": 1.0} for k in range(9)]))
    assert (found.low, found.high) == pytest.approx((1.0, 256.0))


@pytest.mark.parametrize(("width", "expected"), [(0.0004, (1, 0, 0)), (0.0006, (0, 1, 0))])
def test_intervals_that_overlap_tie(width, expected):
    assert counts(pair(of([{"x": 0.010, "y": 0.011}], width))) == expected


def test_a_tie_at_round_off_is_no_win_and_exact_numbers_have_no_ratio():
    found = pair(of([{"x": 1e-16, "y": 9e-12}, {"x": 0.02, "y": 0.01}]))
    assert counts(found) == (0, 1, 1)
    assert (found.ratio, found.count) == (pytest.approx(2.0), 1)
    found = pair(of([{"x": 3e-15, "y": 1e-3}]))
    assert counts(found) == (1, 0, 0)
    assert (found.ratio, found.low, found.high, found.count) == (None, None, None, 0)


def test_an_error_not_told_from_none_is_in_no_ratio_but_may_be_certainly_less():
    results = [
        case("told", solve("x", error=0.04), solve("y", error=0.01)),
        case("untold", solve("x", error=0.01, width=0.02), solve("y", error=0.5)),
    ]
    found = pair(results)
    assert counts(found) == (1, 0, 1)
    assert (found.ratio, found.count) == (pytest.approx(4.0), 1)


def test_what_a_third_solver_refuses_or_does_moves_nothing():
    two = of([{"x": 0.01, "y": 0.02}, {"x": 0.03, "y": 0.02}])
    refused = solve("z", status=Status.REFUSED, reason="not this")
    three = [case(r.case, *r.solves, third) for r, third in
             zip(two, (solve("z", error=1e-5), refused), strict=True)]  # fmt: skip
    assert pair(three) == pair(two)
    beside = pair(three, "x", "z")
    assert counts(beside) == (0, 0, 1)
    # nor does a coarser mesh of the third: the pair is compared on its own finest level
    fine = [case(r.case, *r.solves, *(solve(n, 1, e) for n, e in (("x", 0.1), ("y", 0.3))))
            for r in two]  # fmt: skip
    coarse = [case(r.case, *r.solves, solve("z", error=1.0)) for r in fine]
    assert pair(coarse).ratio == pair(fine).ratio == pytest.approx(1 / 3)


def test_pairs_are_compared_on_the_finest_level_whose_sizes_agree():
    solves = [solve("x", level, 0.1 * 0.5**level) for level in range(3)]
    solves += [solve("y", level, 0.3 * 0.5**level) for level in range(2)]
    assert pair([case("a", *solves)]).ratio == pytest.approx(1 / 3)
    far = [solve("x", error=0.1, size=0.1), solve("y", error=0.3, size=0.112)]
    assert pair([case("a", *far)]) is None


def test_a_sweep_counts_once_by_the_median_of_its_members():
    members = [case(f"s[{k}]", solve("x", error=r), solve("y", error=1.0), family="s")
               for k, r in enumerate((0.5, 0.9, 40.0, 0.8, 0.7))]  # fmt: skip
    found = pair([*members, case("a", solve("x", error=3.0), solve("y", error=1.0))])
    assert counts(found) == (1, 0, 1)
    assert (found.low, found.high, found.count) == (pytest.approx(0.8), pytest.approx(3.0), 2)
    # another sweep is another scene, and two members of which one is won and one lost are a tie
    other = [case(f"t[{r}]", solve("x", error=r), solve("y", error=1.0), family="t")
             for r in (0.25, 4.0)]  # fmt: skip
    assert counts(pair([*members, *other])) == (1, 1, 0)


def test_scenes_at_rest_and_in_motion_are_apart():
    still = case("a", solve("x", error=1.0), solve("y", error=2.0))
    moved = case("b", solve("x", error=3.0), solve("y", error=1.0), scene=MOVING)
    assert pair([still, moved], kind="rest").ratio == pytest.approx(0.5)
    assert pair([still, moved], kind="motion").ratio == pytest.approx(3.0)


def test_solvers_in_another_order_mirror_wins_losses_and_ratios():
    rng = random.Random(5)
    table = [{n: math.exp(rng.gauss(-4, 2)) for n in ("x", "y", "z")} for _ in range(14)]
    results = of(table, 1e-3)
    forth = {(p.solver, p.rival): p for p in pairs_of(results, ["x", "y", "z"])}
    back = {(p.solver, p.rival): p for p in pairs_of(results[::-1], ["z", "y", "x"])}
    assert len(forth) == 6
    for (solver, rival), p in forth.items():
        q = forth[rival, solver]
        turned = back[solver, rival]
        assert (counts(turned), turned.ratio) == (counts(p), pytest.approx(p.ratio))
        assert counts(q) == counts(p)[::-1]
        assert (q.ratio, q.low, q.high) == pytest.approx((1 / p.ratio, 1 / p.high, 1 / p.low))
        assert sum(counts(p)) == 14


def test_of_the_quantities_of_a_case_the_median_counts():
    def with_errors(solver, *errors):
        named = {f"q{k}": (2.0 + 2.0 * e, "m", 2.0) for k, e in enumerate(errors)}
        return solve(solver, quantities=named)

    one = case("a", with_errors("x", 0.1, 0.2, 0.9), with_errors("y", 0.2, 0.8, 0.3))
    two = case("b", with_errors("x", 0.3), with_errors("y", 0.1))
    found = pair([one, two], metric="quantities")
    assert counts(found) == (1, 0, 1)
    assert (found.low, found.high) == pytest.approx((0.5, 3.0))


def timed(solver, level, error, seconds, count=3, **more):
    """Repetitions within 10 % of `seconds`."""
    spread = (0.9, 1.0, 1.1)[:count]
    return solve(solver, level, error, timings={"solve": [seconds * r for r in spread]}, **more)


def test_times_at_equal_error_are_those_of_power_laws():
    # x: e = h, t = h^-2; y: e = 3h, t = h^-2/2: at e = 3 h_min y takes 4.5 times as long
    solves = []
    for level in range(4):
        h = 0.1 * 0.5**level
        solves += [timed("x", level, h, h**-2), timed("y", level, 3 * h, 0.5 * h**-2)]
    found = pair([case("a", *solves)], "y", "x", "time")
    assert found.ratio == pytest.approx(4.5, rel=1e-9)
    assert counts(found) == (0, 0, 1)
    # a third whose coarsest error is below that is another pair's matter
    assert pair([case("a", *solves, timed("z", 0, 1e-4, 9.0))], "y", "x", "time") == found
    assert pair([case("a", *solves, timed("z", 0, 1e-4, 9.0))], "z", "x", "time") is None


@pytest.mark.parametrize(
    ("count", "notes", "losses"),
    [(1, {}, 0), (2, {}, 0), (3, {}, 1), (3, {"timing": "contended: load 9 on 2 cores"}, 0)],
)
def test_times_that_are_no_sample_are_a_tie(count, notes, losses):
    solves = [timed("x", 0, 0.1, 3.0, count, notes=notes), timed("y", 0, 0.1, 2.0)]
    found = pair([case("a", *solves)], metric="time")
    assert counts(found) == (0, 1 - losses, losses)
    assert found.ratio == pytest.approx(1.35 if count == 1 else 1.425 if count == 2 else 1.5)


def test_no_error_that_the_reference_cannot_tell_from_none_is_paid_for():
    solves = [timed("x", 0, 0.1, 1.0), timed("x", 1, 0.05, 100.0, width=0.06),
              timed("y", 0, 0.1, 2.0), timed("y", 1, 0.05, 8.0)]  # fmt: skip
    assert pair([case("a", *solves)], "y", "x", "time").ratio == pytest.approx(2.0)


def test_programs_with_equal_errors_in_three_scenes_are_one_discretisation():
    same = [{"x": e, "z": 1.2 * e, "y": e + 5e-7, "w": 1.2 * e} for e in (0.1, 0.02, 0.3)]
    names = ["x", "z", "y", "w"]
    assert groups_of(of(same), names) == [["x", "y"], ["z", "w"]]
    assert groups_of(of(same[:2]), names) == []
    apart = [*same, {"x": 0.1, "y": 0.1 + 2e-6}]
    assert groups_of(of(apart), names) == [["z", "w"]]
    # small ones agree whatever made them
    assert groups_of(of([{"x": 1e-15, "y": 1e-13}] * 3), ["x", "y"]) == []
    assert groups_of(of([{"x": 5e-7, "y": 1e-6}] * 3), ["x", "y"]) == []
    assert groups_of(of([*same, {"x": 1e-15, "y": 1e-13}]), names)[0] == ["x", "y"]


def test_a_sweep_agrees_by_the_median_of_its_members():
    same = of([{"x": e, "y": e} for e in (0.1, 0.2)])
    for off, expected in (((0.0, 0.0, 1e-3), [["x", "y"]]), ((0.0, 1e-5, 1e-3), [])):
        sweep = [case(f"s[{d}]", solve("x", error=0.3), solve("y", error=0.3 + d), family="s")
                 for d in off]  # fmt: skip
        assert groups_of([*same, *sweep], ["x", "y"]) == expected


def test_a_group_is_one_only_if_every_pair_agrees():
    chain = [{"a": e, "b": e + 7e-7, "c": e + 1.4e-6} for e in (0.1, 0.2, 0.3)]
    assert groups_of(of(chain), ["a", "b", "c"]) == [["a", "b"]]


def test_coverage_counts_scenes_answered_of_scenes_asked():
    failed = [solve("y", level, status=Status.TIMEOUT) for level in range(2)]
    sweep = [
        case(f"s[{k}]", solve("x", error=0.1),
             solve("y", error=0.1) if k < 1 else solve("y", status=Status.FAILED), family="s")
        for k in range(3)
    ]  # fmt: skip
    results = [
        *sweep,
        case("a", solve("x", error=0.1), *failed),
        case("b", solve("x", error=0.1), solve("y", error=0.1), scene=MOVING),
        case("c", solve("x", 0, 0.1), solve("x", 1, status=Status.FAILED), scene=MOVING),
        # an answer of which nothing could be measured is none: the body is wrong
        case("d", solve("x"), solve("y", status=Status.REFUSED)),
    ]
    assert coverage_of(results, ["x", "y"]) == {
        "x": {"rest": [2, 3], "motion": [2, 2]},
        "y": {"rest": [0, 3], "motion": [1, 1]},
    }
