"""Recorded answers of ngsxfem and GetFEM: `xfem` gives them where the realised cut is the same.

Without a ghost penalty all three are the method of Hansbo and Hansbo with linear elements. What is
recorded is the strain energy and the L2 norm of the displacement, so that the errors against any
exact solution agree as far as these do. The live programs make the record again (heavy).
"""

import json
from math import factorial
from pathlib import Path

import numpy as np
import pytest

from verify.compare.hooke import hooke
from verify.compare.strain_energy import strain_energy
from verify.foreign import foreign_solver, state_of
from verify.scene import load_scene
from verify.solvers import find_solver

RECORD = Path(__file__).with_name("recorded_answers.json")
RECORDED = json.loads(RECORD.read_text(encoding="utf-8")) if RECORD.is_file() else []
DIGITS = 1e-9  # relative; the direct solvers leave 1e-13, the condition of the slivers the rest
IDS = [f"{one['solver']}-{one['case']}-{one['level']}" for one in RECORDED]


def measured(name, case, level, **parameters):
    scene = load_scene(case)
    solution = find_solver(name).solve(scene, level, repetitions=1, **parameters)
    corners, u = solution.points[solution.cells], solution.displacement[-1][solution.cells]
    d = scene.dimension
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / factorial(d)
    squares = (u.sum(axis=1) ** 2).sum(axis=1) + (u**2).sum(axis=(1, 2))
    norm = np.sqrt(volume @ squares / ((d + 1) * (d + 2)))
    return {"strain_energy": strain_energy(solution, hooke(scene.material)), "norm": float(norm)}


@pytest.mark.parametrize("one", RECORDED, ids=IDS)
def test_xfem_gives_the_answer_of_another_code(one):
    found = measured("xfem", one["case"], one["level"], tip=one["tip"])
    for name, value in found.items():
        assert value == pytest.approx(one[name], rel=DIGITS), name


@pytest.mark.heavy
@pytest.mark.parametrize("one", RECORDED, ids=IDS)
def test_the_live_program_gives_its_recorded_answer(one):
    state = state_of(foreign_solver(one["solver"]))
    if not state.python:
        pytest.skip(f"{one['solver']} is not installed: {state.missing}")
    found = measured(one["solver"], one["case"], one["level"], **one["parameters"])
    for name, value in found.items():
        assert value == pytest.approx(one[name], rel=DIGITS), name


@pytest.mark.heavy
@pytest.mark.skipif(
    bool(state_of(foreign_solver("ngsxfem")).missing), reason="ngsxfem is not installed"
)
@pytest.mark.parametrize(
    "case",
    ["statics/griffith_inside", "meeting/edges_vertices_corner", "dynamics/plate_cut_vibrating",
     "dynamics/block_falls_apart"],
)  # fmt: skip
def test_enriched_nodal_values_and_values_of_both_sides_are_one_space(case):
    """ngsxfem's XFESpace and its CutFEM without a ghost penalty: in the plane, in space, moving."""
    scene = load_scene(case)
    sides, enriched = (
        find_solver("ngsxfem").solve(scene, 0, ghost=0, space=space) for space in ("copies", "xfe")
    )
    scale = np.abs(sides.displacement).max()
    assert enriched.notes["method"] != sides.notes["method"]
    assert np.abs(enriched.displacement - sides.displacement).max() <= DIGITS * scale
