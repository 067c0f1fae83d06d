"""Material that is inside out: measured from the field, whatever its solver says of it."""

from dataclasses import replace

import numpy as np
import pytest
import scenes
from judged_fields import judged

from verify.compare.simplices import share_inside_out
from verify.judge.notices import INSIDE_OUT
from verify.judge.ranks import rank_solvers
from verify.solvers import find_solver

CUT = {
    2: {"kind": "polyline", "points": [[-0.1, 0.37], [1.1, 0.61]]},
    3: {"kind": "polygon",
        "points": [[-0.1, -0.1, 0.31], [1.1, -0.1, 0.55], [1.1, 1.1, 0.67], [-0.1, 1.1, 0.43]]},
}  # fmt: skip
BELOW = 0.49  # of the volume: the mean height of the cut
TURN = {2: [[-1.0, 0.0], [0.0, -1.0]], 3: [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]]}


def turned(d, kinematics):
    """Turn a cut body by half a turn; and the same with the part below the cut mirrored."""
    scene = scenes.scene(
        [CUT[d]], d, analysis={"kinematics": kinematics},
        supports=[{"where": "boundary", "displacement": [0.0] * d}],
    )  # fmt: skip
    solution = find_solver("xfem").solve(scene, 0, repetitions=0)
    points = solution.points
    whole = points @ np.transpose(TURN[d]) - points
    centres = points[solution.cells].mean(axis=1)
    levels = np.array(CUT[d]["points"])
    slope, *_ = np.linalg.lstsq(np.c_[levels[:, :-1], np.ones(len(levels))], levels[:, -1])
    below = centres[:, -1] < np.c_[centres[:, :-1], np.ones(len(centres))] @ slope
    half = whole.copy()
    nodes = np.unique(solution.cells[below])
    half[nodes, 0] += 3.0 * points[nodes, 0]  # mirrored, and twice as wide
    return scene, solution, whole, half


@pytest.mark.parametrize("d", [2, 3])
def test_the_share_is_the_volume_of_the_mirrored_half_at_any_time(d):
    _, solution, whole, half = turned(d, "finite_rotation")
    for fields, share in (([whole], 0.0), ([half], BELOW), ([whole, half, whole], BELOW)):
        motion = replace(
            solution, times=np.arange(len(fields)) * 0.1, displacement=np.array(fields), ledger={}
        )
        assert share_inside_out(motion) == pytest.approx(share, abs=1e-12)


def test_it_is_warned_of_and_counted_at_finite_rotation_only():
    for kinematics, field, said in (
        ("finite_rotation", 3, ["0.49 of the volume on level 0"]),
        ("finite_rotation", 2, []),
        ("linear", 3, []),
    ):
        scene, solution, *fields = turned(2, kinematics)
        one = replace(solution, displacement=fields[field - 2][None], notes={})
        result = judged(scene, {"guest": {0: one}})
        found = [n.text.partition(":")[0] for n in result.notices if n.about == INSIDE_OUT]
        assert found == said
        (row,) = rank_solvers([result])["stability"]
        assert row["inside_out"] == len(said)
