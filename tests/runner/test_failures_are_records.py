"""Solves that end badly: each is a record with its reason, and the others go on."""

import json
from pathlib import Path

import pytest
from command_line import without_waits

from verify.runner.child import Ending, death

ENDINGS = {
    "Refusing": ("refused", "it only does beams"),
    "RefusingLate": ("refused", "it found a knot"),
    "Raising": ("failed", "ZeroDivisionError: the pivot is zero"),
    "Crashing": ("failed", "Segmentation fault (signal 11)"),
    "Leaving": ("failed", "[0]PETSC ERROR: zero pivot in row 7 (exit code 59)"),
    "NotFinite": ("failed", "displacement has values that are not finite"),
}


def test_every_ending_is_a_record_with_its_reason_beside_a_solver_that_works(verify):
    solvers = [f"--solver=fake_solvers:{name}" for name in ("Instant", *ENDINGS)]
    asked = ("--out", "out", "-j", "2", "--no-conform", "--repetitions", "4")
    done = verify("run", "square.toml", *asked, *solvers)
    records = verify.records()
    for name, (status, reason) in ENDINGS.items():
        assert (records[name, 0]["status"], records[name, 0]["reason"]) == (status, reason)
    assert records["Instant", 0]["status"] == records["Instant", 1]["status"] == "solved"
    assert done.returncode == 3
    well = records["Instant", 1]
    assert well["timings"] == {"solve": [1e-3] * 4}
    assert 0 < well["wall"] < 600
    assert 20e6 < well["peak_memory"] < 1e9  # an interpreter with numpy
    assert well["notes"]["threads"] == "1"
    assert well["notes"]["timing"].startswith("contended")
    assert "calibration" in well["notes"]
    # the log keeps the output of the solver
    log = verify.folder / "out/cases/square/fake_solvers_Raising-0/log.txt"
    assert "Traceback" in log.read_text()
    result = json.loads((verify.folder / "out/cases/square/result.json").read_text())
    assert len(result["solves"]) == len(records)


def test_a_solve_that_hangs_is_killed_with_its_children_after_the_timeout(verify):
    mark = verify.folder / "mark"
    command = ("run", "square.toml", "--solver=fake_solvers:Hanging", "--timeout", "3")
    verify(*command, "--out", "out", HANG_MARK=str(mark))
    record = verify.records()["Hanging", 0]
    assert (record["status"], record["reason"]) == ("timeout", "killed after 3 s")
    assert 3.0 <= record["wall"] < 300
    assert not alive_in_group(int(mark.read_text()))


def test_a_solve_that_eats_memory_is_killed_and_its_peak_recorded(verify):
    done = verify(
        "run", "square.toml", "--solver=fake_solvers:Hungry", "--memory", "0.4", "--out", "out"
    )
    record = verify.records()["Hungry", 0]
    assert (verify.folder / "out" / record["notes"]["log"]).is_file()
    assert record["notes"]["log"] in done.stderr
    assert record["status"] == "memory"
    assert record["reason"] == "killed above 400 MB"
    # it touches 16 MB per 5 ms and is looked at every 20 ms (with the machine's own delays)
    assert 0.4e9 < record["peak_memory"] < 1.5e9


@pytest.mark.parametrize(
    "solver, said",
    [
        ("fake_solvers:Brittle", "RuntimeError"),
        ("fake_solvers:Nobody", "fake_solvers"),
        ("no_such_module:Solver", "no_such_module"),
    ],
)
def test_a_solver_that_was_asked_for_and_does_not_work_is_bad_input(verify, solver, said):
    done = verify("run", "square.toml", "--solver", solver, "--out", "out")
    assert done.returncode == 2
    assert said in done.stderr
    assert without_waits(done.stderr).count("\n") == 1
    assert not (verify.folder / "out").exists()


def alive_in_group(leader):
    """Whether a process of the group still runs (zombies do not count)."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[2]) == leader and fields[0] != "Z":
            return True
    return False


@pytest.mark.parametrize("ending, status, said", [
    (Ending(-9, 1.0, 1.0, starved=True), "memory", "killed by the system, which was out of memory"),
    (Ending(-9, 1.0, 1.0), "failed", "killed from outside (signal 9), not for memory"),
    (Ending(9, 1.0, 1.0, starved=True), "failed", "its last words (exit code 9)"),
    (Ending(-11, 1.0, 1.0), "failed", "its last words (signal 11)"),
    (Ending(0, 1.0, 1.0), "failed", "its last words (exit code 0, without an answer)"),
    (Ending(-9, 1.0, 1.0, "timeout"), "timeout", "killed after 3 s"),
])  # fmt: skip
def test_an_end_without_an_outcome_is_told_from_how_the_process_ended(
    tmp_path, ending, status, said
):
    (tmp_path / "log.txt").write_text("its last words\n")
    assert death(tmp_path / "log.txt", ending, 3.0, 1e9) == (status, said)
