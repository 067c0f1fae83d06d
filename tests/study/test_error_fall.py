"""Claims about what limits the order of a reference beside its elements."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest

from verify.assess.error_fall import error_fall
from verify.compare.body import body_of
from verify.scene import Scene, load_scene


def on_an_arc(facets):
    turn = np.deg2rad(np.linspace(20.0, 70.0, facets + 1))
    ring = 0.6 * np.column_stack([np.cos(turn), np.sin(turn)])
    return SimpleNamespace(cut_facets=np.stack([ring[:-1], ring[1:]], axis=1))


def plate_with_an_arc():
    content = load_scene("statics/griffith_inside").model_dump(mode="json", by_alias=True)
    cut = {"kind": "arc", "centre": [0.0, 0.0], "radius": 0.6, "start": 10.0, "sweep": 90.0}
    return Scene.model_validate(content | {"cuts": [cut], "acceptance": []})


def test_facets_of_an_arc_fall_like_the_square_of_their_number():
    scene = plate_with_an_arc()
    body = body_of(scene)
    levels = [on_an_arc(n) for n in (20, 35)]
    # halved elements, but 35 facets instead of 40
    assert error_fall(scene, levels, [0.2, 0.1], body) == pytest.approx((35 / 20) ** 2, rel=1e-3)
    assert error_fall(scene, [levels[1]] * 2, [0.2, 0.1], body) == 2.0


def test_a_straight_cut_limits_nothing_and_time_steps_are_of_second_order():
    straight = SimpleNamespace(cut_facets=np.zeros((0, 2, 2)))
    for name, fall in (("statics/griffith_inside", inf), ("dynamics/freed_half", 4.0)):
        scene = load_scene(name)
        assert error_fall(scene, [straight] * 2, [0.2, 0.1], body_of(scene)) == fall
