"""Budgets of whole cases, solved here: each source where it belongs, and the cheapest model."""

import numpy as np
import pytest
import scenes

from reference.exact import exact_solution
from verify.result import CaseResult, ReferenceRecord, SolveRecord, Status
from verify.scene import load_scene
from verify.solvers import find_solver
from verify.study.budget import budget_study
from verify.study.study import Solved


def solve(scenes, place, solvers, parameters=None, timed=False):
    """Solve in this process; what a solver cannot do is a record with its reason."""
    found = []
    for scene in scenes:
        records, solutions = [], {}
        for name in solvers:
            solver, given = find_solver(name), (parameters or {}).get(name, {})
            reason = solver.refuses(scene)
            for level in range(1 if reason else solver.levels(scene)):
                record = SolveRecord(scene.name, name, level, Status.SOLVED)
                try:
                    if reason:
                        raise ValueError(reason)
                    solution = solver.solve(scene, level, 1, **given)
                    solutions.setdefault(name, {})[level] = solution
                    record.timings.update(solution.timings)
                except ValueError as error:
                    record = SolveRecord(scene.name, name, level, Status.FAILED, str(error))
                records.append(record)
        result = CaseResult(scene.name, "", "", "", {}, ReferenceRecord(), records, [], [])
        found.append(Solved(scene, result, solutions))
    return found


def solve_with_whole_ends(scenes, place, solvers, parameters=None, timed=False):
    """Solve with elements left whole in which a cut ends: the realised cut is smaller."""
    return solve(scenes, place, solvers, {"xfem": {"tip": "inside"}} | (parameters or {}), timed)


def budget_of(scene, level=None, tolerance=0.05, metric=None, solve=solve):
    exact = None
    if scene.judged_by_exact:
        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    return budget_study(scene, level, tolerance, metric, exact, solve, quick=True)


def parts(study, metric):
    budget = next(b for b in study.budgets if b.metric == metric)
    assert budget.closes
    return {part.source: part.value for part in budget.parts} | {"total": budget.total.value}


MESH, METHOD = "fine → own h, conforming P1", "conforming P1 → XFEM"
CUT = "cut as asked → as realised"


def test_without_tips_xfem_is_as_far_from_the_truth_as_conforming_elements():
    """Within 5 % of the error of conforming P1 elements, which differ by the cut cells only."""
    study = budget_of(load_scene("statics/f3_inclined"))
    for metric in ("displacement_l2", "energy_norm"):
        found = parts(study, metric)
        assert found.keys() == {MESH, METHOD, "total"}  # the cut is realised as asked
        assert found[METHOD] <= 0.05 * found[MESH]
        assert found["total"] == pytest.approx(found[MESH], rel=0.05)


def test_what_both_methods_reproduce_has_no_part_at_all():
    study = budget_of(load_scene("statics/f1_3d"))
    assert study.missing == []
    for metric in ("displacement_l2", "energy_norm"):
        assert max(map(abs, parts(study, metric).values())) < 1e-11


ENERGY = {"kind": "strain_energy"}
BURIED = {
    "geometry": scenes.box([1.0] * 3, [-1.0] * 3),
    "exact": {"solution": "penny", "parameters": {"a": 0.52, "tension": 1.0,
              "centre": [0.03, 0.02, 0.05], "normal": [0.1, 0.2, 1.0]}},
    "supports": [{"where": side, "displacement": "exact"}
                 for side in ("bottom", "top", "left", "right", "front", "back")],
    "cuts": [{"kind": "disc", "centre": [0.03, 0.02, 0.05], "normal": [0.1, 0.2, 1.0],
              "radius": 0.52}],
    "reference": {"degree": 1},
    "quantities": [ENERGY],
}  # fmt: skip


def test_in_space_a_front_inside_elements_is_an_error_of_the_cut_and_not_of_the_method():
    """The elements of the front are not split: the crack that XFEM makes is much smaller, which
    conforming elements with the same crack show as well."""
    study = budget_of(scenes.scene(d=3, **BURIED), solve=solve_with_whole_ends)
    assert study.missing == []
    found = parts(study, "displacement_l2")
    assert found.keys() == {CUT, MESH, METHOD, "total"}
    assert found[CUT] > 10 * found[MESH] > 50 * found[METHOD]
    energy = parts(study, "strain_energy")
    total = energy.pop("total")
    assert sum(energy.values()) == pytest.approx(total, rel=1e-10)
    assert energy[CUT] > 0.9 * total  # relative to the release of the larger crack


