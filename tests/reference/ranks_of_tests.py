"""Running what a test writes down on two MPI ranks, and on the one that this process is."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from verify.errors import InputError
from verify.runner.ranks import AT_HOME, mpiexec

_ONE = """
from reference.installation import import_dolfinx
import_dolfinx()
import numpy as np
from mpi4py import MPI
world = MPI.COMM_WORLD
"""
_BEFORE = """
import pickle, sys
sys.path[:0] = {tests!r}
"""
_AFTER = """
if world.rank == 0:
    with open({out!r}, "wb") as file:
        pickle.dump((world.size, answer), file)
"""


def on_one_rank_and_two(code, folder):
    """Give the `answer` of `code` in this process and on the first of two ranks, its `world`."""
    here = {}
    exec(_ONE + code, here)
    assert here["world"].size == 1
    return here["answer"], _on_two(code, folder)


def _on_two(code, folder):
    try:
        launcher = mpiexec()
    except InputError as error:
        pytest.skip(str(error))
    out = folder / "answer.pickle"
    here = Path(__file__).parent
    before = _BEFORE.format(tests=[str(here), str(here.parent)]) + _ONE
    done = subprocess.run(
        [launcher, "-n", "2", sys.executable, "-c",
         f"{before}\n{code}\n{_AFTER.format(out=str(out))}"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
        env={**os.environ, **AT_HOME},
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    size, answer = pickle.loads(out.read_bytes())
    assert size == 2
    return answer
