"""Running what a test writes down on some MPI ranks, in processes of their own."""

import pickle
import subprocess
import sys
from pathlib import Path

import pytest

from verify.errors import InputError
from verify.runner.ranks import mpiexec

_BEFORE = """
import pickle, sys
sys.path[:0] = {tests!r}
from reference.dolfinx_versions import import_dolfinx
import_dolfinx()
import numpy as np
from mpi4py import MPI
world = MPI.COMM_WORLD
"""
_AFTER = """
if world.rank == 0:
    with open({out!r}, "wb") as file:
        pickle.dump((world.size, answer), file)
"""


def on_ranks(count, code, folder):
    """Give the `answer` that `code` finds on the first of `count` ranks, called `world` there."""
    try:
        launcher = mpiexec()
    except InputError as error:
        pytest.skip(str(error))
    out = folder / f"{count}.pickle"
    here = Path(__file__).parent
    before = _BEFORE.format(tests=[str(here), str(here.parent)])
    done = subprocess.run(
        [launcher, "-n", str(count), sys.executable, "-c",
         f"{before}\n{code}\n{_AFTER.format(out=str(out))}"],
        capture_output=True,
        text=True,
        cwd=Path(__file__).parents[2],
        check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    size, answer = pickle.loads(out.read_bytes())
    assert size == count
    return answer
