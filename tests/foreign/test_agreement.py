"""Recorded answers of other programs: `xfem` gives them where the realised cut is the same.

Without a ghost penalty ngsxfem, GetFEM and `xfem` are the method of Hansbo and Hansbo with linear
elements; in motion two programs have their own cut quadrature, mass and trapezoidal rule. What is
recorded is the strain energy at rest, and the L2 norms of displacement and velocity at every
output, so that the errors against any exact solution agree as far as these do. Answers of Kratos
and Akantu are whole, and judged again. The live programs make the records again (heavy).
"""

import json
from math import factorial
from pathlib import Path

import numpy as np
import pytest
from scenes import undamped

from verify.cli import main
from verify.compare.hooke import hooke, strain_energy
from verify.exchange import read_answers
from verify.foreign import foreign_solver, state_of
from verify.scene import load_scene
from verify.solvers import find_solver

HERE = Path(__file__).parent
AT_REST = json.loads((HERE / "recorded_answers.json").read_text(encoding="utf-8"))
MOVING = json.loads((HERE / "recorded_motion.json").read_text(encoding="utf-8"))
# of the largest: direct solvers leave 1e-13, the condition of slivers and hundreds of steps more
DIGITS = {"rest": 1e-9, "motion": 1e-8}
ANSWERS = [
    *(pytest.param(one, id=f"{one['solver']}-{one['case']}-{one['level']}") for one in AT_REST),
    *(pytest.param(one, id=one["case"].split("/")[1]) for one in MOVING),
]
WHOLE = "statics/f1_patch"


def live(name):
    """Skip where the program is not installed."""
    if missing := state_of(foreign_solver(name)).missing:
        pytest.skip(missing)
    return find_solver(name)


def norms(solution, field):
    """L2 norms of a field of linear elements at every output."""
    corners, d = solution.points[solution.cells], solution.dimension
    volume = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / factorial(d)
    values = getattr(solution, field)[:, solution.cells]
    squares = (values.sum(axis=2) ** 2).sum(axis=2) + (values**2).sum(axis=(2, 3))
    return np.sqrt(squares @ volume / ((d + 1) * (d + 2)))


def assert_recorded(solver, one, **parameters):
    scene = undamped(one["case"]) if "velocity" in one else load_scene(one["case"])
    solution = solver.solve(scene, one.get("level", 0), repetitions=1, **parameters)
    if "velocity" in one:
        for field in ("displacement", "velocity"):
            off = np.abs(norms(solution, field) - one[field]).max()
            assert off <= DIGITS["motion"] * np.max(one[field]), field
        return
    energy = strain_energy(solution, hooke(scene.material))
    assert energy == pytest.approx(one["strain_energy"], rel=DIGITS["rest"])
    (norm,) = norms(solution, "displacement")[-1:]
    assert norm == pytest.approx(one["norm"], rel=DIGITS["rest"])


@pytest.mark.parametrize("one", ANSWERS)
def test_xfem_gives_the_answer_of_another_code(one):
    chosen = {"mass": "consistent"} if "velocity" in one else {}
    assert_recorded(find_solver("xfem"), one, tip=one.get("tip", "nearest"), **chosen)


@pytest.mark.heavy
@pytest.mark.parametrize("one", ANSWERS)
def test_the_live_program_gives_its_recorded_answer(one):
    chosen = {"ghost": 0.0} if "velocity" in one else one["parameters"]
    assert_recorded(live(one.get("solver", "ngsxfem")), one, **chosen)


@pytest.mark.heavy
@pytest.mark.parametrize(
    "case",
    ["statics/griffith_inside", "meeting/edges_vertices_corner", "dynamics/plate_cut_vibrating",
     "dynamics/block_falls_apart"],
)  # fmt: skip
def test_enriched_nodal_values_and_values_of_both_sides_are_one_space(case):
    """ngsxfem's XFESpace and its CutFEM without a ghost penalty: in the plane, in space, moving."""
    scene, solver = load_scene(case), live("ngsxfem")
    sides, enriched = (solver.solve(scene, 0, ghost=0, space=space) for space in ("copies", "xfe"))
    scale = np.abs(sides.displacement).max()
    assert enriched.notes["method"] != sides.notes["method"]
    assert np.abs(enriched.displacement - sides.displacement).max() <= DIGITS["rest"] * scale


@pytest.mark.parametrize("name", ["kratos", "akantu"])
def test_a_whole_recorded_answer_passes_its_case_again(name, tmp_path, capsys):
    out, recorded = tmp_path / "run", f"{name}-recorded"
    words = ["import", WHOLE, str(HERE / "recorded" / name / "f1_patch"), "--solver", recorded]
    assert main([*words, "--out", str(out)]) == 0
    assert "PASS" in capsys.readouterr().out
    (case,) = json.loads((out / "results.json").read_text())["cases"]
    assert {v["verdict"] for v in case["result"]["verdicts"] if v["solver"] == recorded} == {"PASS"}
    for solve in case["result"]["solves"]:
        errors = {metric["name"]: metric["value"] for metric in solve["metrics"]}
        if solve["solver"] == recorded:
            assert errors["energy_norm"] < 1e-13  # a patch test on a cut: linear on each side


@pytest.mark.heavy
@pytest.mark.parametrize("name", ["kratos", "akantu"])
def test_the_live_program_makes_its_whole_recorded_answer_again(name):
    solver, scene = live(name), load_scene(WHOLE)
    recorded = read_answers(scene, HERE / "recorded" / name / "f1_patch").solutions
    for level, answer in recorded.items():
        found = solver.solve(scene, level, repetitions=1)
        np.testing.assert_array_equal(found.cells, answer.cells)
        np.testing.assert_allclose(found.displacement, answer.displacement, atol=1e-15)
