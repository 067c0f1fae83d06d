"""An exact field that the scene contradicts is refused; one that it does not is silent.

Scenes in general position, by a fixed seed: the field fits by construction, then one thing is
changed by a thousandth to a few per cent. Whether that contradicts the field is known by hand.
"""

import tomllib

import numpy as np
import pytest
from scenes import box, catalogue, check_refusal, soft

from verify.errors import InputError
from verify.runner.checking import check_scene
from verify.scene import Scene, case_folder

_HELD = [{"where": "boundary", "displacement": "exact"}]


def _griffith(rng):
    """An inclined crack inside a rectangle, under a remote stress and a pressure on its faces."""
    angle, a, centre = rng.uniform(-80, 80), rng.uniform(0.3, 0.6), rng.uniform(-0.2, 0.2, 2)
    pressure = rng.uniform(0.2, 1.0)
    reach = a * np.array([np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))])
    ends = [(centre - reach).tolist(), (centre + reach).tolist()]
    exact = {"centre": centre.tolist(), "a": a, "angle": angle, "pressure": pressure}
    return {
        "geometry": box([1.0, 1.1], [-1.2, -1.0]),
        "mesh": {"cells": [[9, 8]]},
        "supports": _HELD,
        "loads": [{"kind": "cut_faces", "pressure": pressure}],
        "exact": {
            "solution": "griffith",
            "parameters": exact | {"stress": rng.uniform(0, 1, 3).tolist()},
        },
        "cuts": [{"kind": "polyline", "points": ends}],
    }


def _halves(rng):
    """Another uniform strain on each side of an inclined cut; one face bears its traction."""
    slope, middle = rng.uniform(-0.3, 0.3), rng.uniform(0.4, 0.6)
    side = ["left", "right", "bottom", "top"][rng.integers(4)]
    rest = [one for one in ("left", "right", "bottom", "top") if one != side]
    exact = {
        "point": [0.5, middle],
        "slope": slope,
        "strain": rng.uniform(0.05, 0.1, 2).tolist(),
        "shift": [0.0, -0.02],
    }
    return {
        "mesh": {"sizes": [0.15], "pattern": "unstructured"},
        "supports": [{"where": one, "displacement": "exact"} for one in rest],
        "loads": [{"kind": "traction", "where": side, "traction": "exact"}],
        "exact": {"solution": "patch", "parameters": exact},
        "cuts": [
            {
                "kind": "polyline",
                "points": [[-0.2, middle - 0.7 * slope], [1.2, middle + 0.7 * slope]],
            }
        ],
    }


def _penny(rng):
    """A tilted disc in a cube under a remote tension."""
    normal = rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    centre, radius = rng.uniform(-0.1, 0.1, 3).tolist(), rng.uniform(0.4, 0.6)
    spatial = {"centre": centre, "normal": normal.tolist()}
    return {
        "geometry": box([1.0] * 3, [-1.0] * 3),
        "mesh": {"cells": [[4, 5, 4]]},
        "material": soft(3),
        "supports": _HELD,
        "exact": {"solution": "penny", "parameters": spatial | {"a": radius, "tension": 1.0}},
        "cuts": [{"kind": "disc", **spatial, "radius": radius}],
    }


def _support_off(content, rng):
    d, slope = _dimension(content), rng.choice([-0.01, 0.01])
    other = {"where": "right", "displacement": [f"1e-3 + {slope} * x", *[0.0] * (d - 1)]}
    return {"supports": [*content["supports"], other]}, "supports["


def _dimension(content):
    return len(content["geometry"]["upper"]) if "geometry" in content else 2


def _free_face(content, rng):
    rest = ["left", "bottom", "top"] + (["front", "back"] if content.get("material") else [])
    return {
        "supports": [{"where": one, "displacement": "exact"} for one in rest],
        "loads": [one for one in content.get("loads", []) if one["kind"] != "traction"],
    }, "traction"


