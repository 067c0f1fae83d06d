"""References on several MPI ranks: the same answer, the same endings, nothing left running."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from case_texts import body_text, cut_text, support_text

from verify.errors import InputError
from verify.json_files import read_json, write_json
from verify.runner import ranks
from verify.runner.child import POLL_SECONDS, Child
from verify.scene import load_scene, scene_content
from verify.solution import read_solution

pytest.importorskip("mpi4py")
try:
    ranks.mpiexec()
except InputError:
    pytest.skip("needs mpiexec", allow_module_level=True)

BOX = (
    body_text("A box, cut halfway, pulled", "It shall be pulled.", [1.0, 1.0, 1.0], [[2, 2, 2]])
    + support_text("bottom", [0, 0, 0])
    + '[[loads]]\nkind = "traction"\nwhere = "top"\ntraction = [0.0, 0.0, 0.1]\n'
    + cut_text([-0.1, -0.1, 0.52], [0.5, -0.1, 0.52], [0.5, 1.1, 0.52], [-0.1, 1.1, 0.52])
    + "[reference]\nsize = 1.0\ndegree = 1\n"
)


def gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


def wait_for(condition, what, seconds=60):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, what
        time.sleep(0.05)


@pytest.fixture
def job(verify, monkeypatch):
    """A function that starts one solve on some ranks."""
    marks = verify.folder / "marks"
    marks.mkdir()
    monkeypatch.setenv("HANG_MARK", str(marks))
    monkeypatch.setenv("PYTHONPATH", verify.environment["PYTHONPATH"])
    monkeypatch.chdir(verify.folder)

    def start(solver, case="square.toml", count=2, level=0, timeout=60.0):
        content = {"scene": scene_content(load_scene(verify.folder / case)), "solver": solver,
                   "level": level, "repetitions": 1, "parameters": {}, "ranks": count}  # fmt: skip
        write_json(content, verify.folder / "job.json")
        where = (verify.folder / "job.json", verify.folder / "log.txt")
        return Child("verify.runner.solve", *where, timeout, 4e9, ranks=count)

    return start


def ended(child):
    while (ending := child.poll()) is None:
        time.sleep(POLL_SECONDS)
    return ending


def test_two_ranks_give_the_answer_of_one_and_say_so(verify, job):
    """Solve on two ranks as a run does, and on one."""
    (verify.folder / "box.toml").write_text(BOX)
    done = verify("run", "box.toml", "--solver=reference", "--no-cache", "--ranks", "2",
                  "--out", "out")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert verify.records()["reference", 1]["notes"]["ranks"] == "2"
    ended(job("reference", "box.toml", 1, level=1))
    stems = (verify.folder / "solution", verify.folder / "out/cases/box/reference-1/solution")
    one, two = (read_solution(stem) for stem in stems)
    assert two.ledger["strain"] == pytest.approx(one.ledger["strain"], rel=1e-10)
    # the nodes are numbered otherwise, and those of both faces share their place
    rows = [np.hstack([f.points, f.displacement[-1]]).round(8) for f in (one, two)]
    order = [np.lexsort(row.T[::-1]) for row in rows]
    difference = one.displacement[-1][order[0]] - two.displacement[-1][order[1]]
    assert np.abs(difference).max() <= 1e-10 * np.abs(one.displacement).max()


def test_a_time_limit_ends_all_ranks(job):
    child = job("fake_solvers:HangingRanks", timeout=5.0)
    ending = ended(child)
    assert ending.killed_for == "timeout"
    started = [int(p.name) for p in Path(os.environ["HANG_MARK"]).iterdir()]
    assert len(started) == 2
    wait_for(lambda: all(map(gone, started)), "a rank outlived its solve", 20)


def test_ranks_die_with_their_runner(job, verify):
    """The runner is killed by SIGKILL, and cannot clean up."""
    job("fake_solvers:HangingRanks").kill()  # writes job.json
    for mark in Path(os.environ["HANG_MARK"]).iterdir():
        mark.unlink()
    code = """if True:
        import time
        from pathlib import Path
        from verify.runner.child import Child
        Child("verify.runner.solve", Path("job.json"), Path("log.txt"), 60.0, 4e9, ranks=2)
        time.sleep(600)
    """
    runner = subprocess.Popen([sys.executable, "-c", code], cwd=verify.folder)
    marks = Path(os.environ["HANG_MARK"])
    wait_for(lambda: len(list(marks.iterdir())) == 2, "the ranks do not start")
    started = [int(p.name) for p in marks.iterdir()]
    os.kill(runner.pid, signal.SIGKILL)
    runner.wait()
    wait_for(lambda: all(map(gone, started)), "a rank outlived its runner", 20)


def test_one_rank_that_fails_ends_the_others_and_is_told(job, verify):
    start = time.monotonic()
    ended(job("fake_solvers:FailingOnOneRank"))
    assert time.monotonic() - start < 40
    outcome = read_json(verify.folder / "outcome.json")
    assert outcome["status"] == "failed"
    assert outcome["reason"] == "ZeroDivisionError: the pivot is zero (on rank 1)"


def test_ranks_that_do_not_find_each_other_are_told(monkeypatch):
    monkeypatch.setenv(ranks.RANKS_VARIABLE, "3")
    with pytest.raises(InputError, match="started 3 processes of which each finds 1: it is of"):
        ranks.world()


def test_no_mpiexec_is_one_line_and_writes_nothing(verify):
    code = ("import sys; sys.executable = '/nowhere/python'; from verify.cli.main import main; "
            "main(['run', 'square.toml', '--ranks', '2', '--out', 'out'])")  # fmt: skip
    environment = {**verify.environment, "PATH": "/nowhere"}
    done = subprocess.run(
        [sys.executable, "-c", f"{code}"], cwd=verify.folder, env=environment, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert "--ranks: needs mpiexec" in done.stderr
    assert not (verify.folder / "out").exists()


def test_what_all_ranks_refuse_is_told_once(verify, job):
    """A through cut frees the upper half: the reason is the one of a single rank."""
    text = BOX.replace("[0.5, -0.1, 0.52], [0.5, 1.1", "[1.1, -0.1, 0.52], [1.1, 1.1")
    (verify.folder / "box.toml").write_text(text)
    ended(job("reference", "box.toml"))
    outcome = read_json(verify.folder / "outcome.json")
    assert outcome["status"] == "failed"
    assert "support" in outcome["reason"]
