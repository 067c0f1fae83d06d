"""Order in which the solves of a run are begun."""

from verify.runner.directory import Job
from verify.runner.plan import CasePlan, start_order
from verify.runner.selection import Options
from verify.scene import load_scene

SOLVERS = ["xfem", "reference"]


def no_job(solver, level):
    raise AssertionError("no further level is asked for")


def order_of_solves(plans, options):
    jobs = [job for plan in plans for job in (*plan.jobs, *plan.models)]
    return sorted(jobs, key=start_order(plans, options))


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
