"""A reference is solved once per content; a damaged one, or one of other content, is not used."""

import json
import os
import shutil
import zipfile
from dataclasses import replace

import numpy as np
import pytest
from fake_solvers import Instant

from verify.errors import InputError
from verify.provenance import versions
from verify.result import Status
from verify.runner import references
from verify.runner.directory import Job, RunDirectory
from verify.runner.plan import plan_case
from verify.runner.references import ReferenceBundle, ReferenceCache, write_bundle
from verify.runner.selection import Options
from verify.scene import load_scene
from verify.solution import read_solution, write_solution

LEVELS = 3


@pytest.fixture
def scene(tmp_path, case_text):
    (tmp_path / "square.toml").write_text(case_text + '[reference]\nkind = "conforming"\n')
    return load_scene(tmp_path / "square.toml")


@pytest.fixture
def cache(tmp_path):
    return ReferenceCache(tmp_path / "cache")


def job_of(folder, level):
    folder.mkdir(parents=True, exist_ok=True)
    return Job("square", "reference", level, 1, "any", folder)


@pytest.fixture
def kept(scene, cache, tmp_path):
    """Three levels, kept."""
    for level in range(LEVELS):
        job = job_of(tmp_path / f"solve-{level}", level)
        write_solution(Instant().field(2 << level, 1), job.folder / "solution")
        assert cache.keep(scene, job, job.blank(Status.SOLVED, "")) == ""
    return cache


@pytest.fixture(autouse=True)
def threads(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "1")


def test_what_was_kept_is_taken_with_its_origin(scene, kept, tmp_path):
    job = job_of(tmp_path / "again", 1)
    record = kept.take(scene, job)
    assert record.status is Status.SOLVED
    assert "from the reference cache, solved 20" in record.notes["cache"]
    if dolfinx := versions().get("dolfinx"):
        assert f"with DOLFINx {dolfinx}" in record.notes["cache"]
    assert len(read_solution(job.folder / "solution").points) == 25


@pytest.mark.parametrize("change", ["young = 2.0", "scene"])
def test_other_physics_or_other_code_finds_nothing(scene, kept, tmp_path, monkeypatch, change):
    if change == "scene":
        monkeypatch.setattr(references, "code_of_solver", lambda name: "another version")
        assert {entry.outdated for entry in kept.entries()} == {True}
    else:
        text = scene.file.read_text().replace("young = 1.0", change)
        scene.file.write_text(text)
        scene = load_scene(scene.file)
    assert kept.take(scene, job_of(tmp_path / "again", 1)) is None
    assert len(kept.entries()) == LEVELS  # of the others nothing is lost


@pytest.mark.parametrize(
    "file, damage", [("solution.vtu", "cut"), ("solution.json", "changed"), ("entry.json", "gone")]
)
def test_a_damaged_entry_is_not_used_and_makes_room(scene, kept, tmp_path, file, damage):
    key = kept.find(scene)[1].key
    place = kept.root / key / file
    text = place.read_bytes()
    if damage == "gone":
        place.unlink()
    else:
        place.write_bytes(text[:-20] if damage == "cut" else text.replace(b"1", b"2"))
    job = job_of(tmp_path / "again", 1)
    assert kept.take(scene, job) is None
    assert not (kept.root / key).exists()


def test_two_runs_that_keep_the_same_reference_leave_one_whole_entry(scene, kept, tmp_path):
    job = job_of(tmp_path / "solve-1", 1)
    assert kept.keep(scene, job, job.blank(Status.SOLVED, "")) == ""
    assert len(kept.entries()) == LEVELS
    assert not [path for path in kept.root.iterdir() if path.name.startswith(".")]


def test_a_bundle_gives_the_references_back_and_is_the_same_file_twice(scene, kept, tmp_path):
    one, two = tmp_path / "one.zip", tmp_path / "two.zip"
    assert len(write_bundle(one, [scene], kept)) == LEVELS
    write_bundle(two, [scene], kept)
    assert one.read_bytes() == two.read_bytes()
    shutil.rmtree(kept.root)
    bundle = ReferenceBundle(one)
    assert bundle.levels(scene) == LEVELS
    job = job_of(tmp_path / "again", 2)
    assert "one.zip" in bundle.take(scene, job).notes["cache"]
    taken, solved = (
        read_solution(path / "solution") for path in (job.folder, tmp_path / "solve-2")
    )
    assert len(taken.points) == 81
    off = np.abs(taken.displacement - solved.displacement).max()
    assert off <= 2.0**-28 * np.abs(solved.displacement).max()  # eight digits are kept


def test_a_bundle_keeps_six_digits_of_every_time_in_motion(scene, kept, tmp_path):
    """A small field at one time is not rounded by a large one at another."""
    job, random = job_of(tmp_path / "moving", 1), np.random.default_rng(3)
    field = Instant().field(4, 1)
    moving = random.standard_normal((3, *field.points.shape)) * np.array([[[1e-3]], [[0.0]], [[9]]])
    solution = replace(
        field, times=np.array([0.0, 0.1, 0.2]),
        displacement=moving, velocity=1e5 * moving, acceleration=moving,
    )  # fmt: skip
    write_solution(solution, job.folder / "solution")
    kept.remove([kept.find(scene)[1]])
    assert kept.keep(scene, job, job.blank(Status.SOLVED, "")) == ""
    write_bundle(tmp_path / "one.zip", [scene], kept)
    ReferenceBundle(tmp_path / "one.zip").take(scene, job_of(tmp_path / "again", 1))
    taken = read_solution(tmp_path / "again" / "solution")
    for one, other in ((taken.displacement, moving), (taken.velocity, 1e5 * moving)):
        off = np.abs(one - other).max(axis=(1, 2))
        assert (off <= 2.0**-21 * np.abs(other).max(axis=(1, 2))).all()
        assert off[0] > 0.0
    assert taken.acceleration is None  # no factor of a crack is asked


