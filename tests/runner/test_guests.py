"""Misbehaviour of a guest is a row with its reason: nobody else loses a verdict, the run ends."""

import errno
from pathlib import Path

import pytest

from verify.files import read_json, write_json
from verify.result import Status, read_result
from verify.runner.solve import main, solve_job
from verify.scene import load_scene, scene_content

# reasons, as they begin
ANSWERS = {
    "Text": "the solver returned a 'str'; expected",
    "Spoiling": "displacement has values that are not finite",
    "Collapsed": "no cell has a volume",
    "InSpace": "a solution in 3D; expected 2D, as the case is",
    "Escaping": r"ValueError: \x1b[31mred\x1b]0;title\x07",
    "Exiting": "SystemExit: 0",
    # when it is asked
    "TextLevels": "levels() gave '3'; expected a whole number from 1 to",
    "RaisingRefusal": "SystemExit: not today",
    "Blaming": "body.msh: its mesh has a hole",
}
# of solvers that are compared: status and reason
COMPARED = dict.fromkeys(("Large", "TinySize", "Twice", "FarAway", "Needle"), (Status.SOLVED, ""))
PROCESSES = {
    "Elsewhere": (Status.SOLVED, ""),
    "Leaving": (Status.SOLVED, ""),
    "Chatty": (Status.SOLVED, ""),
    "Quitting": (Status.FAILED, "said nothing (exit code 0, without an answer)"),
}


@pytest.fixture
def scene(tmp_path, case_text):
    (tmp_path / "square.toml").write_text(case_text)
    return load_scene(tmp_path / "square.toml")


def solved(scene, name, folder):
    """Return how level 0 of a guest ends, which is asked first whether it takes the case."""
    job = {"scene": scene_content(scene), "solver": f"guests:{name}", "level": 0}
    return solve_job({**job, "repetitions": 1, "parameters": {}, "tell_levels": True}, folder)


@pytest.mark.parametrize("name", ANSWERS)
def test_nonsense_has_its_reason(tmp_path, monkeypatch, scene, name):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    outcome = solved(scene, name, tmp_path)
    assert (outcome["status"], outcome["reason"][: len(ANSWERS[name])]) == ("failed", ANSWERS[name])
    assert len(outcome["reason"]) < 500
    assert outcome["reason"].isprintable()
    assert not list(tmp_path.glob("solution*"))


def test_what_fills_the_disk_is_removed_so_that_others_can_write(tmp_path, scene, monkeypatch):
    folder = tmp_path / "solve"
    (folder / "scratch").mkdir(parents=True)
    for name in ("job.json", "log.txt", "half.vtu", "scratch/matrix"):
        (folder / name).write_text("x")
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    monkeypatch.setattr("verify.solution.write_solution", full_disk)
    job = {"scene": scene_content(scene), "solver": "guests:Guest", "level": 0}
    outcome = solve_job({**job, "repetitions": 1, "parameters": {}}, folder)
    assert (outcome["status"], outcome["reason"]) == ("failed", "the disk is full")
    assert {path.name for path in folder.iterdir()} == {"job.json", "log.txt"}


def full_disk(*_):
    raise OSError(errno.ENOSPC, "No space left on device")


@pytest.mark.parametrize("name, status", [("Guest", "solved"), ("Talking", "refused")])
def test_links_in_its_folder_are_not_written_through(name, status, tmp_path, scene, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    folder, kept = tmp_path / "solve", tmp_path / "kept.json"
    folder.mkdir()
    kept.write_text("mine")
    for link in ("solution.json", "solution.vtu", "outcome.json"):
        (folder / link).symlink_to(kept)
    job = {"scene": scene_content(scene), "solver": f"guests:{name}", "level": 0}
    write_json({**job, "repetitions": 1, "parameters": {}}, folder / "job.json")
    main(folder / "job.json")
    assert kept.read_text() == "mine"
    outcome = read_json(folder / "outcome.json")
    assert outcome["status"] == status
    assert len(outcome["reason"]) <= 400  # of any length, a sentence
    assert status == "refused" or (folder / "solution.json").stat().st_size > 100


def test_who_does_not_declare_contact_is_not_asked_for_it(scene, tmp_path):
    """Whatever it answers itself: it would let the faces overlap and be judged for it."""
    content = scene_content(scene)
    cut = {"kind": "polyline", "points": [[0.2, 0.5], [0.8, 0.5]]}
    content["scene"] |= {"contact": {"expected": "closed"}, "cuts": [cut]}
    job = {"scene": content, "solver": "fake_solvers:Instant", "level": 0}
    reason = "contact of the faces of a cut ('static') is not offered by instant"
    assert solve_job({**job, "repetitions": 1, "parameters": {}}, tmp_path)["reason"] == reason


def run(verify, names, *options):
    """Run guests beside a solver that works; return their rows."""
    solvers = [f"--solver=guests:{name}" for name in names]
    done = verify(
        "run", "square.toml", "--out", "out", "--solver=fake_solvers:Instant", *solvers,
        "--repetitions=1", "--no-conform", "-j2", *options,
    )  # fmt: skip
    assert "Traceback" not in done.stderr
    result = read_result(verify.folder / "out/cases/square/result.json")
    solves = {(s.solver.partition(":")[2], s.level): s for s in result.solves}
    assert {level for guest, level in solves if guest in names} == {0}  # the case has two meshes
    for level in (0, 1):  # who works beside them keeps its numbers
        assert solves["Instant", level].status is Status.SOLVED
        assert solves["Instant", level].metric("displacement_l2").value < 1e-12
    return {name: solves[name, 0] for name in names}, done


def assert_rows(rows, expected):
    for name, (status, reason) in expected.items():
        assert (rows[name].status, rows[name].reason) == (status, reason), name


def test_whatever_it_does_to_its_process_it_is_a_row(verify, tmp_path_factory):
    mark = tmp_path_factory.mktemp("left") / "pid"
    verify.environment["LEFT_MARK"] = str(mark)
    rows, done = run(verify, PROCESSES)
    assert_rows(rows, PROCESSES)
    assert done.returncode == 3
    assert sorted(path.name for path in verify.folder.iterdir()) == ["out", "square.toml"]
    left = Path("/proc", mark.read_text(), "stat")  # ended with the solve that started it
    assert not left.exists() or left.read_text().rpartition(")")[2].split()[0] == "Z"
    log = (verify.folder / "out/cases/square/guests_Chatty-0/log.txt").read_bytes()
    assert b"cut here by the runner" in log


@pytest.mark.heavy
def test_numbers_that_are_absurd_are_compared_beside_the_others(verify):
    rows, _ = run(verify, COMPARED)
    assert_rows(rows, COMPARED)
    # a size of its own makes no answer wrong
    assert rows["TinySize"].metric("displacement_l2").value < 1e-12
    assert rows["Large"].metric("displacement_l2").value > 1e90
    assert "cover 2 of the body" in rows["Twice"].notes["comparison"]
    assert "outside the body" in rows["FarAway"].notes["comparison"]
