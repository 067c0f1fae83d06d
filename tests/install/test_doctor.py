"""The doctor tries things; what does not work is named with what brings it."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from verify import doctor

ROOT = Path(__file__).resolve().parents[2]


def test_all_that_a_full_run_needs_works_here():
    done = subprocess.run(
        [sys.executable, "-m", "verify", "doctor", "--json"],
        cwd=ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    found = {entry["name"]: entry for entry in json.loads(done.stdout)}
    assert done.returncode == 0, done.stdout
    assert "mumps" in found["PETSc"]["found"]
    assert "gamg" in found["PETSc"]["found"]
    assert {"DOLFINx", "gmsh", "off-screen VTK", "DOLFINx forms", "numba"} <= set(found)


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("raise ModuleNotFoundError(\"No module named 'petsc4py'\")", "No module named 'petsc4py'"),
        ("import os; os.kill(os.getpid(), 11)", "crashes (signal 11)"),
        ("said = 1; raise SystemExit(3)", "exit code 3"),
    ],
)
def test_what_fails_crashes_or_leaves_is_a_finding_with_its_cure(code, said):
    finding = doctor._tried("it", doctor._script(code), "install it")
    assert not finding.works
    assert said in finding.found
    assert finding.cure == "install it"


def test_the_doctor_and_the_set_up_name_the_same_packages():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("requirements_of_ci", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    assert {name: p for name, (p, _) in module.LIBRARIES.items()} == doctor.DEBIAN_PACKAGES
