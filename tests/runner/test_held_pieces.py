"""Pieces that nothing holds are refused before a run, and bodies that are held are not.

Whether a piece is held is known by hand: a body is parted by inclined cuts through it, and each
part gets a support, none, or one that leaves a shift or a turn.
"""

import numpy as np
import pytest
from scenes import check_refusal, soft


def _halves(rng, d):
    """A body parted by an inclined plane between x = 0.3 and 0.7, in general position."""
    (a, b), reach = rng.uniform(0.35, 0.65, 2), 0.1
    if d == 2:
        slope = (b - a) * reach
        cut = {"kind": "polyline", "points": [[a - slope, -reach], [b + slope, 1 + reach]]}
        return {"mesh": {"cells": [rng.integers(3, 9, 2).tolist()]}, "cuts": [cut]}
    tilt = rng.uniform(-0.1, 0.1)
    corners = [[-reach, -reach], [1 + reach, -reach], [1 + reach, 1 + reach], [-reach, 1 + reach]]
    points = [[a + tilt * (y - 0.5) + (b - a) * z, y, z] for y, z in corners]
    return {
        "mesh": {"cells": [rng.integers(2, 5, 3).tolist()]},
        "material": soft(3),
        "cuts": [{"kind": "polygon", "points": points}],
    }


def _hold(where, d, components=None):
    held = components or "xyz"[:d]
    return {"where": where, "displacement": [0.0] * len(held), "components": list(held)}


@pytest.mark.parametrize("d", [2, 3])
def test_a_half_that_is_free_or_can_still_move_is_refused_before_a_run(d):
    rng = np.random.default_rng(7)
    for _ in range(3):
        content = _halves(rng, d)
        left, right = _hold("left", d), _hold("right", d)
        # held at one side, or all over one face in one component: that leaves shifts
        sliding = _hold("right", d, ["x"])
        # a point, in space an edge along z: that leaves a turn
        hinged = _hold("x > 1 - 1e-6 and y < 1e-6", d)
        roller = _hold("top" if d == 2 else "back", d, ["y"])
        pulled = {"kind": "traction", "where": "right", "traction": [0.1] + [0.0] * (d - 1)}
        assert check_refusal(d=d, **content, supports=[left, right]) == ""
        assert check_refusal(d=d, **content, supports=[left, hinged, roller]) == ""
        for supports in ([left], [right], [left, sliding], [left, hinged]):
            refusal = check_refusal(d=d, **content, supports=supports, loads=[pulled])
            assert "can move as a rigid body" in refusal, (content, supports)


def test_a_piece_between_cuts_and_a_flap_that_hangs_on():
    rng = np.random.default_rng(8)
    for _ in range(3):
        a, b = rng.uniform(0.2, 0.4), rng.uniform(0.6, 0.8)
        tilt = rng.uniform(-0.1, 0.1)
        lines = [[[x - tilt, -0.1], [x + tilt, 1.1]] for x in (a, b)]
        through = [{"kind": "polyline", "name": f"c{i}", "points": p} for i, p in enumerate(lines)]
        ends = [_hold("left", 2), _hold("right", 2)]
        assert "around" in check_refusal(cuts=through, supports=ends)
        held = [*ends, _hold("0.5 < x and x < 0.55 and y < 0.5", 2)]
        fine = {"mesh": {"cells": [[40, 8]]}}
        assert check_refusal(cuts=through, supports=held, **fine) == ""
        through[1]["points"][1] = [b + 0.5 * tilt, 0.8]  # ends inside: the piece hangs on
        assert check_refusal(cuts=through, supports=ends, **fine) == ""


def test_a_motion_may_have_free_pieces_unless_it_begins_in_equilibrium():
    free = {
        "cuts": [{"kind": "polyline", "points": [[-0.1, 0.42], [1.1, 0.55]]}],
        "supports": [_hold("top", 2)],
        "material": soft(2, density=1.0),
        "analysis": {"kind": "dynamic", "duration": 1.0},
    }
    assert check_refusal(**free) == ""
    assert check_refusal(**free, initial={"kind": "equilibrium"}) == ""
    opened = {"kind": "equilibrium", "cuts": "open"}
    assert "can move as a rigid body" in check_refusal(**free, initial=opened)
    later = free | {"cuts": [free["cuts"][0] | {"opens_at": 0.5}]}
    assert check_refusal(**later, initial=opened) == ""
    unheld = free | {"supports": [], "initial": {"kind": "equilibrium"}}
    assert "can move as a rigid body" in check_refusal(**unheld)
