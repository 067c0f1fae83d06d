"""A fault of each kind breaks the check that is there for it."""

from dataclasses import replace

import pytest

from verify.conformance import State, conform, exit_code_of, scenes
from verify.conformance.energy_in_motion import energy_in_motion
from verify.solvers.xfem import XfemSolver


def state(solver, *names, **options):
    results = conform(f"wrong_solvers:{solver}", only=names, **options)
    return {result.name: result for result in results}


@pytest.mark.parametrize(
    "solver, check, said",
    [
        ("IgnoresTheCut", "cut-patch", "displacement off by"),
        ("SwapsTheSides", "cut-patch", "displacement off by"),
        ("SwapsTheSides", "traction", "displacement off by"),
        ("TakesTheFirstCut", "two-cuts", "displacement off by"),
        ("TakesTheLastCut", "two-cuts", "displacement off by"),
        ("TakesTheFirstCut", "crossing-cuts", "displacement off by"),
        ("TakesTheFirstCut", "branched-cut", "displacement off by"),
        ("EndsElsewhere", "ending-cut", "open a quarter of an element beyond its end"),
        ("EndsTooSoon", "ending-cut", "closed a quarter of an element before its end"),
        ("TakesOneMaterial", "crossed-interface", "displacement off by"),
        ("TooStiffInSpace", "traction-3d", "displacement off by"),
        ("TakesOneMaterial", "two-materials", "displacement off by"),
        ("TakesThePoissonRatioOfOne", "two-materials", "displacement off by"),
        ("WrongEnergy", "energy-account", "ledger"),
        ("HalfAsStiff", "traction", "displacement off by 1.0"),
        ("TakesTheWrongDensity", "weight", "Galerkin"),
        ("SpinsFreely", "rigid-rotation-2d", "displacement off by"),
        ("TurnsALittle", "finite-rotation-2d", "displacement off by"),
        ("StatesStrainOfRotation", "finite-rotation-2d", "where there is none"),
        ("IgnoresTheCut", "parted-3d", "displacement off by"),
        ("LumpsAsTheThesis", "free-fall", "does not stay as it is"),
        ("ForgetsOutputs", "free-fall", "output times"),
        ("SaysTooFast", "energy-in-motion", "not the rates of its displacements"),
        ("KnowsOnlyUpright", "mirrored-cut", "discretisation"),
        ("DependsOnNumbers", "renumbering", ""),
        ("Noisy", "repeatability", "not equal bit by bit"),
        ("Remembers", "repeatability", "not equal bit by bit"),
        ("LosesAPiece", "cut-patch", "do not cover the body"),
        ("AnswersAnything", "free-piece", "nothing holds a piece"),
        ("RaisesInSpace", "refusals", "unusual-space: IndexError: index 2 is out of bounds"),
    ],
)
def test_a_fault_breaks_the_check_that_is_there_for_it(solver, check, said):
    found = state(solver, check)[check]
    assert found.state is State.FAIL
    assert said in found.reason
    assert exit_code_of([found]) == 1


def test_what_a_solver_states_is_said_where_it_is_off_and_is_not_held_against_it():
    """A part that two cuts leave without a node stays with its sibling in virtual_node."""
    (found,) = conform("virtual_node", only=["crossing-cuts"])
    assert found.state is State.REFUSED
    assert "it states: part without a node left with its sibling" in found.reason


def test_a_solver_that_states_the_energy_of_its_field_keeps_its_account():
    assert state("Stating", "energy-account")["energy-account"].state is State.PASS


def test_a_loss_of_three_thousandths_is_measured_as_that():
    found = state("LosesEnergySlowly", "energy-in-motion")["energy-in-motion"]
    assert found.state is State.FAIL
    assert "nothing accounts for" in found.reason
    assert found.observed == pytest.approx(0.003, rel=0.02)  # to first order in the loss


@pytest.mark.parametrize("given, said", [
    ({"scheme": "newmark"}, ""), ({"scheme": "central_differences"}, ""),
    ({"scheme": "energy_momentum"}, ""), ({"scheme": "generalised_alpha"}, ""),
    ({"scheme": "implicit_euler"}, "takes 0.0"), ({"slivers": "penalise"}, "takes 0.0"),
])  # fmt: skip
def test_a_method_that_takes_energy_and_says_so_passes_like_one_that_does_not(given, said):
    solution = XfemSolver().solve(scenes.swinging(), 0, 0, **given)
    found = energy_in_motion().judge({"swinging": solution})
    assert found.observed < 1e-6
    assert said in found.note
    # without its mass nothing is known that exactly, and that is not held against it
    assert energy_in_motion().judge({"swinging": replace(solution, mass=None)}).limit is None


def test_noise_far_below_the_errors_breaks_repeatability_only():
    found = state("Noisy", "uncut-2d", "cut-patch", "repeatability")
    assert found["uncut-2d"].state is found["cut-patch"].state is State.PASS
    assert found["repeatability"].state is State.FAIL


def test_a_crash_is_a_finding_and_the_checks_after_it_still_run():
    found = state("CrashesOnCuts", "cut-patch", "closed-cut", "uncut-2d", "uncut-3d")
    for name in ("cut-patch", "closed-cut"):
        assert found[name].state is State.ERROR
        assert "Segmentation fault (signal 11)" in found[name].reason
    assert found["uncut-2d"].state is found["uncut-3d"].state is State.PASS
    assert exit_code_of(list(found.values())) == 3


def test_a_solver_that_hangs_is_stopped_and_the_checks_after_it_still_run():
    found = state("Hangs", "uncut-2d", "uncut-3d", timeout=4.0)
    assert found["uncut-2d"].state is State.ERROR
    assert found["uncut-2d"].reason.endswith("no answer after 4 s")
    assert found["uncut-3d"].state is State.PASS


def test_a_solver_that_refuses_everything_has_shown_nothing():
    found = state("DoesNothing", "uncut-2d", "cut-patch", "refusals")
    assert found["cut-patch"].state is State.REFUSED
    assert found["cut-patch"].reason == "it only does beams"
    assert exit_code_of(list(found.values())) == 4
