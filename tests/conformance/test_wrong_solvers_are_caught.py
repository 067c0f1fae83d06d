"""A fault of each kind breaks the check that is there for it."""

import json
import re
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec

import pytest
from command_line import forking
from doc_pages import rows_of_table

from verify.cli import main
from verify.conformance import State, conform, exit_code_of, scenes, trials
from verify.conformance.check import evaluate
from verify.conformance.meeting import end_check, interface_check, parted_checks
from verify.conformance.suite import energy_in_motion
from verify.conformance.trials import Outcome
from verify.files import write_json
from verify.result import Status
from verify.runner.child import Ending
from verify.solvers import find_solver
from verify.solvers.xfem import XfemSolver


def state(solver, *names, **options):
    results = conform(f"wrong_solvers:{solver}", only=names, **options)
    return {result.name: result for result in results}


class Solved:
    """A batch of trials that this process has solved itself."""

    start = timeout = 0.0

    def __init__(self, solver, parameters, names, stem):
        self.log, batch = stem.with_suffix(".txt"), stem.with_suffix(".json")
        write_json({"solver": solver, "parameters": dict(parameters), "trials": names}, batch)
        trials.main(batch)

    def poll(self):
        return Ending(0, 0.0, 0.0)


@pytest.fixture
def solved_here(monkeypatch):
    """Let a solver that neither crashes nor hangs solve in this process."""
    monkeypatch.setattr(trials, "_start", Solved)


@pytest.fixture
def forked():
    """Fork the processes of a solver that does no harm to the server that they are forked from."""
    with forking(lambda _: True):
        yield


@pytest.mark.parametrize(
    "solver, check, said",
    [
        ("IgnoresTheCut", "cut-patch", "displacement off by"),
        ("TakesTheFirstCut", "two-cuts", "displacement off by"),
        ("TakesTheFirstCut", "crossing-cuts", "displacement off by"),
        ("TakesTheFirstCut", "branched-cut", "displacement off by"),
        (
            "EndsCutsHalfAnElementTooSoon",
            "ending-cut",
            "closed a quarter of an element before its end",
        ),
        ("TakesOneMaterial", "crossed-interface", "displacement off by"),
        ("IsTwoPerCentTooStiffInSpace", "traction-3d", "displacement off by"),
        ("TakesOnePoissonRatio", "two-materials", "displacement off by"),
        ("MisstatesTheEnergyByAThousandth", "energy-account", "ledger"),
        ("HalvesTheStiffness", "traction", "displacement off by 1.0"),
        ("ForgetsACell", "traction", "the cells do not cover the body once"),
        ("TakesTheWrongDensity", "weight", "Galerkin"),
        ("StretchesWhatTurns", "rigid-rotation-2d", "displacement off by"),
        ("LinearisesFiniteRotation", "finite-rotation-2d", "displacement off by"),
        ("IgnoresTheCut", "parted-3d", "displacement off by"),
        ("LumpsAsTheThesis", "free-fall", "does not stay as it is"),
        ("OverstatesVelocities", "energy-in-motion", "displacements, most at t = "),
        ("BeginsInEquilibrium", "energy-in-motion", "expected 0: the scene begins at rest"),
        ("LosesHorizontalTractions", "mirrored-cut", "discretisation"),
        ("DependsOnNumbering", "renumbering", ""),
        ("AnswersForAFreePiece", "free-piece", "nothing holds a piece"),
        ("CrashesInSpace", "refusals", "unusual-space: IndexError: index 2 is out of bounds"),
    ],
)
def test_a_fault_breaks_the_check_that_is_there_for_it(solver, check, said, monkeypatch):
    monkeypatch.setattr(trials, "_start", Solved)
    found = state(solver, check)[check]
    assert found.state is State.FAIL
    assert said in found.reason
    assert exit_code_of([found]) == 1


def in_this_process(name, solver):
    """One check of a solver that neither crashes nor hangs."""
    every = [*parted_checks(), interface_check(), end_check()]
    (check,) = (check for check in every if check.name == name)
    (trial,) = check.trials
    solution = solver.solve(trial.scene, trial.level, 0)
    return evaluate(check, {trial.name: Outcome(Status.SOLVED, solution=solution)})


