"""Level 0 of each solver says whether it takes the case and how many levels follow."""

from pathlib import Path

import pytest
from case_texts import body_text, support_text, weight_text

from verify.files import read_json
from verify.result import Status
from verify.runner.directory import Job
from verify.runner.plan import CasePlan
from verify.scene import load_scene

HANGING = (
    body_text("A square that hangs", "It shall hang.", [1.0, 1.0], [[2, 2], [4, 4]], density="1.0")
    + support_text("top", [0, 0])
    + weight_text()
    + "[reference]\nsize = 0.5\ndegree = 1\n"
)


def job_of(solver, level):
    return Job("case", solver, level, 1, "key", Path("nowhere"))


@pytest.fixture
def plan():
    first = [job_of(name, 0) for name in ("one", "two", "reference")]
    other = Job("case", "reference", 0, 1, "key", Path("nowhere"), model="kinematics")
    solvers = ["one", "two", "reference"]
    return CasePlan(
        load_scene("statics/f1_patch"), solvers, job_of, first, models=[other],
        other_scenes={"kinematics": None}, held=[first[2], other], most_levels=5,
        awaited={"one": 1, "two": 1, "reference": 2},
    )  # fmt: skip


def ends(plan, solver, status, levels=0):
    job = job_of(solver, 0)
    new = plan.following(job, job.blank(status, ""), levels)
    return [(one.solver, one.level, one.model) for one in new]


def test_the_reference_begins_when_one_solver_has_not_refused(plan):
    assert plan.count == 8
    assert ends(plan, "one", Status.REFUSED) == []
    assert plan.count == 7
    reference = [("reference", 0, ""), ("reference", 0, "kinematics")]
    assert ends(plan, "two", Status.TIMEOUT, 3) == [("two", 1, ""), ("two", 2, ""), *reference]
    assert ends(plan, "reference", Status.SOLVED, 3) == [("reference", 1, ""), ("reference", 2, "")]
    assert [job.level for job in plan.spare] == [3, 4]
    order = [(job.solver, job.level) for job in plan.ordered()]
    assert order == [
        ("one", 0),
        *(("two", k) for k in range(3)),
        *(("reference", k) for k in range(3)),
    ]
    # a level 0 that is solved once more, since its files were lost, has nothing to tell
    assert ends(plan, "two", Status.SOLVED, 3) == []
    assert plan.count == 8


def test_a_case_that_all_refuse_ends_without_a_reference(verify):
    (verify.folder / "hanging.toml").write_text(HANGING)
    done = verify("run", "hanging.toml", "--solver=fake_solvers:Refusing", "--out", "out")
    assert done.returncode == 4
    assert "[1/" in done.stderr
    assert set(verify.records()) == {("Refusing", 0)}
    result = read_json(verify.folder / "out/cases/hanging/result.json")
    assert [solve["status"] for solve in result["solves"]] == ["refused"]
    assert result["verdicts"] == []
