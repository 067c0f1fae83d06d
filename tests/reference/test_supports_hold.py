"""A static body, or piece, that can still move as a rigid one is refused by name."""

import pytest
from reference_scenes import energy_of, needs_fenicsx, polyline, square

from verify.errors import InputError

pytestmark = needs_fenicsx

THROUGH = polyline("a", (-0.1, 0.5), (1.1, 0.5))
CLAMPED = {"where": "bottom", "displacement": [0, 0]}
ROLLERS = {"where": "top", "displacement": [0], "components": ["y"]}
CORNER = {"where": "x < 1e-6 and y > 0.999999", "displacement": [0, 0]}
LEFT = {"where": "x < 1e-6 and y > 0.999999", "displacement": [0], "components": ["x"]}


@pytest.mark.parametrize(
    "supports, words",
    [
        ([CLAMPED], "is held by no support"),
        ([CLAMPED, ROLLERS], "can still move in x"),
        ([CLAMPED, CORNER | {"where": "x < 1e-13 and y > 1 - 1e-13"}], "can still turn"),
    ],
    ids=["nothing", "rollers", "a single node"],
)
def test_a_piece_left_a_rigid_motion_is_named_with_the_motion(supports, words):
    scene = square([THROUGH], supports=supports)
    for solver in ("conforming", "reference"):
        with pytest.raises(InputError, match=rf"the piece around \(0\.5, 0\.75\) {words}"):
            energy_of(scene, solver)


def test_a_piece_held_just_enough_is_solved():
    scene = square([THROUGH], supports=[CLAMPED, ROLLERS, LEFT])
    assert energy_of(scene, "conforming") > 0


def test_a_body_on_rollers_only_is_refused_without_any_cut():
    with pytest.raises(InputError, match="can still move in x"):
        energy_of(square(supports=[ROLLERS]), "conforming")


@pytest.mark.parametrize("solver", ["conforming", "reference"])
def test_halves_of_a_block_that_are_carried_apart_store_nothing(solver):
    # a translation has no forces by which the residual of Newton's method could be judged
    moved = [("x < 0.45", [-0.1, 0.02, 0.03]), ("x > 0.45", [0.2, -0.07, 0.05])]
    plane = {
        "kind": "polygon",
        "points": [[0.45, y, z] for y, z in [(-0.1, -0.1), (1.1, -0.1), (1.1, 1.1), (-0.1, 1.1)]],
    }
    scene = square(
        [plane],
        geometry={"kind": "box", "lower": [0, 0, 0], "upper": [1, 1, 1]},
        mesh={"cells": [[2, 2, 2]]},
        material={"young": 1.0, "poisson": 0.3},
        supports=[{"where": f"z < 1e-9 and ({w})", "displacement": u} for w, u in moved],
        loads=[],
        analysis={"kinematics": "corotational"},
        reference={"size": 0.5},
    )
    assert energy_of(scene, solver) < 1e-20
