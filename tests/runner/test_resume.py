"""A run that was stopped, however, is resumed: what is finished is reused, nothing else."""

import json
import os
import signal
import time
from pathlib import Path

import pytest

SLOW = "--solver=fake_solvers:HangingOnLevelOne"


def wait_for(condition, process=None, seconds=60):
    """Wait until `condition` holds; `process` must not end before."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "nothing happened"
        assert process is None or process.poll() is None, process.communicate()
        time.sleep(0.02)


def count(file: Path):
    return len(file.read_text().splitlines()) if file.exists() else 0


def gone(pid):
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except OSError:
        return True


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_run_leaves_no_process_and_is_resumed(verify, how):
    """Level 0 is solved, level 1 hangs; the run is stopped; the same command then ends well."""
    mark, solves = verify.folder / "mark", verify.folder / "solves"
    command = ("run", "square.toml", SLOW, "--out", "out")
    process = verify.start(*command, HANG_MARK=str(mark), COUNT_SOLVES=str(solves))
    wait_for(lambda: mark.exists() and mark.read_text(), process)
    os.kill(process.pid, how)
    _, err = process.communicate(timeout=60)
    wait_for(lambda: gone(int(mark.read_text())))  # the solver died with its runner

    assert process.returncode == (-9 if how == signal.SIGKILL else 128 + how)
    if how != signal.SIGKILL:
        assert f"interrupted by {how.name}; the same command resumes it" in err
    run = json.loads((verify.folder / "out/run.json").read_text())
    assert run["finished"] is None
    assert set(verify.records()) == {("HangingOnLevelOne", 0)}

    rendered = verify("report", "out")
    assert rendered.returncode == 0, rendered.stderr
    assert (verify.folder / "out/report.html").exists()

    assert count(solves) == 1
    done = verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 2  # level 1 only
    assert "level 0: reused" in done.stderr
    assert {r["status"] for r in verify.records().values()} == {"solved"}
    assert json.loads((verify.folder / "out/run.json").read_text())["finished"]


def solved_once(verify, solves):
    command = ("run", "square.toml", "--solver=fake_solvers:Instant", "--out", "out")
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 2
    return command


def test_a_finished_run_is_not_repeated(verify):
    solves = verify.folder / "solves"
    command = solved_once(verify, solves)
    before = (verify.folder / "out/cases/square/result.json").read_bytes()
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 2
    assert (verify.folder / "out/cases/square/result.json").read_bytes() == before


def test_changed_physics_is_solved_again_and_changed_words_are_not(verify):
    solves, case = verify.folder / "solves", verify.folder / "square.toml"
    command = solved_once(verify, solves)
    case.write_text(case.read_text().replace("It shall be stretched", "It shall stretch"))
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 2
    case.write_text(case.read_text().replace("young = 1.0", "young = 2.0"))
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 4


def test_a_damaged_solution_or_record_is_solved_again(verify):
    solves = verify.folder / "solves"
    command = solved_once(verify, solves)
    folder = verify.folder / "out/cases/square/fake_solvers_Instant-1"
    vtu = folder / "solution.vtu"
    vtu.write_bytes(vtu.read_bytes()[:-20])
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 3
    changed = bytearray(vtu.read_bytes())
    changed[len(changed) // 2] ^= 1
    vtu.write_bytes(changed)
    (folder.with_name("fake_solvers_Instant-0") / "record.json").write_text("{")
    verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 5
    assert vtu.read_bytes() != bytes(changed)
