"""Recorded motions of ngsxfem without a ghost penalty: on the same cut `xfem` moves alike.

Two programs with their own cut quadrature, mass and trapezoidal rule. What is recorded is the L2
norm of displacement and velocity at every output. The live program makes the record again (heavy).
"""

import json
from math import factorial
from pathlib import Path

import numpy as np
import pytest

from verify.foreign import foreign_solver, state_of
from verify.scene import load_scene
from verify.solvers import find_solver

RECORD = Path(__file__).with_name("recorded_motion.json")
RECORDED = json.loads(RECORD.read_text(encoding="utf-8"))
DIGITS = 1e-8  # of the largest; hundreds of steps, each with 1e-13 of a factorisation
IDS = [one["case"].split("/")[1] for one in RECORDED]


def norms(name, case, **parameters):
    scene = load_scene(case)
    solution = find_solver(name).solve(scene, 0, repetitions=1, **parameters)
    corners, d = solution.points[solution.cells], scene.dimension
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / factorial(d)
    found = {}
    for field in ("displacement", "velocity"):
        values = getattr(solution, field)[:, solution.cells]
        squares = (values.sum(axis=2) ** 2).sum(axis=2) + (values**2).sum(axis=(2, 3))
        found[field] = np.sqrt(squares @ volume / ((d + 1) * (d + 2)))
    return found


def assert_recorded(found, one):
    for field, values in found.items():
        off = np.abs(values - one[field]).max()
        assert off <= DIGITS * np.max(one[field]), field


@pytest.mark.parametrize("one", RECORDED, ids=IDS)
def test_xfem_moves_as_another_code(one):
    assert_recorded(norms("xfem", one["case"], tip="nearest", mass="consistent"), one)


@pytest.mark.heavy
@pytest.mark.parametrize("one", RECORDED, ids=IDS)
def test_the_live_program_makes_its_recorded_motion_again(one):
    if missing := state_of(foreign_solver("ngsxfem")).missing:
        pytest.skip(missing)
    assert_recorded(norms("ngsxfem", one["case"], ghost=0.0), one)