def test_a_bundle_of_the_schema_before_is_refused(scene, kept, tmp_path):
    """With what to do: nothing published has it."""
    write_bundle(tmp_path / "new.zip", [scene], kept)
    with (
        zipfile.ZipFile(tmp_path / "new.zip") as new,
        zipfile.ZipFile(tmp_path / "old.zip", "w") as old,
    ):
        contents = json.loads(new.read("bundle.json"))
        old.writestr("bundle.json", json.dumps(contents | {"schema": 2}))
    with pytest.raises(InputError, match="schema 2; expected 3, as `verify cache export`"):
        ReferenceBundle(tmp_path / "old.zip")


def test_a_damaged_bundle_is_found_before_anything_runs(scene, kept, tmp_path):
    write_bundle(tmp_path / "one.zip", [scene], kept)
    key = kept.find(scene)[1].key
    name = f"{key}.xz"
    with (
        zipfile.ZipFile(tmp_path / "one.zip") as good,
        zipfile.ZipFile(tmp_path / "bad.zip", "w") as bad,
    ):
        for member in good.namelist():
            data = good.read(member)
            bad.writestr(member, data[:-1] if member == name else data)
    with pytest.raises(InputError, match=f"'{name}' is damaged"):
        ReferenceBundle(tmp_path / "bad.zip").levels(scene)
    (tmp_path / "half.zip").write_bytes((tmp_path / "one.zip").read_bytes()[:500])
    with pytest.raises(InputError, match="references"):
        ReferenceBundle(tmp_path / "half.zip")


WITHOUT_FENICSX = """
import sys
class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("dolfinx", "dolfinx_solver", "petsc4py", "gmsh", "mpi4py"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
sys.meta_path.insert(0, Absent())
"""

CUT = """
[[cuts]]
kind = "polyline"
points = [[-0.1, 0.53], [0.5, 0.53]]
[[acceptance]]
check = "error"
metric = "energy_norm"
at_most = 0.9
"""


def test_a_run_judges_by_a_bundle_where_fenicsx_is_not_installed(verify):
    """The same verdict as where the reference was solved, interval and all to six digits."""
    case = (verify.folder / "square.toml").read_text()
    case = case.replace("[[2, 2], [4, 4]]", "[[4, 4]]")
    case = case.split("[exact]")[0].replace('"boundary"', '"bottom"')
    case = case.replace('displacement = "exact"', "displacement = [0.0, 0.0]")
    case += '[[loads]]\nkind = "traction"\nwhere = "top"\ntraction = [0.0, 0.1]\n'
    (verify.folder / "square.toml").write_text(case + "[reference]\nsize = 0.3\n" + CUT)
    command = ("run", "square.toml", "--solver", "xfem", "--out")
    here = {"VERIFY_CACHE": str(verify.folder / "cache")}
    first = verify(*command, "first", **here)
    assert first.returncode == 0, first.stderr
    listed = json.loads(verify("cache", "list", "--json", **here).stdout)
    assert [entry["level"] for entry in listed["entries"]] == [0, 1, 2]
    assert verify("cache", "export", "r.zip", "square.toml", **here).returncode == 0

    absent = verify.folder / "absent"
    absent.mkdir()
    (absent / "sitecustomize.py").write_text(WITHOUT_FENICSX)
    paths = os.pathsep.join([str(absent), verify.environment["PYTHONPATH"]])
    elsewhere = {"VERIFY_CACHE": str(verify.folder / "other"), "PYTHONPATH": paths}
    blind = verify(*command, "blind", **elsewhere)
    assert blind.returncode == 3
    assert "installed" in blind.stderr
    second = verify(*command, "second", "--references", "r.zip", **elsewhere)
    assert second.returncode == 0, second.stderr
    results = [verify.folder / out / "cases/square/result.json" for out in ("first", "second")]
    one, two = (json.loads(file.read_text())["verdicts"] for file in results)
    for here_judged, there_judged in zip(one, two, strict=True):
        for name, value in here_judged.items():
            rounded = pytest.approx(value, rel=1e-6) if isinstance(value, float) else value
            assert there_judged[name] == rounded, name
    assert one[0]["verdict"] == "PASS"

    assert verify("cache", "clear", "square", **here).stdout == "3 references removed\n"
    nothing = verify("cache", "clear", "square", **here)
    assert (nothing.returncode, "nothing is kept for square" in nothing.stderr) == (2, True)


def test_the_bundle_beside_a_case_judges_until_the_case_changes(scene, kept, tmp_path):
    assert references.bundle_of_case(scene) is None
    beside = tmp_path / "references" / "square.zip"
    beside.parent.mkdir()
    write_bundle(beside, [scene], kept)
    bundle = references.bundle_of_case(scene)
    assert bundle is not None
    assert bundle.levels(scene) == LEVELS
    directory = RunDirectory(tmp_path / "run")
    options = Options(solvers=("uncut",), cache=kept.root)
    plan = plan_case(scene, options, {}, directory)
    assert plan.bundle is not None
    assert plan.job_of("reference", 2).key == bundle.key(scene, 2)
    assert plan_case(scene, replace(options, cache=None), {}, directory).bundle is None  # solved
    other = replace(options, parameters={"reference": {"opening": "late"}})
    assert plan_case(scene, other, {}, directory).bundle is None  # other than the stored ones
    scene.file.write_text(scene.file.read_text().replace("young = 1.0", "young = 2.0"))
    assert references.bundle_of_case(load_scene(scene.file)) is None
    beside.write_text("no bundle")
    with pytest.raises(InputError, match="not a bundle"):
        references.bundle_of_case(scene)
