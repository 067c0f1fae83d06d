"""Costs that are expected of a case before anything is solved."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import catalogue

from verify.cli import main
from verify.cli.run_text import costs_of, suites_line
from verify.result import REFERENCE, SolveRecord, Status
from verify.runner.cost import (
    case_cost,
    coarser_reference,
    finer_costs,
    forecast_text,
    mesh_of_level,
    solver_costs,
)
from verify.runner.directory import RunDirectory
from verify.runner.plan import late_levels, plan_case
from verify.runner.selection import Options
from verify.runner.work import Work
from verify.scene import ToolPathCut
from verify.solvers.body_of_scene import background_mesh

SCENES = {name: rows[0] for name, rows in catalogue().items()}


@pytest.mark.parametrize("name", ["cutting/hanging_block_quick", "benchmark/c3_strip"])
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


def test_a_step_of_the_reference_s_own_is_in_its_forecast():
    scene = SCENES["cutting/plate_crossed_quick"]
    assert 4 * scene.reference.time_step == scene.analysis.time_step
    levels = scene.reference.model_copy(update={"time_step": None})
    plain = scene.model_copy(update={"reference": levels})
    own, asked = (solver_costs(s, "reference")[2].seconds for s in (scene, plain))
    assert 2.5 < own / asked < 4.1  # the process and its mesh take a part
    xfem = [solver_costs(s, "xfem")[-1].seconds for s in (scene, plain)]
    assert xfem[0] == xfem[1]


@pytest.mark.parametrize(
    "name, found",  # unknowns of the references of published runs, coarse to fine
    [
        ("statics/tissue_strip", [8944, 34388, 133698]),
        ("meeting/three_through_a_point", [4390, 15594, 56648]),
        ("cutting/hanging_block_quick", [9195, 39189, 208980]),
        ("dynamics/plate_cut_vibrating", [252, 1822, 7184]),
    ],
)
def test_unknowns_of_a_reference_lie_in_the_range_that_is_said(name, found):
    for row, unknowns in zip(solver_costs(SCENES[name], "reference"), found, strict=True):
        assert row.unknowns < unknowns < row.at_most


# unknowns and wall seconds of the references of a run of the quick cases, coarse to fine
RECORDED = {
    "controls/cantilever": [(138, 0.62), (1074, 1.08), (3986, 2.26)],
    "controls/hanging_bar": [(861, 0.71), (2568, 0.69), (22071, 1.44)],
    "curved/s_shape": [(1686, 2.57), (5366, 3.41), (19310, 4.55)],
    "cutting/hanging_block_quick": [(1836, 3.01), (5142, 20.7), (17664, 177.1)],
    "cutting/plate_crossed_quick": [(1420, 1.49), (3150, 5.52), (7710, 15.1)],
    "cutting/triangle": [(30, 0.57), (80, 0.82), (252, 1.43), (884, 4.16)],
    "dynamics/block_falls_apart": [(1383, 1.04), (6657, 3.58), (63738, 75.5)],
    "dynamics/cantilever_release": [(1432, 1.18), (5356, 3.01), (18866, 15.8)],
    "dynamics/freed_half": [(1554, 2.17), (5422, 5.23), (20362, 30.1)],
    "dynamics/plate_cut_vibrating": [(252, 0.8), (1822, 2.31), (7184, 10.8)],
    "dynamics/two_cuts_in_turn": [(166, 0.9), (524, 1.29), (1722, 3.46)],
    "material/layered_sleeve": [(4166, 0.71), (16010, 0.86), (62738, 1.59)],
    "material/organ_with_nodule": [(3354, 0.54), (13010, 0.72), (51234, 1.27)],
    "meeting/branch": [(3168, 1.06), (13382, 1.25), (52474, 2.26)],
    "meeting/crossing": [(3418, 1.13), (12278, 1.57), (45230, 2.43)],
    "meeting/edges_vertices_corner": [(13508, 1.45), (51360, 1.88), (200182, 4.63)],
    "meeting/parallel_tenth": [(12806, 1.17), (42684, 1.81), (140528, 3.76)],
    "meeting/three_through_a_point": [(4390, 2.25), (15594, 3.01), (56648, 4.38)],
    "rotation/stretched_halves": [(260, 0.59), (936, 0.57), (3248, 0.67)],
    "benchmark/c3_strip": [(4802, 1.59), (19138, 2.94), (74936, 9.0)],
    "rotation/turned_apart": [(286, 0.97), (1250, 1.16), (4562, 1.54)],
    "rotation/turned_apart_solid": [(222, 1.18), (441, 1.0), (4233, 2.61)],
    "statics/griffith_edges": [(11048, 0.8), (43536, 1.28), (172608, 3.82)],
    "statics/membrane_catenary": [(1080, 1.86), (3690, 3.91), (13518, 11.8)],
    "statics/membrane_halves": [(156, 0.71), (486, 0.48), (1686, 0.68)],
    "statics/tissue_strip": [(8944, 0.96), (34388, 1.64), (133698, 3.51)],
}


def solved(case, level, unknowns, wall):
    return SolveRecord(case, "reference", level, Status.SOLVED, unknowns=unknowns, wall=wall)


def test_finer_levels_are_forecast_within_a_factor_of_three():
    """In nine of ten cases, from level 0 alone; and a priori in three of four."""
    shares, before = [], []
    for case, rows in RECORDED.items():
        finer = finer_costs(SCENES[case], solved(case, 0, *rows[0]), len(rows))
        shares.append(sum(row.seconds for row in finer) / sum(wall for _, wall in rows[1:]))
        costs = solver_costs(SCENES[case], "reference")
        before.append(sum(row.seconds for row in costs[:3]) / sum(wall for _, wall in rows[:3]))
    assert len(shares) > 25
    assert np.mean(np.abs(np.log(shares)) < np.log(3.0)) >= 0.9
    assert np.mean(np.abs(np.log(before)) < np.log(3.0)) >= 0.75
    assert 0.5 < np.median(before) < 2.0


def test_a_slower_machine_is_told_from_the_level_that_is_solved():
    case = "cutting/hanging_block_quick"
    unknowns, wall = RECORDED[case][0]
    own, slow = (
        finer_costs(SCENES[case], solved(case, 0, unknowns, times * wall), 3) for times in (1, 10)
    )
    assert 5.0 < slow[1].seconds / own[1].seconds < 12.0
    assert slow[1].memory == own[1].memory


def test_what_will_not_end_is_said_with_what_to_change():
    scene, case = SCENES["cutting/hanging_block_quick"], "cutting/hanging_block_quick"
    finer = finer_costs(scene, solved(case, 0, *RECORDED[case][0]), 3)
    calm = forecast_text(scene, finer, 3600.0, 1e12)
    assert calm.startswith("level 1 in about ")
    assert "not end" not in calm
    said = forecast_text(scene, finer, 10.0, 1e12)
    size = 4 * (scene.reference.size or np.nan)
    assert f"level 1 may not end within 10 s (--timeout); expected 'size = {size:.3g}'" in said
    assert "level 1 may not end within 1 MB (--memory), with about" in forecast_text(
        scene, finer, 3600.0, 1e6
    )


def test_within_asks_for_larger_elements_and_leaves_a_given_mesh():
    scene = SCENES["cutting/hanging_block_quick"]
    whole = sum(row.seconds for row in solver_costs(scene, "reference"))
    assert coarser_reference(scene, 1.1 * whole) == (scene, 1)
    coarse, times = coarser_reference(scene, 0.2 * whole)
    assert times == 2
    assert coarse.reference.size == 2 * scene.reference.size
    assert coarse.reference.levels == scene.reference.levels
    assert coarser_reference(scene, 1e-3)[1] == 8
    given = SCENES["material/organ_with_nodule"]
    assert coarser_reference(given, 1e-3) == (given, 1)


def test_levels_that_end_too_late_are_left_out_by_what_the_others_took(tmp_path):
    """Never without being asked; with a bundle of solved references nothing is."""
    case = "dynamics/block_falls_apart"
    asked = Options(solvers=("uncut",), within=20.0)
    plan = plan_case(SCENES[case], asked, {}, RunDirectory(tmp_path))
    levels = [plan.job_of("reference", level) for level in range(3)]
    records = [solved(case, k, *RECORDED[case][k]) for k in range(2)]
    assert late_levels(plan, levels[0], records[:1], levels[1:])[0][0] == levels[2]
    for solves, waiting in ((records[:1], levels[1:]), (records, levels[2:])):
        ((job, record),) = late_levels(plan, levels[len(solves) - 1], solves, waiting)
        assert job == levels[2]
        assert record.status is Status.REFUSED
        assert "--within asks for 20 s" in record.reason
    quick = [replace(one, wall=0.1 * one.wall) for one in records]
    assert not late_levels(plan, levels[1], quick, levels[2:])
    assert not late_levels(plan, levels[0], [], levels)
    unasked = plan_case(SCENES[case], replace(asked, within=None), {}, RunDirectory(tmp_path))
    own = [unasked.job_of("reference", level) for level in range(3)]
    assert not late_levels(unasked, own[0], records[:1], own[1:])
    stored = plan_case(SCENES[case], replace(asked, cache=tmp_path), {}, RunDirectory(tmp_path))
    assert stored.bundle is not None
    assert stored.within is None


def test_the_smallest_suite_comes_first():
    every = [scene for rows in catalogue().values() for scene in rows]
    costs = [(scene, case_cost(scene, ("xfem",))) for scene in every]
    said = suites_line(costs, jobs=2)
    assert said.index("-k demo") < said.index("--quick")
    assert f"{sum('demo' in scene.tags for scene in every)} cases" in said
    assert suites_line([], jobs=2) == ""


def test_a_reference_that_comes_with_its_case_costs_nothing_unless_it_is_to_be_solved() -> None:
    """Its solve alone takes an hour: a forecast of the demo says what a run of it does."""
    scene = SCENES["cutting/hanging_block_quick"]
    for cache in (Path("anywhere"), None):
        rows = costs_of(scene, Options(cache=cache))
        assert (REFERENCE in {row.solver for row in rows}) is (cache is None)


def test_check_says_the_cost_and_warns_in_one_line_of_a_mesh_that_no_machine_holds(
    tmp_path, case_text, capsys
):
    file = tmp_path / "case.toml"
    file.write_text(case_text)
    assert main(["check", str(file)]) == 0
    said = capsys.readouterr()
    assert ("unknowns" in said.out, said.err) == (True, "")
    assert main(["check", "--json", str(file)]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["cost"][0]["solver"], row["cost"][0]["unknowns"] > 0) == ("xfem", True)
    assert "cells = [[2, 2], [4, 4]]" in case_text
    file.write_text(case_text.replace("cells = [[2, 2], [4, 4]]", "sizes = [0.5, 2e-5]"))
    assert main(["check", str(file)]) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "warning: level 1 of xfem would take about 1.25e+04 GB" in line


def test_a_reference_with_larger_elements_than_asked_says_so_and_no_other_solve_does(tmp_path):
    case = "dynamics/block_falls_apart"
    told = {}
    for within in (1.0, 1e6):
        options = Options(solvers=("uncut",), within=within)
        plan = plan_case(SCENES[case], options, {}, RunDirectory(tmp_path))
        work = SimpleNamespace(plans={case: plan}, options=options, memory=1e12)
        for solver in ("uncut", "reference"):
            record = solved(case, 0, *RECORDED[case][0])
            Work._note_forecast(work, plan.job_of(solver, 0), record)
            told[solver, within] = record.notes.get("within", "")
        assert (plan.coarser > 1) == (within == 1.0)
    assert "as large as the case asks: --within 1" in told.pop(("reference", 1.0))
    assert not any(told.values())
