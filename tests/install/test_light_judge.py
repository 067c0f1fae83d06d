"""The judge alone: bundles of references judge without FEniCSx, gmsh, VTK, numba or a compiler."""

import json
import os
import subprocess
import sys
import venv
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import pytest

from verify.runner.directory import Job
from verify.runner.references import BESIDE, bundle_of_case
from verify.scene import case_folder, load_scene
from verify.solution import read_solution, write_solution

FORBIDDEN = ("numba", "llvmlite", "pyvista", "vtkmodules", "gmsh", "dolfinx", "petsc4py", "mpi4py")
CASES = [
    str((path.parent.parent / path.stem).relative_to(case_folder()))
    for path in sorted(case_folder().rglob(f"{BESIDE}/*.zip"))
]


def answers_of_another(case, folder, factor=1.0):
    """Write what another program could have answered: the coarse levels of the reference."""
    scene = load_scene(case)
    bundle = bundle_of_case(scene)
    for level in range(scene.mesh.count):
        place = folder / f"level-{level}"
        place.mkdir(parents=True)
        bundle.take(scene, Job(scene.name, "reference", level, 1, "any", place))
        answer = read_solution(place / "solution")
        write_solution(
            replace(answer, displacement=factor * answer.displacement), place / "solution"
        )


def verdicts(python, environment, case, answers, out):
    asked = [python, "-m", "verify", "import", case, answers]
    done = subprocess.run(
        [*asked, "--solver", "mine", "--out", out, "--json"],
        env={**os.environ, **environment, "VERIFY_CACHE": str(out.parent / "cache")},
        cwd=out.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout, done.stderr
    answer = json.loads(done.stdout)
    return {one["metric"]: one["verdict"] for one in answer["cases"][0]["verdicts"]}, answer[
        "report"
    ]


def test_a_folder_of_answers_is_judged_where_only_numpy_and_scipy_are(tmp_path, root):
    """The check is of the displacement, at most 18 % wrong: the answer passes, 1.3 of it fails."""
    (tmp_path / "sitecustomize.py").write_text(
        f"import sys\nsys.modules.update(dict.fromkeys({FORBIDDEN}))\n"
    )
    environment = {"PYTHONPATH": f"{tmp_path}{os.pathsep}{root}"}
    case, found = "cutting/plate_crossed_quick", {}
    for name, factor in (("right", 1.0), ("wrong", 1.3)):
        answers_of_another(case, tmp_path / name, factor)
        found[name], report = verdicts(
            sys.executable, environment, case, tmp_path / name, tmp_path / f"out-{name}"
        )
        assert "<svg" in Path(report).read_text()
    assert found["right"]["displacement_l2"] == "PASS"
    assert found["wrong"]["displacement_l2"] == "FAIL"


@pytest.mark.heavy
def test_an_environment_of_pip_install_is_small_and_judges_every_bundle(tmp_path, root):
    """At most 350 MB with pip itself and what its use has compiled, and 60 s for each scene."""
    place = tmp_path / "venv"
    venv.create(place, with_pip=True)
    python = str(place / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "-q", "--no-compile", str(root)], check=True)
    for name in FORBIDDEN:
        assert subprocess.run([python, "-c", f"import {name}"], capture_output=True).returncode
    for case in CASES:
        folder = tmp_path / case.replace("/", "__")
        answers_of_another(case, folder / "answers")
        start = perf_counter()
        found, _ = verdicts(python, {"PYTHONPATH": ""}, case, folder / "answers", folder / "out")
        print(f"{case}: {perf_counter() - start:.1f} s, {found}")
        assert "ERROR" not in found.values()
        assert perf_counter() - start < 60.0
    size = size_of(place)
    print(f"{size / 1e6:.0f} MB")
    assert size < 350e6


def size_of(folder):
    """Bytes of all files in a folder."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if path.is_file())