SOLID = {
    "geometry": scenes.box([1.0, 0.5, 0.5]),
    "mesh": {"cells": [[4, 2, 2]]},
    "material": {"young": 1e4, "poisson": 0.3},
    "supports": [{"where": "left", "displacement": [0.0, 0.0, 0.0]}],
    "loads": [{"kind": "traction", "where": "right", "traction": [10.0, 3.0, 0.0]}],
    "reference": {"size": 0.5, "degree": 1},
}


def test_without_a_cut_xfem_is_the_conforming_elements_and_all_is_the_mesh():
    found = parts(budget_of(scenes.scene(quantities=[ENERGY], **SOLID)), "displacement_l2")
    assert CUT not in found
    assert found[METHOD] < 1e-10 < 1e-2 < found[MESH]


SETTLING = {
    "geometry": scenes.box([1.0, 0.5]),
    "mesh": {"cells": [[4, 2], [8, 4]]},
    "material": {"young": 1e4, "poisson": 0.3, "density": 1000.0, "plane": "strain"},
    "analysis": {"kind": "dynamic", "duration": 8.0, "time_step": 0.1, "outputs": 5,
                 "damping": [6.0, 0.0]},
    "supports": [{"where": "left", "displacement": [0.0, 0.0]}],
    "loads": [{"kind": "traction", "where": "right", "traction": [100.0, 0.0],
               "history": [[0.0, 0.0], [1.0, 1.0]]}],
    "cuts": [{"kind": "polyline", "points": [[1.1, 0.27], [0.47, 0.27]]}],
    "reference": {"size": 0.5},
    "quantities": [{"kind": "displacement", "name": "end", "point": [1.0, 0.5], "component": "x"},
                   {"kind": "displacement", "name": "early", "point": [1.0, 0.5],
                    "component": "x", "time": 0.5}],
}  # fmt: skip


BRIEF = {**SETTLING, "analysis": {**SETTLING["analysis"], "duration": 2.0}}


@pytest.mark.parametrize(
    "content, metric, adequate",
    [pytest.param(SETTLING, "end", True, marks=pytest.mark.heavy), (BRIEF, "early", False)],
)
def test_a_static_answer_is_adequate_for_what_has_come_to_rest_and_not_on_the_way(
    content, metric, adequate
):
    study = budget_of(scenes.scene(**content), tolerance=0.15, metric=metric)
    static = [c for c in study.candidates if c.analysis == "static"]
    assert len(static) == 2
    assert any(c.high <= 0.15 for c in static) == adequate
    dynamic = [c for c in study.candidates if c.analysis == "dynamic" and c.level == 1]
    assert any(c.high <= 0.15 for c in dynamic)
    said = study.findings[0].sentence
    assert ("static" in said.split(":")[0]) or not adequate
    assert ("not adequate" in said) != adequate


@pytest.mark.heavy
def test_in_motion_method_and_time_step_have_their_parts_and_all_add_up():
    scene = scenes.scene(**BRIEF)
    study = budget_of(scene, metric="early")
    found = parts(study, "early")
    assert [*found][-2] == "fine → own time step"
    total = found.pop("total")
    assert sum(found.values()) == pytest.approx(total, rel=1e-10)
    # the rule is of second order, but the kinks of the ramp are not smooth: faster than the step
    halved = {**BRIEF, "analysis": {**BRIEF["analysis"], "time_step": 0.05}}
    coarse, fine = (
        parts(one, "displacement_l2_mean")["fine → own time step"]
        for one in (study, budget_of(scenes.scene(**halved)))
    )
    assert 0.15 < fine / coarse < 0.5
    (left,) = study.missing
    assert (left.source, left.reason) == ("finite rotations → linear", "left out by --quick")
    assert np.isfinite([c.error for c in study.candidates]).all()
