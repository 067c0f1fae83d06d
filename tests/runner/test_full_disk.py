"""A disk that fills up: no wrong number, nothing finished is lost, one line says what happened."""

import json

import pytest
from small_disk import small_disk

from verify.json_files import read_json

RUN = ("run", "square.toml", "--solver=fake_solvers:Instant", "--repetitions", "1", "--out")


def numbers(folder):
    """What the run says of its case, without times and provenance."""
    result = read_json(folder / "cases/square/result.json")
    found = [(s["solver"], s["level"], s["status"], s["metrics"]) for s in result["solves"]]
    return found, result["verdicts"], result["rates"]


def all_whole(folder):
    for file in folder.rglob("*.json"):
        json.loads(file.read_text())
    return True


@pytest.fixture(scope="module")
def roomy(tmp_path_factory):
    """What the run says where there is room."""
    return {}


@pytest.mark.parametrize("size", ["16k", "44k"])
def test_a_run_on_a_disk_that_fills_says_so_and_is_resumed_where_there_is_room(verify, roomy, size):
    """The smaller is full before the first solution is stored, the larger at the second."""
    if not roomy:
        assert verify(*RUN, "roomy").returncode == 0
        roomy["numbers"] = numbers(verify.folder / "roomy")
    with small_disk(verify.folder / "disk", size) as disk:
        out = disk.root / "out"
        first = verify(*RUN, out)
        assert first.returncode == 3, first.stderr
        assert "Traceback" not in first.stderr
        assert "device" in first.stderr or "disk" in first.stderr
        assert all_whole(out)
        finished = [
            file.parent
            for file in out.glob("cases/*/*/record.json")
            if read_json(file)["record"]["status"] == "solved"
        ]
        disk.resize("4m")
        second = verify(*RUN, out)
        assert second.returncode == 0, second.stderr
        assert second.stderr.count("reused") == len(finished)
        assert numbers(out) == roomy["numbers"]
