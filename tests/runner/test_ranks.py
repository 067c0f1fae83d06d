"""References on several MPI ranks: the same answer, the same endings, nothing left running."""

import time
from threading import Timer
from types import SimpleNamespace

import numpy as np
import pytest
from case_texts import body_text, cut_text, support_text

from verify.errors import InputError
from verify.files import read_json, write_json
from verify.runner import ranks, work
from verify.runner.child import POLL_SECONDS, Child
from verify.scene import load_scene, scene_content
from verify.solution import read_solution
from verify.solvers import find_solver

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


def test_two_ranks_give_the_answer_of_one_and_say_so(verify, monkeypatch):
    """A run wants two ranks for each level; one level gets them, and this process solves it too."""
    (verify.folder / "box.toml").write_text(BOX)
    asked, solving = [], work.solving

    def of_one_level(job, *rest):
        asked.append(job["ranks"])
        return solving({**job, "ranks": 2 if job["level"] == 1 else 1}, *rest)

    monkeypatch.setattr(work, "solving", of_one_level)
    done = verify("run", "box.toml", "--solver=reference", "--no-cache", "--ranks", "2",
                  "--out", "out")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert asked == [2, 2, 2]
    assert verify.records()["reference", 1]["notes"]["ranks"] == "2"
    one = find_solver("reference").solve(load_scene(verify.folder / "box.toml"), 1, 0)
    two = read_solution(verify.folder / "out/cases/box/reference-1/solution")
    assert two.ledger["strain"] == pytest.approx(one.ledger["strain"], rel=1e-10)
    # the nodes are numbered otherwise, and nodes of both faces share their place
    rows = [np.hstack([f.points, f.displacement[-1]]).round(8) for f in (one, two)]
    order = [np.lexsort(row.T[::-1]) for row in rows]
    difference = one.displacement[-1][order[0]] - two.displacement[-1][order[1]]
    assert np.abs(difference).max() <= 1e-10 * np.abs(one.displacement).max()


def test_one_rank_that_fails_ends_the_others_and_is_told(job, verify):
    start = time.monotonic()
    ended(job("fake_solvers:FailingOnOneRank"))
    assert time.monotonic() - start < 40
    outcome = read_json(verify.folder / "outcome.json")
    assert outcome["status"] == "failed"
    assert outcome["reason"] == "ZeroDivisionError: the pivot is zero (on rank 1)"


@pytest.mark.parametrize("first_says", [True, False])
def test_what_the_first_rank_says_within_a_moment_counts(tmp_path, monkeypatch, first_says):
    monkeypatch.setattr(ranks, "_WAIT_SECONDS", 30.0 if first_says else 0.1)
    aborted, file = [], tmp_path / "outcome.json"
    comm = SimpleNamespace(rank=1, Abort=aborted.append)
    said = Timer(0.2, write_json, ({"reason": "the cause"}, file))
    if first_says:
        said.start()
    ranks.give_up(comm, {"reason": "what follows from it"}, file)
    found = "the cause" if first_says else "what follows from it (on rank 1)"
    assert (read_json(file)["reason"], aborted) == (found, [1])


def test_ranks_that_do_not_find_each_other_are_told(monkeypatch):
    monkeypatch.setenv(ranks.RANKS_VARIABLE, "3")
    with pytest.raises(InputError, match="started 3 processes of which each finds 1: it is of"):
        ranks.world()