def _cut_moved(content, rng):
    cut, off = dict(content["cuts"][0]), rng.uniform(1e-3, 3e-2) * rng.choice([-1.0, 1.0])
    if cut["kind"] == "disc":
        cut["centre"] = (np.array(cut["centre"]) + off * np.array(cut["normal"])).tolist()
    else:
        cut["points"] = [[x, y + off] for x, y in cut["points"]]
    return {"cuts": [cut]}, "cut"


def _cut_of_other_size(content, rng):
    cut, factor = dict(content["cuts"][0]), 1.0 + rng.uniform(0.003, 0.05) * rng.choice([-1.0, 1.0])
    if cut["kind"] == "disc":
        cut["radius"] *= factor
    else:
        points = np.array(cut["points"])
        cut["points"] = (points.mean(axis=0) + factor * (points - points.mean(axis=0))).tolist()
    return {"cuts": [cut]}, "cut"


def _no_load(content, rng):
    return {"loads": []}, "contradicts cut" if "griffith" in str(content) else "equilibrium"


def _weight(content, rng):
    material = content.get("material", soft()) | {"density": 1.0}
    gravity = {
        "kind": "gravity",
        "acceleration": [0.0, -0.02] + [0.0] * (not material.get("plane")),
    }
    return {"material": material, "loads": [*content.get("loads", []), gravity]}, "equilibrium"


_CHANGES = {
    _griffith: (_support_off, _free_face, _cut_moved, _cut_of_other_size, _no_load, _weight),
    _halves: (_support_off, _free_face, _cut_moved, _weight),
    _penny: (_support_off, _free_face, _cut_moved, _cut_of_other_size, _weight),
}


@pytest.mark.parametrize("trials", [1, pytest.param(12, marks=pytest.mark.heavy)])
@pytest.mark.parametrize("make", _CHANGES, ids=lambda make: make.__name__)
def test_what_contradicts_the_exact_field_is_refused_and_nothing_else(make, trials):
    rng = np.random.default_rng(27)
    for _ in range(trials):
        content = make(rng)
        d = _dimension(content)
        assert check_refusal(d=d, **content) == ""
        for change in _CHANGES[make]:
            changed, said = change(content, rng)
            assert said in check_refusal(d=d, **(content | changed)), (
                change.__name__,
                content,
                changed,
            )


def _other(content, **tables):
    """The content with keys of its tables changed."""
    return content | {key: content[key] | more for key, more in tables.items()}


def test_a_field_in_motion_is_held_against_its_beginning_its_blade_and_histories():
    """A blade that advances through a strip, on a way inclined to the mesh: of the case itself."""
    file = case_folder() / "cutting/blade_strip_inclined.toml"
    content = tomllib.loads(file.read_text())
    check_scene(Scene.model_validate(content))
    (blade,) = content["cuts"]
    slower = content["exact"]["parameters"] | {"speed": 0.392}
    early = blade | {"times": [time - 0.005 for time in blade["times"]]}
    history = [*content["supports"][:-1], content["supports"][-1] | {"history": [[0.0, 0.999]]}]
    gravity = {"kind": "gravity", "acceleration": [0.0, 0.0, -9.81]}
    for changed, said in (
        (content | {"initial": {"kind": "rest"}}, "contradicts initial"),
        (_other(content, initial={"velocity": [0.0, 0.0, 0.0]}), "the velocity is"),
        (_other(content, exact={"parameters": slower}), "contradicts cut"),
        (content | {"cuts": [early]}, "contradicts cut"),
        (content | {"supports": history}, "contradicts supports[5]"),
        (content | {"loads": [gravity]}, "is in no equilibrium"),
    ):
        with pytest.raises(InputError) as error:
            check_scene(Scene.model_validate(changed))
        assert said in str(error.value)


def test_no_case_of_the_project_contradicts_its_exact_solution():
    """One row of each family; a case that does is refused, and with it every run that it is in."""
    judged = [rows[0] for rows in catalogue().values()]
    exact = [scene for scene in judged if scene.exact is not None]
    assert exact
    for scene in exact:
        check_scene(scene)
