"""Stress-intensity factors as a quantity of interest: of any solver's solution, with reasons."""

import pytest

from reference.exact import exact_solution
from verify.assess.quantities import Measured, unit_of
from verify.assess.reference import conforming_reference, exact_reference
from verify.assess.unavailable import unavailable_quantities
from verify.compare.body import body_of
from verify.compare.hooke import hooke
from verify.errors import InputError
from verify.result import Metric, SolveRecord, Status
from verify.runner.checking import check_scene
from verify.scene import Scene, load_scene
from verify.solvers import find_solver

ASKED = [
    {"kind": "stress_intensity", "name": f"K_{mode} at the {end}", "end": end, "mode": mode}
    for end in ("start", "end")
    for mode in ("I", "II")
]


def griffith(**more):
    content = load_scene("statics/griffith_edges").model_dump(by_alias=True)
    content |= {"quantities": ASKED, "acceptance": []} | more
    return Scene.model_validate(content)


@pytest.mark.fenicsx
def test_a_graded_solution_has_the_factors_of_the_exact_crack_at_both_ends():
    case = griffith(reference={"kind": "conforming", "size": 0.8, "levels": 3})
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    body, law = body_of(case, exact.singular_points), hooke(case.material)
    stated = exact_reference(case, exact, body, law).quantities
    one = Measured(find_solver("reference").solve(case, 1), body, law, case)
    scale = max(value for value, _ in stated.values())
    for asked in case.quantities:
        found, (expected, width) = one.quantity(asked), stated[asked.name]
        assert width == 0.0
        # P2 graded to the tips, a coarse mesh away from them
        assert abs(found - expected) < 0.01 * scale, asked.name
    assert unit_of(case.quantities[0], 2) == "Pa √m"


@pytest.mark.fenicsx
def test_the_xfem_solution_has_factors_too_within_its_order():
    case = griffith()
    body, law = body_of(case), hooke(case.material)
    one = Measured(find_solver("xfem").solve(case, 1), body, law, case)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    expected = exact.stress_intensity[0]
    # P1 without tip enrichment at a tenth of the crack: one tenth
    for asked in case.quantities:
        if asked.mode == "I":
            assert one.quantity(asked) == pytest.approx(expected, rel=0.1)


OPENS_LATER = [{"kind": "polyline", "points": [[-1.0, 0.0], [1.0, 0.0]], "opens_at": 0.5}]
MOTION = {"kind": "dynamic", "duration": 1.0, "outputs": 5}


@pytest.mark.parametrize(
    "changes, asked, reason",
    [
        ({"cuts": [{"kind": "polyline", "points": [[-2, 0], [0, 0]]}]}, {}, "on the boundary"),
        ({"cuts": [{"kind": "polyline", "points": [[-3, 0], [0, 0]]}]}, {}, "outside the body"),
        ({"cuts": [{"kind": "arc", "centre": [0, 0], "radius": 1}]}, None, "closed"),
        (
            {
                "cuts": [
                    {"kind": "polyline", "points": [[-1, 0], [0, 0]]},
                    {"kind": "polyline", "name": "b", "points": [[-1, -1], [-1, 1]]},
                ]
            },
            {},
            "meets another cut",
        ),
        ({"analysis": {"kinematics": "corotational"}}, {}, "linear kinematics"),
        ({"analysis": MOTION | {"damping": [0, 0.1]}}, {}, "stiffness"),
        ({"analysis": MOTION}, {"time": 0.4}, "no output time"),
        ({"analysis": MOTION}, {"time": 0.0}, "opened"),
        ({"analysis": MOTION, "cuts": OPENS_LATER}, {"time": 0.5}, "opened"),
        (
            {
                "analysis": MOTION,
                "loads": [
                    {"kind": "body_force", "force": [0, 1], "history": [[1, 0], [1, 1]]},
                ],
            },
            {},
            "body force jumps",
        ),
    ],
)
def test_a_factor_that_no_solution_can_have_is_refused_beforehand(changes, asked, reason):
    content = load_scene("statics/griffith_inside").model_dump(by_alias=True)
    content["material"]["density"] = 1.0
    content["cuts"] = [{"kind": "polyline", "points": [[-1.0, 0.0], [1.0, 0.0]]}]
    content |= {"acceptance": [], "exact": None, "reference": {}}
    content["supports"] = [{"where": "boundary", "displacement": [0, 0]}]
    content |= changes
    one = {"kind": "stress_intensity", "name": "K", "end": "start"} | (asked or {})
    if asked is None:  # the case file says it
        with pytest.raises(ValueError, match=reason):
            Scene.model_validate(content | {"quantities": [one]})
        return
    scene = Scene.model_validate(content | {"quantities": [one]})
    with pytest.raises(InputError, match=rf"quantities\[0\] \('K'\).*{reason}"):
        check_scene(scene)
    energy = [{"kind": "strain_energy"}]
    check_scene(Scene.model_validate(content | {"quantities": energy}))


def test_what_only_fine_levels_have_is_known_from_those():
    case = griffith(mesh={"pattern": "structured", "cells": [[n, n] for n in (2, 16, 32, 64)]})
    body, law = body_of(case), hooke(case.material)
    levels = {k: find_solver("xfem").solve(case, k, repetitions=0) for k in range(4)}
    reference = conforming_reference(case, levels, body, law, 0.5)
    values = reference.record.metrics["K_I at the end"]["values"]
    assert values[0] is None
    assert None not in values[1:]
    assert reference.record.missing is None
    fewer = conforming_reference(case, {k: levels[k] for k in (0, 1, 2)}, body, law, 0.5)
    assert "K_I at the end" not in fewer.quantities
    assert "does not fit" in fewer.record.missing["K_I at the end"]


def solved(solver, level, value=None, why=""):
    metrics = [] if value is None else [Metric("K_I at the end", value, "Pa √m", None, 0.0, "")]
    return SolveRecord(
        "case", solver, level, Status.SOLVED, metrics=metrics, notes={"K_I at the end": why}
    )


def test_missing_quantities_are_noticed_with_their_levels_and_reason():
    case = griffith(quantities=ASKED[2:3])
    coarse = "too coarse"
    some = [solved("a", 0, why=coarse), solved("a", 1, 1.0), solved("b", 0, 1.0)]
    (one,) = unavailable_quantities(case, some)
    assert (one.about, one.solver) == ("K_I at the end", "a")
    assert one.text == "on level 0: too coarse (level 1 has it)"
    all_alike = [solved(name, level, why=coarse) for name in "ab" for level in (0, 1)]
    (one,) = unavailable_quantities(case, all_alike)
    assert (one.solver, one.text) == (None, "too coarse")
    assert unavailable_quantities(case, [solved("a", 0, 1.0)]) == []
