"""Fingerprints of solvers: what an answer depends on makes it be solved again, and nothing else."""

from pathlib import Path

import pytest
import scenes

from verify.runner import fingerprint


@pytest.fixture
def read(monkeypatch):
    """Return the files that went into the fingerprint of a solver."""

    def files(name):
        seen = []
        own = fingerprint.file_digest
        monkeypatch.setattr(fingerprint, "file_digest", lambda path: seen.append(path) or own(path))
        fingerprint.code_of_solver.__wrapped__(name)
        monkeypatch.undo()
        package = Path(fingerprint.__file__).parents[1]
        return {path.relative_to(package.parent).as_posix() for path in seen}

    return files


def test_a_program_that_changes_is_run_again(read):
    """A stored answer of Kratos is not that of another program, nor of other versions of it."""
    folder = "verify/foreign/programs"
    asked = {f"{folder}/kratos/{n}" for n in ("program.py", "solver.toml", "requirements.lock")}
    assert asked | {f"{folder}/motion.py", "verify/exchange/export.py"} <= read("kratos")
    assert not {path for path in read("xfem") if "foreign" in path}


def test_what_makes_a_solver_fast_can_change_its_answer(read):
    assert "verify/accelerated/cholesky.py" in read("xfem")
    assert "verify/accelerated/cholesky.py" not in read("conforming")


def test_what_a_case_expects_of_a_cut_is_no_physics():
    """A reference is found again when the word changes, and not when the cut does."""
    cut = {"kind": "polyline", "points": [[-0.1, 0.5], [0.5, 0.52]]}
    given = [cut, {**cut, "expected": "edge"}, {**cut, "points": [[-0.1, 0.5], [0.5, 0.53]]}]
    plain, expecting, other = (fingerprint.physics_digest(scenes.scene([one])) for one in given)
    assert plain == expecting != other
