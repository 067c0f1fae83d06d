"""Lines on cuts in space for opening profiles: where they are said to be, and as long."""

import numpy as np
import pytest
from solid_meshes import solid_scene

from verify.compare.body import body_of
from verify.compare.cut_profile import profile_lines

TILT = [0.1, -0.2, 0.9]
DISC = {"kind": "disc", "centre": [0.5, 0.48, 0.52], "normal": TILT,
        "radii": [0.1, 0.3], "axis": [1.0, 0.0, 0.0]}  # fmt: skip
CYLINDER = {"kind": "cylinder", "base": [0.5, 0.5, 0.2], "axis": [0.0, 0.1, 1.0], "radius": 0.2,
            "height": 0.4, "towards": [1.0, 0.0, 0.0], "start": 20.0, "sweep": 130.0}  # fmt: skip
SPHERE = {"kind": "sphere", "centre": [0.5, 0.5, 0.5], "radius": 0.3, "opening": 60.0}
SWEPT = {"kind": "swept", "points": [[0.2, 0.3, 0.3], [0.5, 0.45, 0.3], [0.8, 0.3, 0.3]],
         "along": [0.05, 0.1, 0.4]}  # fmt: skip
POLYGON = {"kind": "polygon", "points": [[0.2, 0.4, 0.45], [0.8, 0.4, 0.5], [0.8, 0.6, 0.5],
                                         [0.2, 0.6, 0.45]]}  # fmt: skip


# the end points are half a step from the ends: a share of sin²(π/4/48) of a piece at either end
@pytest.mark.parametrize(
    ("cut", "length"),
    [(DISC, 0.6), (CYLINDER, 0.2 * np.deg2rad(130.0)), (SPHERE, 0.3 * np.deg2rad(120.0)),
     (SWEPT, 2 * np.hypot(0.3, 0.15)), (POLYGON, np.hypot(0.6, 0.05))],
    ids=["disc", "cylinder", "sphere", "swept", "polygon"],
)  # fmt: skip
def test_a_line_lies_on_its_cut_and_is_as_long_as_it_should(cut, length):
    body = body_of(solid_scene([cut]))
    (line,) = profile_lines(body)
    foot, _ = body.nearest_on_cuts(line.rule.points)
    assert np.abs(foot - line.rule.points).max() < 1e-12
    assert line.arc[-1] == pytest.approx(length, rel=2e-3)
    assert (np.diff(line.arc) > 0).all()
    across = line.rule.positive - line.rule.negative
    assert np.allclose(np.sum(across * line.rule.normals, axis=1), np.linalg.norm(across, axis=1))


def test_a_line_ends_where_the_body_does():
    wide = {**POLYGON, "points": [[-0.5, 0.4, 0.45], [1.5, 0.4, 0.45], [1.5, 0.6, 0.45],
                                  [-0.5, 0.6, 0.45]]}  # fmt: skip
    (line,) = profile_lines(body_of(solid_scene([wide])))
    assert line.rule.points[:, 0].min() >= 0.0
    assert line.rule.points[:, 0].max() <= 1.0
    assert line.arc[-1] > 0.9
