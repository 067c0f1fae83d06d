"""Supports that jump in a motion are refused before a run: nothing follows a jump.

A bar of n elements whose end jumps by d stores ½ E A d² n / L beside it at once. Its end moves
by d in a step of L / (n c). There is no limit.
"""

import pytest
from scenes import box, check_refusal, scene, soft

from verify.runner.checking import check_scene

CUT = {"kind": "polyline", "points": [[-0.1, 0.42], [0.6, 0.55]]}
LEFT = {"where": "left", "displacement": [0.0, 0.0]}
MOVED = [0.01, -0.02]
TURN = {"angle": 20.0, "centre": [1.0, 0.3]}
SLOWLY = [[0.0, 0.0], [0.3, 1.0], [0.5, -0.2]]
THERE = [[0.0, 1.0], [0.3, 1.0], [0.3, 0.2]]
AXIAL = {"angle": 20.0, "centre": [1.0, 0.3, 0.0], "axis": [1.0, 2.0, 0.5]}


def moving(support, **changes):
    d = 3 if changes.get("geometry", box([1.0, 1.0]))["upper"][2:] else 2
    held = {"where": "left", "displacement": [0.0] * d}
    return {
        "material": soft(d, density=1.0),
        "analysis": {"kind": "dynamic", "duration": 0.6},
        "supports": [held, {"where": "right"} | support],
        "cuts": [CUT] if d == 2 else [],
    } | changes


def block(support):
    return moving(support, geometry=box([1.0, 0.5, 0.4]), mesh={"cells": [[3, 2, 2]]}, d=3)


STILL = {"initial": {"kind": "equilibrium"}}
STATED = {"initial": {"kind": "field", "displacement": ["0.01 * x", "-0.02 * x"]}}


@pytest.mark.parametrize(
    ("content", "when"),
    [
        (moving({"displacement": MOVED, "history": [*SLOWLY[:2], [0.3, 0.4]]}), "0.3 s"),
        (moving({"displacement": MOVED, "history": THERE}, **STILL), "0.3 s"),
        (moving({"displacement": MOVED, "history": [*SLOWLY[:2], [0.3 + 3e-10, 0.4]]}), "0.3 s"),
        (moving({"displacement": MOVED, "history": [[0.0, 0.0], [0.0, 1.0]]}, **STILL), "0 s"),
        (moving({"displacement": MOVED}), "0 s"),
        (moving({"displacement": ["0.02 * y", "0.01 * cos(9 * t)"]}), "0 s"),
        (moving({"displacement": ["t * (1 + abs(t - 0.13) / (t - 0.13))", 0.0]}), "0.13 s"),
        (moving({"displacement": [0.0, "y * t * (t - 0.41) / abs(t - 0.41)"]}), "0.41 s"),
        (moving({"displacement": [0.01], "components": ["y"]}, initial={"kind": "moving",
         "velocity": [0.1, 0.0]}), "0 s"),
        (moving({"displacement": [0.0, 0.0], "rotation": TURN}), "0 s"),
        (moving({"displacement": [0.01, -0.03]}, **STATED), "0 s"),
        (moving({"displacement": MOVED, "history": [[0.0, 0.0], [0.6, 1.0], [0.6, 2.0]]}), "0.6 s"),
        (block({"displacement": [0.0] * 3, "rotation": AXIAL, "history": [*SLOWLY, [0.5, 1.0]]}),
         "0.5 s"),
    ],
)  # fmt: skip
def test_a_support_that_jumps_is_refused(content, when):
    said = check_refusal(**content)
    assert said.partition(": ")[2].startswith("supports[1]: jumps by 0."), said
    assert f"m at {when}, and no motion" in said


@pytest.mark.parametrize(
    "content",
    [
        moving({"displacement": MOVED, "history": SLOWLY}),
        moving({"displacement": MOVED, "history": [[0.1, 0.0], [0.1, 0.0], [0.2, 1.0]]}),
        moving({"displacement": MOVED, "history": [[0.0, 7.0], [0.0, 0.0], [0.2, 1.0]]}),
        moving({"displacement": MOVED, "history": [*SLOWLY, [0.7, 1.0], [0.7, 2.0]]}),
        moving({"displacement": [0.0, 0.0], "history": THERE}),
        moving({"displacement": ["0.02 * y * sin(9 * t)", "0.01 * (cos(9 * t) - 1)"]}),
        moving({"displacement": MOVED}, **STILL),
        moving({"displacement": ["0.01 * sin(2000 * t)", "0.001 * sqrt(abs(t - 0.21))"]}, **STILL),
        moving({"displacement": ["0.01 * t / (t + 1e-5)", "1e-4 * (abs(t - 0.3) - 0.3)"]}),
        moving({"displacement": ["0.02 * y", "0.01 * cos(9 * t)"]}, **STILL),
        moving({"displacement": MOVED}, **STATED),
        block({"displacement": [0.0] * 3, "rotation": AXIAL, "history": SLOWLY}),
    ],
)
def test_a_support_that_only_moves_is_not(content):
    check_scene(scene(**content))
