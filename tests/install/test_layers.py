"""The layers point one way: the import contracts of pyproject.toml hold, and they bite."""

import os
import shutil
import subprocess
import sys

import pytest

LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"


def lint(place):
    return subprocess.run(
        [sys.executable, "-c", LINT, "--no-cache"],
        cwd=place,
        env=os.environ | {"PYTHONPATH": str(place), "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=120,
    )


@pytest.fixture
def copy(root, tmp_path):
    for package in ("verify", "reference"):
        shutil.copytree(
            root / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__")
        )
    shutil.copy(root / "pyproject.toml", tmp_path)
    return tmp_path


def test_every_contract_is_kept(root):
    done = lint(root)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("place", "statement", "contract"),
    [
        ("verify/xfem", "import reference", "The compact solvers share no code"),
        ("reference", "import verify.xfem", "The reference shares no code"),
        ("verify/compare", "import verify.solvers", "No solver grades itself"),
        ("verify/report", "import verify.compare", "The report reads results"),
    ],
)
def test_a_forbidden_import_is_caught(copy, place, statement, contract):
    (copy / place / "trespasser.py").write_text(statement + "\n")
    done = lint(copy)
    assert done.returncode == 1, done.stdout
    (broken,) = [line for line in done.stdout.splitlines() if contract in line and "BROKEN" in line]
    assert broken.startswith(contract)
