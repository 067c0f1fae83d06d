"""Claims about rankings: ranks from intervals, nothing averaged away, nothing ranked alone."""

import pytest

from verify.judge.ranks import rank_solvers
from verify.result import CaseResult, Metric, ReferenceRecord, Regularisation, SolveRecord, Status


def solve(case, solver, level, error=None, width=0.0, seconds=None, status=Status.SOLVED, **more):
    metrics = [] if error is None else [Metric("energy_norm", error, "1", None, width, "exact")]
    return SolveRecord(
        case,
        solver,
        level,
        status,
        metrics=[*metrics, *more.pop("metrics", [])],
        size=0.1 * 0.5**level,
        timings={} if seconds is None else {"solve": [seconds * r for r in (0.9, 1.0, 1.1)]},
        **more,
    )


def case_of(name, solves, verdicts=()):
    return CaseResult(name, name, "", "", {}, ReferenceRecord(), solves, [], list(verdicts))


def compared(ranking, question="accuracy", metric="energy_norm", view="finest level"):
    (found,) = [c for c in ranking[question] if (c["metric"], c["view"]) == (metric, view)]
    return found, {s["solver"]: s for s in found["standings"]}


def test_cases_are_joined_by_the_geometric_mean_of_ratios_to_the_best():
    results = [
        case_of("a", [solve("a", "x", 0, 0.01), solve("a", "y", 0, 0.02)]),
        case_of("b", [solve("b", "x", 0, 0.3), solve("b", "y", 0, 2.4)]),
    ]
    _, by = compared(rank_solvers(results))
    assert by["x"]["value"] == pytest.approx(1.0)
    assert by["y"]["value"] == pytest.approx(4.0)  # √(2·8)
    assert (by["x"]["rank"], by["y"]["rank"]) == (1, 2)


@pytest.mark.parametrize(("width", "ranks"), [(0.0004, (1, 2)), (0.0006, (1, 1))])
def test_overlapping_intervals_are_a_tie(width, ranks):
    solves = [solve("a", "x", 0, 0.010, width), solve("a", "y", 0, 0.011, width)]
    _, by = compared(rank_solvers([case_of("a", solves)]))
    assert (by["x"]["rank"], by["y"]["rank"]) == ranks
    assert by["x"]["tied"] == (ranks == (1, 1))


def test_a_solver_that_fails_somewhere_is_listed_and_not_ranked_on_the_rest():
    failed = solve("b", "y", 0, status=Status.FAILED, reason="singular")
    results = [
        case_of("a", [solve("a", "x", 0, 0.2), solve("a", "y", 0, 0.001)]),
        case_of("b", [solve("b", "x", 0, 0.2), failed, solve("b", "z", 0, 0.3)]),
        case_of("c", [solve("c", n, 0, 0.2) for n in ("x", "y", "z")]),
    ]
    ranking = rank_solvers(results)
    found, by = compared(ranking)
    assert (by["x"]["rank"], by["y"]["rank"], by["z"]["rank"]) == (1, None, None)
    assert (by["y"]["count"], by["z"]["count"], found["items"]) == (2, 2, 3)
    # x alone is everywhere: it is the measure, not the solver that did one case well
    assert by["x"]["value"] == pytest.approx(1.0)
    reasons = {(e["case"], e["solver"]): e["reason"] for e in found["left_out"]}
    assert "singular" in reasons["b", "y"]
    assert "not run" in reasons["a", "z"]
    assert ("b", "y") in {(e["case"], e["solver"]) for e in ranking["left_out"]}


def test_of_a_case_that_the_reference_alone_solved_no_error_is_missed():
    failed = solve("a", "x", 0, status=Status.FAILED, reason="singular")
    ranking = rank_solvers([case_of("a", [solve("a", "reference", 0), failed])])
    assert [entry["solver"] for entry in ranking["left_out"]] == ["x"]


def test_a_case_that_is_exact_to_round_off_does_not_enter_the_mean():
    results = [
        case_of("patch", [solve("patch", "x", 0, 1e-15), solve("patch", "y", 0, 0.1)]),
        case_of("b", [solve("b", "x", 0, 0.2), solve("b", "y", 0, 0.1)]),
    ]
    ranking = rank_solvers(results)
    found, by = compared(ranking)
    assert by["x"]["value"] == pytest.approx(2.0)
    assert compared(ranking, view="where a solver is exact")[1]["x"]["rank"] == 1
    (entry,) = [e for e in found["left_out"] if e["case"] == "patch"]
    assert "round-off: x" in entry["reason"]
    assert "y 1.00e-01" in entry["reason"]


