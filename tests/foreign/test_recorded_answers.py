"""Recorded answers of Kratos and Akantu, judged again as imported solutions and made again."""

import json
from pathlib import Path

import numpy as np
import pytest

from verify.cli import main
from verify.exchange import read_answers
from verify.foreign import foreign_solver, state_of
from verify.scene import load_scene
from verify.solvers import find_solver

RECORDED = Path(__file__).parent / "recorded"
CASE = "statics/f1_patch"
CODES = ("kratos", "akantu")


@pytest.mark.parametrize("name", CODES)
def test_a_recorded_answer_passes_its_case_again(name, tmp_path, capsys):
    out = tmp_path / "run"
    words = ["import", CASE, str(RECORDED / name / "f1_patch"), "--solver", f"{name}-recorded"]
    assert main([*words, "--out", str(out)]) == 0
    assert "PASS" in capsys.readouterr().out
    (case,) = json.loads((out / "results.json").read_text())["cases"]
    verdicts = [v for v in case["result"]["verdicts"] if v["solver"] == f"{name}-recorded"]
    assert verdicts
    assert all(verdict["verdict"] == "PASS" for verdict in verdicts)
    for solve in case["result"]["solves"]:
        errors = {metric["name"]: metric["value"] for metric in solve["metrics"]}
        if solve["solver"] == f"{name}-recorded":
            assert errors["energy_norm"] < 1e-13  # a patch test on a cut: linear on each side


@pytest.mark.heavy
@pytest.mark.parametrize("name", CODES)
def test_the_live_program_makes_the_recorded_answer_again(name):
    if missing := state_of(foreign_solver(name)).missing:
        pytest.skip(missing)
    scene = load_scene(CASE)
    recorded = read_answers(scene, RECORDED / name / "f1_patch").solutions
    for level, answer in recorded.items():
        live = find_solver(name).solve(scene, level, repetitions=1)
        np.testing.assert_array_equal(live.cells, answer.cells)
        np.testing.assert_allclose(live.displacement, answer.displacement, atol=1e-15)
