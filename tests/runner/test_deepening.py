"""Levels that a reference gets as long as it is too coarse for what it judges."""

import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest
from case_texts import body_text, cut_text, support_text, weight_text

from verify.judge.intervals import sufficiency
from verify.result import CaseResult, Metric, ReferenceRecord, SolveRecord, Status
from verify.runner.directory import Job
from verify.runner.plan import CasePlan, next_level, unneeded_levels
from verify.scene import Scene, load_scene

MISSING = [name for name in ("gmsh", "dolfinx") if find_spec(name) is None]

CASE = (
    body_text(
        "A slit under its weight",
        "It shall open.",
        [1.0, 1.0],
        [[24, 24]],
        young="1.0e4",
        density="1000.0",
    )
    + support_text("top", [0, 0])
    + weight_text()
    + cut_text([0.3, 0.52], [0.7, 0.52])
    + "[reference]\nsize = 0.3\ndegree = 1\nlevels = 3\nmax_levels = {most}\n"
    + '[[quantities]]\nkind = "opening"\nname = "opening"\nat = 0.5\n'
)


def solve(solver, level, value=1.1, uncertainty=0.001, status=Status.SOLVED):
    metric = Metric("opening", value, "m", 1.0, uncertainty, "conforming")
    return SolveRecord("slit", solver, level, status, metrics=[metric])


@pytest.fixture
def scene(tmp_path) -> Scene:
    file = tmp_path / "slit.toml"
    file.write_text(CASE.format(most=5))
    return load_scene(file)


def judged(scene, *solves):
    found = ReferenceRecord("conforming", **sufficiency(scene, solves, "reference", 3))
    return CaseResult("slit", "", "", "", {}, found, list(solves), [], [])


def job_of(solver, level):
    return Job("slit", solver, level, 1, "key", Path())


def plan(scene):
    spare = [Job("slit", "reference", level, 1, "key", Path()) for level in (3, 4)]
    return CasePlan(scene, ["xfem", "reference"], job_of, spare=spare)


def test_the_finest_solution_of_every_solver_sets_the_measure(scene):
    coarse, fine = solve("xfem", 0), solve("xfem", 1, value=1.005)
    found = sufficiency(scene, [fine, coarse, solve("conforming", 1)], "reference", 3)
    assert not found["suffices"]  # 0.001 of 0.005
    assert found["suffices_reason"].startswith("not reached with 3 levels")
    worst, other = found["judged_errors"].items()
    assert worst[0] == "opening of xfem, level 1"
    assert worst[1]["ratio"] == pytest.approx(0.2)
    assert other[1]["ratio"] == pytest.approx(0.01)
    assert sufficiency(scene, [coarse], "reference", 3)["suffices"]


def test_a_solution_that_is_exact_needs_no_better_reference(scene):
    found = sufficiency(scene, [solve("xfem", 0, 1.0, 1e-13)], "reference", 3)
    assert found["suffices"]
    by_chance = sufficiency(scene, [solve("xfem", 0, 1.0, 1e-3)], "reference", 3)
    assert not by_chance["suffices"]


def test_levels_are_added_one_by_one_while_they_are_needed(scene):
    waiting = plan(scene)
    poor = judged(scene, solve("xfem", 0, uncertainty=0.05), solve("reference", 0))
    good = judged(scene, solve("xfem", 0), solve("reference", 0))
    assert next_level(waiting, good) is None
    assert next_level(waiting, poor).level == 3
    assert next_level(waiting, poor).level == 4
    assert next_level(waiting, poor) is None
    assert [job.level for job in waiting.jobs] == [3, 4]


def test_no_level_follows_one_that_was_not_solved(scene):
    failed = solve("reference", 3, status=Status.TIMEOUT)
    poor = solve("xfem", 0, uncertainty=1)
    assert next_level(plan(scene), judged(scene, poor, failed)) is None
    unjudged = replace(judged(scene), reference=ReferenceRecord("none", reason="too few levels"))
    assert next_level(plan(scene), unjudged) is None


@pytest.mark.parametrize("status", [Status.TIMEOUT, Status.MEMORY, Status.FAILED])
def test_levels_wait_in_vain_when_fewer_than_three_can_have_an_answer(scene, status):
    levels = [Job("slit", "reference", level, 1, "key", Path()) for level in range(4)]
    others = [Job("slit", "xfem", 0, 1, "key", Path()), Job("other", "reference", 2, 1, "", Path())]
    waiting = [others[0], *levels[1:3], others[1]]
    three = CasePlan(scene, ["xfem", "reference"], job_of, jobs=[others[0], *levels[:3]])
    in_vain = unneeded_levels(three, levels[0], levels[0].blank(status, "why"), waiting)
    assert [job for job, _ in in_vain] == levels[1:3]
    assert all(record.status is Status.FAILED for _, record in in_vain)
    assert all("level 0" in record.reason for _, record in in_vain)
    four = CasePlan(scene, ["xfem", "reference"], job_of, jobs=levels)
    assert not unneeded_levels(four, levels[0], levels[0].blank(status, "why"), levels[1:])
    assert not unneeded_levels(three, levels[0], levels[0].blank(Status.SOLVED, ""), waiting)
    assert not unneeded_levels(three, others[0], others[0].blank(status, "why"), waiting)


@pytest.mark.fenicsx
@pytest.mark.skipif(bool(MISSING), reason=f"needs {' and '.join(MISSING)}")
def test_a_run_solves_levels_until_the_reference_suffices_and_says_so(verify):
    case = verify.folder / "slit.toml"
    case.write_text(CASE.format(most=6))
    command = ("run", "slit.toml", "--out", "out", "--repetitions", "1", "--solver", "xfem")
    assert verify(*command).returncode == 0
    result = json.loads((verify.folder / "out/cases/slit/result.json").read_text())
    levels = [level["level"] for level in result["reference"]["levels"]]
    assert result["reference"]["suffices"]
    assert 3 < len(levels) <= 6
    assert levels == list(range(len(levels)))
    assert f"reached with {len(levels)} levels" in result["reference"]["suffices_reason"]
    # again: nothing is solved, and the reason stays
    again = verify(*command)
    assert f"{len(levels) + 1} finished solves of before were reused" in again.stdout
    said = json.loads((verify.folder / "out/cases/slit/result.json").read_text())["reference"]
    assert said["suffices_reason"] == result["reference"]["suffices_reason"]
