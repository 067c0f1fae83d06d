"""Foreign solvers that are installed here: conformance, and verdicts on short cases."""

import subprocess
import sys

import pytest

from verify.conformance import conform, exit_code_of
from verify.conformance.check import State
from verify.foreign import foreign_solvers, state_of

pytestmark = pytest.mark.heavy


@pytest.fixture(params=sorted(foreign_solvers()))
def solver(request):
    state = state_of(foreign_solvers()[request.param])
    if not state.python:
        pytest.skip(f"{request.param} is not installed: {state.missing}")
    return request.param


def test_an_installed_solver_keeps_what_it_does_not_refuse(solver):
    results = conform(solver, timeout=300.0)
    wrong = [r for r in results if r.state in (State.FAIL, State.ERROR)]
    assert exit_code_of(results) in (0, 4), wrong


def test_an_installed_solver_passes_the_patch_test(solver, tmp_path):
    words = ["run", "statics/f1_patch", "--solver", solver, "--repetitions", "1", "--no-conform"]
    call = [sys.executable, "-m", "verify", *words, "--out", str(tmp_path / "run"), "--no-report"]
    done = subprocess.run(call, capture_output=True, text=True, timeout=600)
    assert done.returncode in (0, 4), done.stdout
