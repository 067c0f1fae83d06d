"""A disk that fills up: no wrong number, nothing finished is lost, one line says what happened."""

import json

import pytest
from small_disk import small_disk

from verify.json_files import read_json
from verify.result import Status
from verify.runner.job import Job
from verify.runner.reference_cache import ReferenceCache
from verify.scene import load_scene
from verify.solution import write_solution

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


def test_a_report_that_does_not_fit_leaves_the_one_before(verify):
    with small_disk(verify.folder / "disk", "4m") as disk:
        out = disk.root / "out"
        assert verify(*RUN, out).returncode == 0
        assert verify("report", out).returncode == 0
        before = (out / "report.html").read_bytes()
        disk.fill()
        done = verify("report", out)
        assert done.returncode == 3, done.stderr
        assert done.stderr.count("\n") == 1
        assert f"No space left on device ({out}" in done.stderr
        assert (out / "report.html").read_bytes() == before
        assert not list(out.rglob("*.partial"))


def test_a_reference_that_does_not_fit_the_cache_is_not_kept_and_not_found(
    tmp_path, case_text, monkeypatch
):
    from fake_solvers import Instant

    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    (tmp_path / "square.toml").write_text(case_text + '[reference]\nkind = "conforming"\n')
    scene = load_scene(tmp_path / "square.toml")
    folder = tmp_path / "solve"
    folder.mkdir()
    job = Job("square", "reference", 0, 1, "any", folder)
    write_solution(Instant().field(16, 1), folder / "solution")
    record = job.blank(Status.SOLVED, "")
    for size in ("4k", "12k"):
        with small_disk(tmp_path / f"disk-{size}", size) as disk:
            cache = ReferenceCache(disk.root / "cache")
            said = cache.keep(scene, job, record)
            assert said.startswith("not kept in the reference cache: No space left on device")
            assert cache.take(scene, job) is None
            assert not list((disk.root / "cache").glob("*"))
            disk.resize("4m")
            assert cache.keep(scene, job, record) == ""
            assert cache.take(scene, job) is not None
