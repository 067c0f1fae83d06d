"""The final cut of a tool path, and when its blade passes a place."""

import numpy as np
import pytest

from verify.scene import ToolPathCut


def _path(**given: object) -> ToolPathCut:
    return ToolPathCut.model_validate({"kind": "tool_path", **given})


def test_plane_path_passes_its_points_at_arc_length_over_speed() -> None:
    # two legs, 0.5 and 1.0 long, at 2 m/s from t = -0.1 s on
    points = [[0.1, 0.2], [0.4, 0.6], [1.2, 1.2]]
    path = _path(points=points, speed=2.0, starts_at=-0.1)
    legs = np.array(points)
    places = np.array([legs[0], 0.3 * legs[0] + 0.7 * legs[1], legs[1], legs[1:].mean(axis=0)])
    np.testing.assert_allclose(path.passed_at(places), -0.1 + np.array([0, 0.35, 0.5, 1.0]) / 2)
    np.testing.assert_allclose(path.whole().vertices(), legs)


def test_blade_that_waits_has_been_there_since_it_arrived() -> None:
    path = _path(points=[[0, 0.1], [0.5, 0.3], [0.5, 0.3], [1, 0.2]], times=[-1, 0.5, 2.0, 3.0])
    assert path.passed_at(np.array([[0.5, 0.3]])) == pytest.approx(0.5)
    assert len(path.whole().vertices()) == 3


def test_straight_blade_in_space_passes_by_the_tip_not_by_the_depth() -> None:
    tips = np.array([[0.0, -0.2, 1.1], [0.1, 0.5, 1.0], [0.4, 1.2, 1.1]])
    path = _path(points=tips.tolist(), direction=[0.2, 0.1, -1.0], depth=0.7, times=[0, 1, 3])
    blade = path.blade[0]
    rng = np.random.default_rng(3)
    share, along = rng.random(40), rng.random(40)
    first = tips[0] + share[:, None] * (tips[1] - tips[0]) + along[:, None] * blade
    second = tips[1] + share[:, None] * (tips[2] - tips[1]) + along[:, None] * blade
    np.testing.assert_allclose(path.passed_at(first), share, atol=1e-9)
    np.testing.assert_allclose(path.passed_at(second), 1 + 2 * share, atol=1e-9)
    assert path.whole().kind == "swept"
    np.testing.assert_allclose(path.whole().along, blade)


def test_final_cut_has_the_positive_side_of_motion_times_blade() -> None:
    path = _path(
        points=[[0.0, 0.0, 1.0], [0.3, 1.0, 1.0]], direction=[0, 0.1, -1], depth=0.5, speed=1.0
    )
    points, triangles = path.surface()
    a, b, c = points[triangles[0]]
    normal = np.cross(b - a, c - a)
    assert normal @ np.cross([0.3, 1.0, 0.0], path.blade[0]) > 0


def test_blade_that_turns_in_its_plane_sweeps_a_polygon() -> None:
    # the blade swings in the plane x = 0.3 while its tip goes on
    path = _path(
        points=[[0.3, 0.0, 1.0], [0.3, 1.0, 1.0]],
        direction=[[0, -0.3, -1], [0, 0.4, -1]], depth=0.5, times=[0.0, 2.0],
    )  # fmt: skip
    whole = path.whole()
    assert whole.kind == "polygon"
    blade = path.blade
    for share, along in ((0.25, 0.4), (0.8, 0.9), (0.0, 0.0)):
        tip = (1 - share) * np.array(path.points[0]) + share * np.array(path.points[1])
        place = tip + along * ((1 - share) * blade[0] + share * blade[1])
        assert path.passed_at(place[None])[0] == pytest.approx(2.0 * share, abs=1e-9)
