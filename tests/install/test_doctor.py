"""The doctor tries things; what does not work is named with what brings it."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

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


def test_the_doctor_and_the_set_up_name_the_same_packages():
    place = ROOT / ".ci/system_requirements.py"
    specification = importlib.util.spec_from_file_location("requirements_of_ci", place)
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    assert {name: p for name, (p, _) in module.LIBRARIES.items()} == doctor.DEBIAN_PACKAGES
