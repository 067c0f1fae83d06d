import numpy as np
import pytest
from scenes import catalogue

from reference.exact import exact_solution
from verify.compare.body import body_of
from verify.compare.hooke import hooke
from verify.errors import InputError
from verify.judge.reference import exact_reference
from verify.runner.checking import check_scene
from verify.scene import Scene, load_scene

EXACT = [name for name, (case, *_) in catalogue().items()
         if name.startswith("statics/") and case.exact is not None]  # fmt: skip


def arc_crack():
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    arc = {"centre": [0.1, -0.3], "radius": 0.8}
    return Scene.model_validate(content | {
        "quantities": [{"kind": "strain_energy"}],
        "acceptance": [],
        "exact": {
            "solution": "arc_crack",
            "parameters": {**arc, "angle": 35.0, "half_angle": 50.0, "stress": [0.9, 1.0, 0.2]},
        },
        "cuts": [{"kind": "arc", **arc, "start": -15.0, "sweep": 100.0}],
    })  # fmt: skip


@pytest.mark.parametrize("name", [*EXACT, "arc crack"])
def test_the_exact_energy_is_that_integrated_over_the_body(name, monkeypatch):
    """Two ways that share nothing but the field: ½∮t·u, and quadrature by slabs."""
    case = arc_crack() if name == "arc crack" else load_scene(name)
    exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
    body, law = body_of(case, exact.singular_points), hooke(case.material)
    value, width = exact_reference(case, exact, body, law).quantities["strain_energy"]
    assert width <= 1e-10 * value

    def unknown(body):
        raise InputError("no closed form")

    monkeypatch.setattr(exact, "strain_energy", unknown)
    integrated, known = exact_reference(case, exact, body, law).quantities["strain_energy"]
    assert abs(value - integrated) <= known + 1e-11 * value
    assert known < 1e-8 * value


def test_the_tips_of_the_cut_are_the_singular_points_of_the_exact_field():
    for case in (case for name, (case, *_) in catalogue().items() if name in EXACT):
        assert " shall " in case.requirement
        exact = exact_solution(case.exact.solution, case.exact.parameters, case.material)
        ends = body_of(case).front if case.dimension == 3 else body_of(case).tips
        assert len(ends) == len(exact.singular_points)
        for end in ends:
            assert np.linalg.norm(exact.singular_points - end, axis=1).min() < 1e-14


@pytest.mark.heavy
@pytest.mark.parametrize("name", catalogue())
def test_no_case_is_refused_before_a_run(name):
    for scene in catalogue()[name]:
        check_scene(scene)
