"""Directories of runs: locks, stopped and finished runs, damage, a disk that fills."""

import errno
import json
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest
from command_line import without_waits

from verify.errors import InputError
from verify.files import read_json
from verify.runner.directory import claimed

IDENTITY = {"cases": ["a"], "options_of_result": {"repetitions": 1}}


def refused(verify, *arguments):
    done = verify("run", *arguments)
    assert done.returncode == 2
    assert done.stdout == ""
    assert without_waits(done.stderr).count("\n") == 1
    return done.stderr


def contents(folder):
    return {path: path.stat().st_mtime_ns for path in folder.rglob("*")}


RUN = ("run", "square.toml", "--solver=fake_solvers:Instant", "--repetitions", "1", "--out")


def numbers(folder):
    """What the run says of its case, without times and provenance."""
    result = read_json(folder / "cases/square/result.json")
    found = [(s["solver"], s["level"], s["status"], s["metrics"]) for s in result["solves"]]
    return found, result["verdicts"], result["rates"]


@pytest.fixture
def disk(tmp_path):
    """A file system of a few kilobytes, on which the second solution does not fit."""
    root = tmp_path / "disk"
    root.mkdir()
    if shutil.which("mount") is None:
        pytest.skip("needs mount")
    command = ["mount", "-t", "tmpfs", "-o", "size=44k", "none", str(root)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        pytest.skip(f"may not mount a small disk: {done.stderr.strip()}")
    yield root
    subprocess.run(["umount", "-l", str(root)], capture_output=True, check=True)


def test_a_run_on_a_disk_that_fills_says_so_and_is_resumed_where_there_is_room(verify, disk):
    assert verify(*RUN, "roomy").returncode == 0
    out = disk / "out"
    first = verify(*RUN, out)
    assert first.returncode == 3, first.stderr
    assert "Traceback" not in first.stderr
    assert "device" in first.stderr or "disk" in first.stderr
    for file in out.rglob("*.json"):
        json.loads(file.read_text())
    records = [read_json(file)["record"] for file in out.glob("cases/*/*/record.json")]
    subprocess.run(["mount", "-o", "remount,size=4m", str(disk)], capture_output=True, check=True)
    second = verify(*RUN, out)
    assert second.returncode == 0, second.stderr
    finished = sum(record["status"] == "solved" for record in records)
    assert second.stderr.count("reused") == finished
    assert numbers(out) == numbers(verify.folder / "roomy")


SLOW = "--solver=fake_solvers:HangingOnLevelOne"


def wait_for(condition, process=None, seconds=300):
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
    """Level 1 hangs, a second run is refused; stopped, the same command ends well."""
    mark, solves = verify.folder / "mark", verify.folder / "solves"
    command = ("run", "square.toml", SLOW, "--out", "out")
    process = verify.start(*command, HANG_MARK=str(mark), COUNT_SOLVES=str(solves))
    wait_for(lambda: mark.exists() and mark.read_text(), process)
    before = contents(verify.folder / "out")
    assert "another run is writing into it" in refused(verify, *command[1:])
    assert contents(verify.folder / "out") == before
    os.kill(process.pid, how)
    _, err = process.communicate(timeout=300)
    wait_for(lambda: gone(int(mark.read_text())))  # the solver died with its runner

    assert process.returncode == (-9 if how == signal.SIGKILL else 128 + how)
    if how != signal.SIGKILL:
        assert f"interrupted by {how.name}; the same command resumes it" in err
    run = json.loads((verify.folder / "out/run.json").read_text())
    assert run["finished"] is None
    assert set(verify.records()) == {("HangingOnLevelOne", 0)}

    assert count(solves) == 1
    done = verify(*command, COUNT_SOLVES=str(solves))
    assert count(solves) == 2  # level 1 only
    assert "level 0: reused" in done.stderr
    assert {r["status"] for r in verify.records().values()} == {"solved"}
    assert json.loads((verify.folder / "out/run.json").read_text())["finished"]


def test_only_what_is_missing_changed_or_damaged_is_solved_again(verify):
    solves, case, out = (verify.folder / name for name in ("solves", "square.toml", "out"))
    result, vtu = (
        out / "cases/square" / name
        for name in ("result.json", "fake_solvers_Instant-1/solution.vtu")
    )

    def solved(count_of_all):
        verify(*RUN, "out", COUNT_SOLVES=str(solves))
        assert count(solves) == count_of_all

    solved(2)
    before = result.read_bytes()
    solved(2)
    assert result.read_bytes() == before
    case.write_text(case.read_text().replace("It shall be stretched", "It shall stretch"))
    solved(2)
    case.write_text(case.read_text().replace("young = 1.0", "young = 2.0"))
    solved(4)
    vtu.write_bytes(vtu.read_bytes()[:-20])
    solved(5)
    changed = bytearray(vtu.read_bytes())
    changed[len(changed) // 2] ^= 1
    vtu.write_bytes(changed)
    (vtu.parent.with_name("fake_solvers_Instant-0") / "record.json").write_text("{")
    solved(7)
    assert vtu.read_bytes() != bytes(changed)
    # a run with other cases or options is refused with the command that resumes
    (verify.folder / "other.toml").write_text(case.read_text())
    kept = contents(out)
    same = ("--solver=fake_solvers:Instant", "--repetitions", "1", "--out", "out")
    assert "square.toml" in refused(verify, "other.toml", *same)
    assert "repetitions" in refused(verify, "square.toml", "--solver=fake_solvers:Wrong", *same[1:])
    assert contents(out) == kept


def test_a_solve_that_was_refused_is_not_asked_for_again_by_the_same_code(verify):
    """Else every case with a refusal is compared anew, too."""
    case, command = (
        verify.folder / "square.toml",
        [*RUN, "out", "--solver=fake_solvers:RefusingLate"],
    )
    assert ": refused" in verify(*command).stderr
    record = verify.folder / "out/cases/square/fake_solvers_RefusingLate-0/record.json"
    result, before = verify.folder / "out/cases/square/result.json", record.read_bytes()
    judged = result.read_bytes()
    again = verify(*command).stderr
    assert "RefusingLate · level 0: reused" in again
    assert (record.read_bytes(), result.read_bytes()) == (before, judged)
    # left out without a try, as by --within
    content = read_json(record)
    record.write_text(json.dumps(content | {"record": content["record"] | {"wall": None}}))
    assert "RefusingLate · level 0: refused" in verify(*command).stderr
    case.write_text(case.read_text().replace("young = 1.0", "young = 2.0"))
    assert "RefusingLate · level 0: refused" in verify(*command).stderr


def test_a_directory_on_a_disk_that_is_read_only_is_bad_input(tmp_path, monkeypatch):
    """Nothing has begun: nothing is finished, and the same command would not resume it."""

    def mkdir(self, **_):
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(self))

    monkeypatch.setattr(Path, "mkdir", mkdir)
    wanted = "out: cannot be written .Read-only file system.; give --out a folder that can be"
    with pytest.raises(InputError, match=wanted), claimed(tmp_path / "out", IDENTITY):
        pass
