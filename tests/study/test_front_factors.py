"""Stress-intensity factors at points of a front in space, and of cuts whose faces are loaded."""

import numpy as np
import pytest
from pydantic import ValidationError

from reference.exact import exact_solution
from verify.errors import InputError
from verify.runner.checking import check_scene
from verify.scene import Scene, load_scene
from verify.solvers import find_solver
from verify.study.stress_intensity import exact_intensity, solution_intensity


def penny(*asked, **changes):
    """Give the inclined penny under tension and pressure, with factors asked for."""
    content = load_scene("curved/penny").model_dump(mode="json", by_alias=True)
    quantities = [
        {"kind": "stress_intensity", "name": f"q{i}", "cut": "crack"} | one
        for i, one in enumerate(asked)
    ]
    content |= {"quantities": quantities, "acceptance": [], "known_findings": []} | changes
    return Scene.model_validate(content)


def exact_of(scene):
    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def front_point(degrees):
    """Where the shear of the inclined penny points ahead, turned on about its normal."""
    normal, centre = np.array([0.36, -0.48, 0.8]), np.array([0.07, -0.04, 0.03])
    ahead = np.array([0.0, 0.0, 1.0]) - 0.8 * normal
    ahead /= np.linalg.norm(ahead)
    turn = np.deg2rad(degrees)
    spoke = np.cos(turn) * ahead + np.sin(turn) * np.cross(normal, ahead)
    return (centre + spoke).tolist()


@pytest.mark.heavy
@pytest.mark.fenicsx
def test_the_three_modes_of_an_inclined_penny_are_kassirs_and_sihs():
    """Graded quadratic elements, 0.06 a at the front: the energy is 1e-3 off, and so is K."""
    scene = penny(
        *({"mode": mode, "point": front_point(60.0)} for mode in ("I", "II", "III")),
        reference={"size": 1.0},
    )
    found = find_solver("reference").solve(scene, 1, repetitions=0)
    exact = exact_of(scene)
    stated = np.array([exact_intensity(scene, exact, asked) for asked in scene.quantities])
    assert stated == pytest.approx([1.2864, 0.3186, 0.3863], abs=1e-4)
    values = [solution_intensity(scene, found, asked) for asked in scene.quantities]
    assert values == pytest.approx(stated, abs=5e-3 * stated[0])


@pytest.mark.fenicsx
def test_the_factors_of_a_pressed_crack_are_those_of_its_closed_form():
    """The faces are freed by a uniform stress: its own field has no factor."""
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    content["exact"]["parameters"] |= {"stress": [0.3, 0.0, 0.0], "pressure": 1.0}
    content |= {
        "loads": [{"kind": "cut_faces", "pressure": 1.0}],
        "quantities": [
            {"kind": "stress_intensity", "name": mode, "end": "end", "mode": mode}
            for mode in ("I", "II")
        ],
        "acceptance": [],
        "reference": {"kind": "conforming"},
    }
    scene = Scene.model_validate(content)
    found = find_solver("reference").solve(scene, 0, repetitions=0)
    exact = exact_of(scene)
    for asked in scene.quantities:
        stated = exact_intensity(scene, exact, asked)
        assert solution_intensity(scene, found, asked) == pytest.approx(stated, abs=2e-3)


@pytest.mark.parametrize(
    "asked, words",
    [
        ({"point": [0.07, -0.04, 0.03]}, "1 m away from the front of 'crack'"),
        ({"end": "start"}, "a factor in 3D is at 'point = …'"),
    ],
)
def test_what_is_no_point_of_a_front_is_refused(asked, words):
    with pytest.raises(ValidationError, match=words):
        penny(asked)


def test_mode_three_belongs_to_space():
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    asked = {"kind": "stress_intensity", "name": "K", "end": "end", "mode": "III", "radius": 0.1}
    with pytest.raises(ValidationError, match="III belongs to 3D"):
        Scene.model_validate(content | {"quantities": [asked]})


def test_a_front_that_meets_another_cut_or_a_load_that_varies_is_refused():
    asked = {"point": front_point(60.0)}
    across = {"kind": "polygon", "name": "across",
              "points": [[0.5, -2, -2], [0.5, 2, -2], [0.5, 2, 2], [0.5, -2, 2]]}  # fmt: skip
    cuts = [*load_scene("curved/penny").model_dump(mode="json")["cuts"], across]
    with pytest.raises(InputError, match="meets another cut"):
        check_scene(penny(asked, cuts=cuts))
    load = {"kind": "cut_faces", "cut": "crack", "pressure": "1 + x"}
    with pytest.raises(InputError, match="is not uniform"):
        check_scene(penny(asked, loads=[load]))