@pytest.mark.parametrize("level", [0, 1])
def test_solvers_at_round_off_tie_for_first_and_a_wrong_one_is_last(level):
    errors = {"still": 1.0, "x": 3e-15, "near": 1e-6, "y": 2e-16}
    solves = [solve("patch", n, level if n == "still" else 1, e) for n, e in errors.items()]
    ranking = rank_solvers([case_of("patch", solves)])
    found, by = compared(ranking, view="where a solver is exact")
    assert {n: s["rank"] for n, s in by.items()} == {"x": 1, "y": 1, "near": 3, "still": 4}
    assert by["x"]["tied"]
    assert by["y"]["tied"]
    assert [s["solver"] for s in found["standings"]][-1] == "still"
    # it does not move at all: that is no answer
    body = Metric("displacement_l2", 1.0 - 2e-16, "1", None, 1e-3, "conforming")
    solves = [solve("a", "still", 0, metrics=[body]), solve("a", "x", 0, 0.1)]
    assert rank_solvers([case_of("a", solves)])["stability"][-1]["solver"] == "still"


def test_a_case_whose_reference_cannot_tell_an_error_from_none_makes_no_ranks_ties():
    told = [solve("b", "x", 0, 0.01, 0.001), solve("b", "y", 0, 0.5, 0.001)]
    untold = [solve("a", "x", 0, 0.010, 0.020), solve("a", "y", 0, 0.012, 0.001)]
    found, by = compared(rank_solvers([case_of("a", untold), case_of("b", told)]))
    assert (by["x"]["rank"], by["y"]["rank"]) == (1, 2)
    assert by["x"]["low"] > 0.0
    (entry,) = found["left_out"]
    assert entry["case"] == "a"
    assert entry["reason"].startswith("undecided")
    alone, _ = compared(rank_solvers([case_of("a", untold)]))
    assert alone["standings"] == []


def test_equal_size_takes_the_finest_common_level_and_refuses_unequal_meshes():
    solves = [solve("a", "x", level, 0.1 * 0.5**level) for level in range(3)]
    solves += [solve("a", "y", level, 0.3 * 0.5**level) for level in range(2)]
    _, by = compared(rank_solvers([case_of("a", solves)]), view="equal size")
    assert by["y"]["value"] == pytest.approx(3.0)
    _, by = compared(rank_solvers([case_of("a", solves)]))
    assert by["y"]["value"] == pytest.approx(0.15 / 0.025)
    other = [SolveRecord(**{**vars(s), "size": 0.7 * s.size}) if s.solver == "y" else s
             for s in solves]  # fmt: skip
    found, by = compared(rank_solvers([case_of("a", other)]), view="equal size")
    assert not by
    assert "10 %" in found["left_out"][0]["reason"]


def test_time_at_equal_error_is_that_of_the_power_laws():
    # x: e = h, t = h⁻²; y: e = 3h, t = ½h⁻²: at e = 3h_min, y takes ½h_min⁻², x (3h_min)⁻²
    solves = []
    for level in range(4):
        h = 0.1 * 0.5**level
        solves += [solve("a", "x", level, h, 0.0, h**-2),
                   solve("a", "y", level, 3 * h, 0.0, 0.5 * h**-2)]  # fmt: skip
    found, by = compared(rank_solvers([case_of("a", solves)]), "cost", view="time at equal error")
    assert by["x"]["value"] == pytest.approx(1.0)
    assert by["y"]["value"] == pytest.approx(4.5, rel=1e-9)
    assert (by["x"]["rank"], by["y"]["rank"]) == (1, 2)
    assert not found["left_out"]


def test_time_is_compared_at_no_error_that_the_reference_cannot_tell_from_none():
    solves = [solve("a", "x", 0, 0.1, 0.0, 1.0), solve("a", "x", 1, 0.05, 0.06, 100.0),
              solve("a", "y", 0, 0.1, 0.0, 2.0), solve("a", "y", 1, 0.05, 0.0, 8.0)]  # fmt: skip
    _, by = compared(rank_solvers([case_of("a", solves)]), "cost", view="time at equal error")
    assert (by["x"]["value"], by["y"]["value"]) == pytest.approx((1.0, 2.0))