@pytest.mark.parametrize("solver, check, said", [
    ("ForgetsABranchAndExcusesItself", "branched-cut", "0.561 m of the cut missing"),
    ("TakesOneMaterialAndExcusesItself", "crossed-interface", "the cut is where it was asked"),
    ("CutsElsewhereAndExcusesItself", "branched-cut", "m of the cut beside it"),
    ("CutsBesideAndStretchesACorner", "crossing-cuts", "energy of what is off"),
    ("CutsBesideAndSwapsTheParts", "crossing-cuts", "does not hold"),
    ("EndsFarTooSoonAndExcusesItself", "ending-cut", "m of the cut missing"),
])  # fmt: skip
def test_a_statement_excuses_only_what_the_measured_cut_explains(solver, check, said):
    found = in_this_process(check, getattr(import_module("wrong_solvers"), solver)())
    assert found.state is State.FAIL
    assert "it states: node moved onto the cut, which does not explain it: " in found.reason
    assert said in found.reason


@pytest.mark.parametrize("solver, check, said", [
    ("wrong_solvers:CutsBesideAndExcusesItself", "crossing-cuts", "0.019 m beside"),
    ("wrong_solvers:EndsElsewhereAndExcusesItself", "ending-cut", "m more"),
    # a part that two cuts leave without a node stays with its sibling
    ("virtual_node", "crossing-cuts", "it states: part without a node left with its sibling"),
    ("snapping", "branched-cut", "0.33 m missing"),
])  # fmt: skip
def test_a_stated_shift_of_the_cut_within_an_element_is_stated(solver, check, said):
    found = in_this_process(check, find_solver(solver))
    assert found.state is State.STATED
    assert said in found.reason
    assert found.observed > found.limit


def test_a_solver_that_leaves_cuts_out_fails_where_they_meet():
    for check in ("two-cuts", "crossing-cuts", "branched-cut", "ending-cut"):
        found = in_this_process(check, find_solver("uncut"))
        assert found.state is State.FAIL, found


@pytest.mark.usefixtures("solved_here")
def test_a_solver_that_states_the_energy_of_its_field_keeps_its_account():
    assert state("Stating", "energy-account")["energy-account"].state is State.PASS


# to first order in the loss; on a moving support another energy is in play at its start
@pytest.mark.parametrize("solver, check, rel", [
    ("LosesThreeThousandthsOfTheEnergy", "energy-in-motion", 0.02),
    ("LosesThreeThousandthsOfTheEnergy", "work-of-supports", 0.5),
])  # fmt: skip
@pytest.mark.usefixtures("solved_here")
def test_a_loss_of_three_thousandths_is_measured_as_that(solver, check, rel):
    found = state(solver, check)[check]
    assert found.state is State.FAIL
    assert "nothing accounts for" in found.reason
    assert found.observed == pytest.approx(0.003, rel=rel)


@pytest.mark.parametrize("given, said", [
    ({"scheme": "central_differences"}, ""), ({"scheme": "generalised_alpha"}, ""),
    ({"scheme": "implicit_euler"}, "takes 0.0"), ({"slivers": "penalise"}, "takes 0.0"),
])  # fmt: skip
def test_a_method_that_takes_energy_and_says_so_passes_like_one_that_does_not(given, said):
    solution = XfemSolver().solve(scenes.swinging(), 0, 0, **given)
    found = energy_in_motion().judge({"swinging": solution})
    assert found.observed < 1e-6
    assert said in found.note
    # without its mass nothing is known that exactly, and that is not held against it
    assert energy_in_motion().judge({"swinging": replace(solution, mass=None)}).limit is None


@pytest.mark.parametrize("solver, check", [("AddsNoiseOfABillionth", "repeatability")])
@pytest.mark.usefixtures("forked")
def test_noise_far_below_the_errors_breaks_repeatability_only(solver, check):
    found = state(solver, "uncut-2d", "cut-patch", check)
    assert found["uncut-2d"].state is found["cut-patch"].state is State.PASS
    assert found[check].state is State.FAIL
    assert "not equal bit by bit" in found[check].reason
    assert exit_code_of(list(found.values())) == 1


