"""Order in which the solves of a run are begun."""

from pathlib import Path

from verify.runner.directory import Job
from verify.runner.plan import CasePlan, start_order
from verify.runner.selection import Options
from verify.scene import load_scene

SOLVERS = ["xfem", "reference"]


def planned(name):
    jobs = [Job(name, s, k, 1, "", Path()) for s in SOLVERS for k in range(2)]
    other = Job(name, "reference", 0, 1, "", Path(), model="kinematics")
    return CasePlan(load_scene(name), SOLVERS, no_job, jobs, models=[other])


def no_job(solver, level):
    raise AssertionError("no further level is asked for")


def order_of_solves(plans, options):
    jobs = [job for plan in plans for job in (*plan.jobs, *plan.models)]
    return sorted(jobs, key=start_order(plans, options))


PLANS = [planned("statics/f1_patch"), planned("benchmark/c3_strip")]


def test_side_by_side_the_longest_case_is_first_and_its_reference_before_further_levels():
    order = order_of_solves(PLANS, Options(jobs=2))
    assert [job.case for job in order] == ["benchmark/c3_strip"] * 5 + ["statics/f1_patch"] * 5
    levels = [(job.solver, job.model, job.level) for job in order[:5]]
    reference = [("reference", "", 0), ("reference", "", 1), ("reference", "kinematics", 0)]
    assert levels == [("xfem", "", 0), *reference, ("xfem", "", 1)]


def test_one_after_the_other_they_keep_the_order_of_the_run():
    order = order_of_solves(PLANS, Options(jobs=1))
    assert order == [job for plan in PLANS for job in (*plan.jobs, *plan.models)]


def test_a_guest_that_left_no_record_comes_last_when_a_run_is_resumed(tmp_path):
    def job(name, *files, solver="xfem"):
        folder = tmp_path / name
        folder.mkdir()
        for name in files:
            (folder / name).write_text("{}")
        return Job("statics/f1_patch", solver, 0, 1, "", folder)

    ended, filled = job("ended", "job.json", "record.json"), job("filled", "job.json")
    reference, new = job("reference", "job.json", solver="reference"), job("new")
    scene = load_scene("statics/f1_patch")
    plan = CasePlan(scene, SOLVERS, no_job, [filled, ended, reference, new])
    assert order_of_solves([plan], Options(jobs=1)) == [ended, new, reference, filled]