@pytest.mark.parametrize(
    ("repetitions", "notes", "said"),
    [(1, {}, 1), (2, {}, 1), (3, {}, 0), (3, {"timing": "contended: load 9 on 2 cores"}, 1)],
)
def test_times_that_are_no_sample_rank_nobody_before_another(repetitions, notes, said):
    solves = [solve("a", name, 0, 0.1, notes=dict(notes)) for name in ("x", "y")]
    for one, seconds in zip(solves, (2.0, 3.0), strict=True):
        one.timings.update({"meshing": [1.0], "solve": [seconds] * repetitions})
    ranking = rank_solvers([case_of("a", solves)])
    assert sum("all are tied" in note for note in ranking["contended"]) == said
    assert len(ranking["contended"]) == said
    _, by = compared(ranking, "cost", view="time at equal error")
    assert by["y"]["value"] == pytest.approx(4 / 3)
    assert (by["x"]["rank"], by["y"]["rank"]) == (1, 1 if said else 2)
    assert by["x"]["tied"] == by["y"]["tied"] == bool(said)


def test_stability_counts_what_was_lost_and_forgives_refusals():
    worst = Metric("displacement_l2", 7.0, "1", None, 0.1, "exact")
    solves = [
        solve("a", "x", 0, 0.1),
        solve("a", "x", 1, status=Status.REFUSED, reason="not in space"),
        solve("a", "y", 0, 0.1, metrics=[worst]),
        solve("a", "y", 1, 0.1, regularisations=[Regularisation("node moved", 3, 0.1, "m")]),
        solve("a", "z", 0, status=Status.TIMEOUT, reason="60 s"),
        solve("a", "z", 1, 0.1, notes={"pieces inside out": "2"}),
    ]
    by = {s["solver"]: s for s in rank_solvers([case_of("a", solves)])["stability"]}
    assert (by["x"]["rank"], by["x"]["tied"], by["x"]["lost"]) == (1, False, 0.0)
    assert by["y"]["rank"] == by["z"]["rank"] == 2
    assert by["y"]["blown_up"] == 1
    assert by["y"]["regularisations"] == {"node moved": 3}
    assert (by["z"]["timeout"], by["z"]["inside_out"]) == (1, 1)
    assert by["x"]["refused"] == 1
    said = [solve("a", "x", 0, 0.1, notes={"pieces inside out": "near (0.1, 0.2) m"})]
    (one,) = rank_solvers([case_of("a", said)])["stability"]
    assert one["inside_out"] == 1  # what is no number is no zero either


def test_of_energy_the_worst_case_counts_and_round_off_is_as_good_as_zero():
    def moved(case, solver, drift):
        return solve(case, solver, 0, metrics=[Metric("energy_drift", drift, "1", source="own")])

    results = [
        case_of("a", [moved("a", "x", 1e-15), moved("a", "y", 3e-13), moved("a", "z", 1e-3)]),
        case_of("b", [moved("b", "x", 2e-15), moved("b", "y", 1e-14), moved("b", "z", 1e-9)]),
    ]
    _, by = compared(rank_solvers(results), "energy", "energy_drift")
    assert by["x"]["rank"] == by["y"]["rank"] == 1
    assert (by["z"]["rank"], by["z"]["value"], by["z"]["where"]) == (3, 1e-3, "a")


def test_profiles_count_what_a_solver_has_not_done_as_never_done():
    """Dolan & Moré: y is best on a, twice as far off on b, refuses c; Moré & Wild: seconds."""
    l2 = {"name": "displacement_l2", "unit": "1"}

    def one(case, solver, error, seconds):
        metric = Metric(value=error, source="exact", **l2)
        return solve(case, solver, 0, seconds=seconds, metrics=[metric])

    refused = solve("c", "y", 0, status=Status.REFUSED, reason="not in space")
    results = [
        case_of("a", [one("a", "x", 0.04, 1.0), one("a", "y", 0.02, 3.0)]),
        case_of("b", [one("b", "x", 0.01, 1.0), one("b", "y", 0.02, 3.0)]),
        case_of("c", [one("c", "x", 0.5, 1.0), refused, one("c", "z", 1e-15, 9.0)]),
    ]
    performance, coarse, fine = rank_solvers(results)["profiles"]
    assert performance["items"] == 3
    assert performance["steps"]["x"] == pytest.approx([1.0, 2.0, 0.5e11])
    assert performance["steps"]["y"] == pytest.approx([1.0, 2.0])
    assert coarse["items"] == 3
    assert coarse["steps"] == {"x": [1.0, 1.0], "y": [3.0, 3.0], "z": [9.0]}
    assert fine["steps"] == {"x": [1.0], "y": [], "z": [9.0]}
    assert fine["items"] == 3  # the protocol: of all cases
