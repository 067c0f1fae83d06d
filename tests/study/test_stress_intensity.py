"""Stress-intensity factors as a quantity of interest: of any solver's solution, with reasons."""

import pytest

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.hooke import hooke
from verify.errors import UnsupportedSceneError
from verify.scene import Scene, load_scene
from verify.solvers import find_solver
from verify.study.quantities import Measured, unit_of
from verify.study.reference import exact_reference

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


def test_what_is_no_tip_or_not_linear_is_refused_with_the_reason():
    strip = load_scene("statics/tissue_strip")
    content = strip.model_dump(by_alias=True)
    cut = strip.cuts[0].name
    content |= {"acceptance": [], "quantities": [dict(q, cut=cut) for q in ASKED[::2]]}
    case = Scene.model_validate(content)
    solved = find_solver("xfem").solve(case, 0)
    one = Measured(solved, body_of(case), hooke(case.material), case)
    reasons = []
    for asked in case.quantities:
        try:
            assert one.quantity(asked) > 0
        except UnsupportedSceneError as problem:
            reasons.append(str(problem))
    assert len(reasons) == 1  # one end is the mouth
    assert "no tip" in reasons[0]
    turned = Scene.model_validate(content | {"analysis": {"kinematics": "corotational"}})
    with pytest.raises(UnsupportedSceneError, match="linear kinematics"):
        Measured(solved, body_of(case), hooke(case.material), turned).quantity(turned.quantities[0])
