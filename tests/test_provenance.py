"""Provenance of a number: true of this machine, and found without loading a solver."""

import subprocess
import sys
from pathlib import Path

import pytest

import verify
from verify import provenance as module
from verify.provenance import provenance, versions

ROOT = Path(verify.__file__).parent.parent


def git(*arguments):
    return subprocess.run(
        ["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=True
    )


@pytest.mark.skipif(not (ROOT / ".git").exists(), reason="not a checkout")
def test_the_commit_is_that_of_the_checkout():
    origin = provenance()
    assert origin["commit"] == git("rev-parse", "HEAD").stdout.strip()
    assert isinstance(origin["dirty"], bool)


def test_a_repository_that_only_happens_to_be_around_us_is_not_ours(tmp_path, monkeypatch):
    """A virtual environment inside somebody's repository: its commit says nothing of our code."""
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    package = tmp_path / ".venv" / "lib" / "verify" / "__init__.py"
    monkeypatch.setattr(module.verify, "__file__", str(package))
    assert module._commit() in [(None, None)] or module._commit()[1] is False  # pip's own record


def test_versions_are_those_of_the_libraries_and_nothing_is_imported_for_them():
    import numpy

    assert versions()["numpy"] == numpy.__version__
    code = "import sys; from verify.provenance import provenance; provenance(); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert {"numpy", "dolfinx", "petsc4py", "gmsh"}.isdisjoint(loaded.stdout.split())
