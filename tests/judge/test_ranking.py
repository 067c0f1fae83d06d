"""Claims about rankings beside pairs: robustness, energy, and the omissions."""

from dataclasses import replace

import pytest

from verify.judge.notices import INSIDE_OUT
from verify.judge.ranks import rank_solvers
from verify.result import CaseResult, Metric, ReferenceRecord, Regularisation, SolveRecord, Status


def solve(case, solver, level, error=None, width=0.0, status=Status.SOLVED, **more):
    metrics = [] if error is None else [Metric("energy_norm", error, "1", None, width, "exact")]
    return SolveRecord(
        case,
        solver,
        level,
        status,
        metrics=[*metrics, *more.pop("metrics", [])],
        size=0.1 * 0.5**level,
        **more,
    )


def case_of(name, solves, verdicts=()):
    return CaseResult(name, name, "", "", {}, ReferenceRecord(), solves, [], list(verdicts))


def of_energy(results):
    (found,) = rank_solvers(results)["energy"]
    return found, {s["solver"]: s for s in found["standings"]}


def test_a_body_that_does_not_move_is_no_answer():
    body = Metric("displacement_l2", 1.0 - 2e-16, "1", None, 1e-3, "conforming")
    solves = [solve("a", "still", 0, metrics=[body]), solve("a", "x", 0, 0.1)]
    assert rank_solvers([case_of("a", solves)])["stability"][-1]["solver"] == "still"


def test_what_is_in_no_ratio_is_listed_with_its_reason():
    failed = solve("b", "y", 0, status=Status.FAILED, reason="singular")
    untold = [solve("a", "x", 0, 0.010, 0.020), solve("a", "y", 0, 0.012, 0.001),
              solve("a", "z", 0, 1e-15, 1e-14)]  # fmt: skip
    results = [case_of("a", untold), case_of("b", [solve("b", "x", 0, 0.2), failed])]
    listed = {(e["case"], e["solver"]): e["reason"] for e in rank_solvers(results)["left_out"]}
    assert listed == {
        ("b", "y"): "level 0 failed: singular",
        ("a", ""): "energy_norm not told from none, in no ratio: x 1.0e-02 ± 2.0e-02",
    }


@pytest.mark.parametrize(
    ("repetitions", "notes", "said"),
    [(1, {}, 1), (2, {}, 1), (3, {}, 0), (3, {"timing": "contended: load 9 on 2 cores"}, 1)],
)
def test_why_times_may_be_off_stands_beside_them(repetitions, notes, said):
    solves = [solve("a", name, 0, 0.1, notes=dict(notes)) for name in ("x", "y")]
    for one in solves:
        one.timings.update({"meshing": [1.0], "solve": [2.0] * repetitions})
    contended = rank_solvers([case_of("a", solves)])["contended"]
    assert sum("times tie" in note for note in contended) == len(contended) == said


def test_of_a_case_that_the_reference_alone_solved_no_error_is_missed():
    failed = solve("a", "x", 0, status=Status.FAILED, reason="singular")
    ranking = rank_solvers([case_of("a", [solve("a", "reference", 0), failed])])
    assert [entry["solver"] for entry in ranking["left_out"]] == ["x"]


def test_stability_counts_what_was_lost_and_forgives_refusals():
    worst = Metric("displacement_l2", 7.0, "1", None, 0.1, "exact")
    solves = [
        solve("a", "x", 0, 0.1),
        solve("a", "x", 1, status=Status.REFUSED, reason="not in space"),
        solve("a", "y", 0, 0.1, metrics=[worst]),
        solve("a", "y", 1, 0.1, regularisations=[Regularisation("node moved", 3, 0.1, "m")]),
        solve("a", "z", 0, status=Status.TIMEOUT, reason="60 s"),
        solve("a", "z", 1, 0.1, notes={INSIDE_OUT: "0.1 of the volume"}),
        solve("a", "w", 0, 0.1, metrics=[replace(worst, uncertainty=4.0)]),  # nobody knows
    ]
    by = {s["solver"]: s for s in rank_solvers([case_of("a", solves)])["stability"]}
    assert (by["x"]["rank"], by["x"]["tied"], by["x"]["lost"]) == (1, True, 0.0)
    assert by["y"]["rank"] == by["z"]["rank"] == 3  # two have lost nothing
    assert by["y"]["tied"]
    assert by["z"]["tied"]
    assert (by["y"]["blown_up"], by["w"]["blown_up"]) == (1, 0)
    assert by["y"]["regularisations"] == {"node moved": 3}
    assert (by["z"]["timeout"], by["z"]["inside_out"]) == (1, 1)
    assert by["x"]["refused"] == 1
    (alone,) = rank_solvers([case_of("a", solves[:2])])["stability"]
    assert (alone["rank"], alone["tied"]) == (1, False)


def moved(case, solver, drift):
    return solve(case, solver, 0, metrics=[Metric("energy_drift", drift, "1", source="own")])


def test_of_energy_the_worst_case_counts_and_round_off_is_as_good_as_zero():
    results = [
        case_of("a", [moved("a", "x", 1e-15), moved("a", "y", 3e-13), moved("a", "z", 1e-3)]),
        case_of("b", [moved("b", "x", 2e-15), moved("b", "y", 1e-14), moved("b", "z", 1e-9)]),
    ]
    _, by = of_energy(results)
    assert by["x"]["rank"] == by["y"]["rank"] == 1
    assert by["x"]["tied"]
    assert (by["z"]["rank"], by["z"]["value"], by["z"]["where"]) == (3, 1e-3, "a")


@pytest.mark.parametrize("taker", ["a blade", "damping"])
def test_energy_that_a_blade_or_damping_takes_is_no_drift(taker):
    names = ("energy_drift", "energy_slope", "energy_oscillation", "energy_jump")
    known = [Metric(name, 0.9, "1", source="own") for name in (*names, "ledger_mismatch")]
    if taker == "a blade":
        taken = {"metrics": [*known, Metric("released_to_cut", 0.9, "J", source="own")]}
    else:
        taken = {"metrics": known, "account": {"time": [0.0, 1.0], "damping": [0.0, 0.9]}}
    results = [case_of("a", [moved("a", "x", 1e-3)]), case_of("b", [solve("b", "x", 0, **taken)])]
    found = {one["metric"]: one for one in rank_solvers(results)["energy"]}
    assert set(found) == {"energy_drift", "ledger_mismatch"}
    (standing,) = found["energy_drift"]["standings"]
    assert (standing["where"], standing["value"], standing["rank"]) == ("a", 1e-3, 1)


def test_a_solver_that_fails_in_motion_is_listed_and_not_ranked_on_the_rest():
    failed = solve("b", "y", 0, status=Status.FAILED, reason="singular")
    results = [case_of("a", [moved("a", "x", 2e-3), moved("a", "y", 1e-5)]),
               case_of("b", [moved("b", "x", 1e-3), failed])]  # fmt: skip
    found, by = of_energy(results)
    assert (by["x"]["rank"], by["y"]["rank"], by["y"]["count"], found["items"]) == (1, None, 1, 2)
    (entry,) = found["left_out"]
    assert (entry["case"], entry["solver"]) == ("b", "y")
    assert "singular" in entry["reason"]