@pytest.mark.parametrize("solver, check", [("CrashesOnCuts", "cut-patch")])
@pytest.mark.usefixtures("forked")
def test_a_crash_is_a_finding_and_the_checks_after_it_still_run(solver, check):
    found = state(solver, check, "closed-cut", "uncut-2d", "uncut-3d")
    for name in (check, "closed-cut"):
        assert found[name].state is State.ERROR
        assert "Segmentation fault (signal 11)" in found[name].reason
    assert found["uncut-2d"].state is found["uncut-3d"].state is State.PASS
    assert exit_code_of(list(found.values())) == 3


@pytest.mark.parametrize("solver, check", [("Hangs", "uncut-2d")])
@pytest.mark.usefixtures("forked")
def test_a_solver_that_hangs_is_stopped_and_the_checks_after_it_still_run(solver, check):
    found = state(solver, check, "uncut-3d", timeout=4.0)
    assert found[check].state is State.ERROR
    assert found[check].reason.endswith("no answer after 4 s")
    assert found["uncut-3d"].state is State.PASS


@pytest.mark.usefixtures("solved_here")
def test_a_solver_that_refuses_everything_has_shown_nothing():
    found = state("RefusesEverything", "uncut-2d", "cut-patch", "refusals")
    assert found["cut-patch"].state is State.REFUSED
    assert found["cut-patch"].reason == "it only does beams"
    assert exit_code_of(list(found.values())) == 4


def verdicts(capsys, scene, solver):
    """Judge a solver on a scene by the command line; return verdicts by check and metric."""
    main(["run", scene, "--solver", solver, "--repetitions", "1", "--no-report", "--no-conform",
          "--json"])  # fmt: skip
    found = json.loads(capsys.readouterr().out)["cases"]
    (own,) = (one["verdicts"] for one in found if one["case"] == scene)
    return {(one["check"], one["metric"]): one["verdict"] for one in own}


@pytest.mark.parametrize("solver, scene, metric", [
    ("StumblesOverSlivers", "benchmark/c8_slivers[epsilon=1e-06]", "displacement_l2"),
    pytest.param(
        "LocksAsLinearElements", "material/nearly_incompressible", "strain_energy",
        marks=[pytest.mark.fenicsx,
               pytest.mark.skipif(find_spec("dolfinx") is None, reason="needs DOLFINx")],
    ),
])  # fmt: skip
@pytest.mark.usefixtures("solved_here")
def test_what_the_suite_is_blind_to_a_scene_names(
    solver, scene, metric, tmp_path, monkeypatch, capsys
):
    assert exit_code_of(conform(f"wrong_solvers:{solver}")) == 0
    monkeypatch.chdir(tmp_path)
    with forking(lambda _: True):
        found = verdicts(capsys, scene, f"wrong_solvers:{solver}")
    assert found["error", metric] == "FAIL"


def test_the_page_tells_which_check_catches_which_fault():
    """No second list: its rows are the parameters of the tests, names of solvers as words."""
    tests = (
        test_a_fault_breaks_the_check_that_is_there_for_it,
        test_a_statement_excuses_only_what_the_measured_cut_explains,
        test_a_loss_of_three_thousandths_is_measured_as_that,
        test_noise_far_below_the_errors_breaks_repeatability_only,
        test_a_crash_is_a_finding_and_the_checks_after_it_still_run,
        test_a_solver_that_hangs_is_stopped_and_the_checks_after_it_still_run,
    )
    asserted: dict[str, list[str]] = {}
    for solver, *found in [
        *((*row[:2],) for test in tests for row in parameters(test)),
        *parameters(test_what_the_suite_is_blind_to_a_scene_names),
    ]:
        fault = re.sub(r"(?<!^)(?=[A-Z])", " ", solver).lower()
        asserted.setdefault(fault, []).extend(found)
    rows = rows_of_table("guide/your-solver.md", "planted fault")
    assert {fault: re.findall(r"`([^`]+)`", told) for fault, told in rows} == asserted


def parameters(test):
    (mark,) = (mark for mark in test.pytestmark if mark.name == "parametrize")
    return [getattr(row, "values", row) for row in mark.args[1]]
