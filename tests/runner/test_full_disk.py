"""A disk that fills up: no wrong number, nothing finished is lost, one line says what happened."""

import json
import shutil
import subprocess

import pytest

from verify.json_files import read_json

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
