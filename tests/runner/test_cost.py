"""Costs that are expected of a case before anything is solved."""

import json

import pytest
from scenes import catalogue

from verify.cli import main
from verify.cli.run_text import suites_line
from verify.runner.cost import case_cost, mesh_of_level, solver_costs
from verify.scene import ToolPathCut
from verify.solvers.body_of_scene import background_mesh

STRUCTURED = ["statics/f1_patch", "controls/hanging_bar", "cutting/hanging_block_quick"]
SCENES = {name: rows[0] for name, rows in catalogue().items()}


@pytest.mark.parametrize("name", [*STRUCTURED, "rotation/tissue_strip"])
def test_unknowns_are_those_of_the_uncut_mesh(name):
    scene = SCENES[name]
    for row in solver_costs(scene, "xfem"):
        mesh, _ = background_mesh(scene, row.level)
        assert row.unknowns == mesh.points.size


def test_finer_levels_of_every_case_cost_more():
    """Every case that solvers are asked is estimated, whatever its body and its analysis."""
    for name, scene in SCENES.items():
        if scene.played_only:
            continue
        for solver in ("xfem", "conforming", "reference"):
            rows = solver_costs(scene, solver)
            assert rows, name
            for key in ("unknowns", "seconds", "memory"):
                found = [getattr(row, key) for row in rows]
                assert found == sorted(found), (name, solver, key)
                assert found[0] > 0


def test_no_blade_of_a_judged_scene_goes_farther_than_half_an_element_in_a_step():
    """Else the openings are late, whatever the rule."""
    found = {}
    for name, scene in SCENES.items():
        speeds = [cut.top_speed for cut in scene.cuts if isinstance(cut, ToolPathCut)]
        finest = None if scene.played_only else mesh_of_level(scene, scene.mesh.count - 1)
        if speeds and scene.acceptance and scene.analysis.time_step and finest:
            found[name] = max(speeds) * scene.analysis.time_step / finest[1]
    assert len(found) > 10
    assert {name: share for name, share in found.items() if share > 0.5} == {}


def test_a_reference_level_has_the_unknowns_of_halved_elements():
    coarse, fine, finest = solver_costs(SCENES["rotation/tissue_strip"], "reference")
    assert 3.5 < fine.unknowns / coarse.unknowns < 4.0
    assert 3.5 < finest.unknowns / fine.unknowns < 4.0


def test_a_step_of_the_reference_s_own_is_in_its_forecast():
    scene = SCENES["cutting/plate_crossed_quick"]
    assert 4 * scene.reference.time_step == scene.analysis.time_step
    levels = scene.reference.model_copy(update={"time_step": None})
    plain = scene.model_copy(update={"reference": levels})
    own, asked = (solver_costs(s, "reference")[2].seconds for s in (scene, plain))
    assert 3.0 < own / asked < 4.1
    xfem = [solver_costs(s, "xfem")[-1].seconds for s in (scene, plain)]
    assert xfem[0] == xfem[1]


@pytest.mark.parametrize(
    "name, found",  # unknowns of the references of published runs, coarse to fine
    [
        ("statics/tissue_strip", [8944, 34388, 133698]),
        ("meeting/three_through_a_point", [4390, 15594, 56648]),
        ("cutting/hanging_block_quick", [1836, 5142, 17664]),
        ("dynamics/plate_cut_vibrating", [252, 1822, 7184]),
    ],
)
def test_unknowns_of_a_reference_lie_in_the_range_that_is_said(name, found):
    for row, unknowns in zip(solver_costs(SCENES[name], "reference"), found, strict=True):
        assert row.unknowns < unknowns < row.at_most


def test_the_smallest_suite_comes_first():
    every = [scene for rows in catalogue().values() for scene in rows]
    costs = [(scene, case_cost(scene, ("xfem",))) for scene in every]
    said = suites_line(costs, jobs=2)
    assert said.index("-k demo") < said.index("--quick")
    assert f"{sum('demo' in scene.tags for scene in every)} cases" in said
    assert suites_line([], jobs=2) == ""


def test_a_mesh_that_no_machine_holds_is_warned_of_in_one_line(tmp_path, case_text, capsys):
    file = tmp_path / "case.toml"
    file.write_text(case_text)
    assert main(["check", str(file)]) == 0
    assert capsys.readouterr().err == ""
    assert "cells = [[2, 2], [4, 4]]" in case_text
    file.write_text(case_text.replace("cells = [[2, 2], [4, 4]]", "sizes = [0.5, 2e-5]"))
    assert main(["check", str(file)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "warning: level 1 of xfem would take about 1.25e+04 GB" in line


def test_the_command_says_it_of_a_file(tmp_path, case_text, capsys):
    (tmp_path / "case.toml").write_text(case_text)
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    assert "unknowns" in capsys.readouterr().out
    assert main(["check", "--json", str(tmp_path / "case.toml")]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert row["cost"][0]["solver"] == "xfem"
    assert row["cost"][0]["unknowns"] > 0
