"""Histories and paths in time; lengths and contacts of cuts in the plane."""

import numpy as np
import pytest
from case_texts import body_text, support_text
from hypothesis import given
from hypothesis import strategies as st

from verify.errors import InputError
from verify.geometry.planar import inner_parts, inside_polygon, overlap_length, points_along
from verify.geometry.simplices import distance_to_outline
from verify.scene import Rotation, Support, ToolPathCut, load_scene
from verify.scene.physics import factor_at, first_factor, jumps, slope_at

MOVING = (
    body_text("A square", "It shall move.", [1.0, 1.0], [[4, 4]], density="1.0")
    + '[analysis]\nkind = "dynamic"\nduration = 2.0\n'
)
STATIC = MOVING.replace('[analysis]\nkind = "dynamic"\nduration = 2.0\n', "")
HELD = support_text("left", [0, 0])


def load(folder, text):
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


def test_output_times_are_evenly_spaced_and_steps_are_counted_between_them(tmp_path):
    """A step longer than a gap is cut."""
    analysis = load(tmp_path, MOVING).analysis
    assert [analysis.steps(largest) for largest in (5.0, 0.2, 0.1, 0.08)] == [10, 10, 20, 30]
    assert load(tmp_path, MOVING).analysis.output_times == pytest.approx(np.linspace(0, 2, 11))
    assert load(tmp_path, MOVING + "outputs = 3\n").analysis.output_times == (0.0, 1.0, 2.0)
    assert load(tmp_path, STATIC + HELD).analysis.output_times == (0.0,)


@pytest.mark.parametrize(
    "time, factor, slope",
    [(0.0, 1.0, 0.0), (1.0, 1.0, 2.0), (1.25, 1.5, 2.0), (2.0, -1.0, 0.0), (3.0, -1.0, 0.0)],
)
def test_a_history_is_linear_between_its_times_and_constant_outside(time, factor, slope):
    """After a jump (at 2) the new factor holds; the rate is the one after it."""
    history = [(1.0, 1.0), (2.0, 3.0), (2.0, -1.0)]
    assert (factor_at(history, time), slope_at(history, time)) == (factor, slope)
    assert (first_factor(history), jumps(history)) == (1.0, [2.0])
    at_once = [(0.0, 1.0), (0.0, 0.0)]  # a load that jumps at the beginning was there before
    assert (first_factor(at_once), factor_at(at_once, 0.0)) == (1.0, 0.0)


@pytest.mark.parametrize("axis", [None, (1.0, 2.0, -2.0)])
def test_a_support_turns_by_a_rotation_whose_rate_is_its_derivative(axis):
    dimension = 2 if axis is None else 3
    rotation = Rotation(angle=70.0, centre=[0.2] * dimension, axis=axis)
    matrix = rotation.matrix(0.4)
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(dimension), atol=1e-15)
    assert np.trace(matrix) == pytest.approx(2 * np.cos(np.deg2rad(28.0)) + dimension - 2)
    support = Support(where="boundary", displacement=[0.5] * dimension, rotation=rotation)
    points = np.random.default_rng(5).random((4, dimension))
    step = 1e-6
    slope = (support.values(points, 0.4 + step) - support.values(points, 0.4 - step)) / (2 * step)
    np.testing.assert_allclose(support.velocities(points, 0.4, 3.0, 0.0), 3 * slope, atol=3e-9)


ARCS = """
[[cuts]]
kind = "arc"
name = "outer"
centre = [0.5, 0.5]
radius = 0.4
{outer}
[[cuts]]
kind = "arc"
name = "inner"
centre = {centre}
radius = {radius}
{inner}
"""


@pytest.mark.parametrize(
    "part, touches",
    [
        ({"centre": [0.7, 0.5], "radius": 0.2}, True),  # from inside, at (0.9, 0.5)
        ({"centre": [0.5, 0.5], "radius": 0.3}, True),
        ({"centre": [0.5, 0.5], "radius": 0.4}, False),
        ({"centre": [0.5, 0.5], "radius": 0.4, "inner": "start = 90.0\nsweep = 90.0"}, False),
        (
            {
                "centre": [0.5, 0.5], "radius": 0.4, "outer": "start = 0.0\nsweep = 90.0",
                "inner": "start = 90.0\nsweep = 180.0",
            },
            True,
        ),
        (
            {
                "centre": [0.5, 0.5], "radius": 0.4, "outer": "start = 300.0\nsweep = 120.0",
                "inner": "start = 20.0\nsweep = 90.0",
            },
            False,
        ),
    ],
)  # fmt: skip
def test_arcs_that_touch_do_not_lie_on_each_other(tmp_path, part, touches):
    """Only arcs of one circle can; their chords may be parallel at a point where they touch."""
    text = STATIC + HELD + ARCS.format(**{"outer": "", "inner": "", **part})
    if touches:
        load(tmp_path, text)
        return
    with pytest.raises(InputError, match="outer"):
        load(tmp_path, text)


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
    # past its end the blade would go on; before its start it is not
    past = tips[1] + (1 + 0.3 * share[:, None]) * (tips[2] - tips[1]) + along[:, None] * blade
    np.testing.assert_allclose(path.passed_at(past), 3 + 0.6 * share, atol=1e-9)
    ahead = tips[0] - 0.3 * share[:, None] * (tips[1] - tips[0]) + along[:, None] * blade
    np.testing.assert_allclose(path.passed_at(ahead), 0.0, atol=1e-9)
    assert path.whole().kind == "swept"
    np.testing.assert_allclose(path.whole().along, blade)


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


SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
NOTCHED = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0],
                    [1.0, 2.0], [0.0, 2.0]])  # fmt: skip


def length(parts):
    return sum(float(np.linalg.norm(b - a)) for a, b in parts)


@given(
    st.tuples(*[st.floats(-2, 3) for _ in range(4)]).filter(
        lambda v: np.hypot(v[2] - v[0], v[3] - v[1]) > 1e-3
    )
)
def test_the_inner_length_equals_that_of_clipping_against_half_planes(values):
    a, b = np.array(values[:2]), np.array(values[2:])
    low, high = 0.0, 1.0  # Liang–Barsky
    for c in range(2):
        for sign, bound in ((1, 1.0), (-1, 0.0)):
            p, q = sign * (b[c] - a[c]), sign * (bound - a[c])
            if p > 0:
                high = min(high, q / p)
            elif p < 0:
                low = max(low, q / p)
            elif q < 0:
                high = -1.0
    expected = max(high - low, 0.0) * np.linalg.norm(b - a)
    middle = a + 0.5 * (low + high) * (b - a)
    if distance_to_outline(middle[None], SQUARE)[0] > 1e-8:
        # a part that runs along the boundary (within 1e-9) is none: at either end, beside a corner
        # that a line of slope m passes, one of length m, 1e-9 = m² / 2 off in its middle
        assert length(inner_parts(np.array([a, b]), SQUARE)) == pytest.approx(expected, abs=1e-4)


def test_winding_decides_inside_for_both_orientations():
    points = np.array([[0.5, 0.5], [1.5, 1.5], [2.5, 1.5], [-0.1, 0.5]])
    assert inside_polygon(points, NOTCHED).tolist() == [True, False, True, False]
    assert inside_polygon(points, NOTCHED[::-1]).tolist() == [True, False, True, False]


def test_overlap_is_the_shared_length_and_a_crossing_has_none():
    level = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert overlap_length(level, np.array([[0.75, 0.0], [2.0, 0.0]])) == pytest.approx(0.25)
    assert overlap_length(level, np.array([[2.0, 0.0], [-1.0, 0.0]])) == pytest.approx(1.0)
    assert overlap_length(level, np.array([[0.5, -1.0], [0.5, 1.0]])) == 0.0
    assert overlap_length(level, np.array([[1.0, 0.0], [2.0, 0.0]])) == 0.0
    # 1/3 + 1/3 + … is a unit of the last place beyond, as sums are
    one = np.array([[0.1, 0.5], [0.30000000000000004, 0.5]])
    assert overlap_length(one, np.array([[0.3, 0.5], [0.7, 0.5]])) == 0.0
    np.testing.assert_allclose(points_along(NOTCHED[:3], 0.5), [2.5, 0.0], atol=1e-15)


def test_the_top_speed_is_of_either_end_of_a_blade():
    path = ToolPathCut(
        kind="tool_path", points=[[0, 0, 0], [0.3, 0, 0], [0.3, 0.4, 0], [0.3, 0.4, 0]],
        times=[0.0, 0.2, 0.5, 0.5], depth=2.0,
        direction=[[0, 0, 1], [0, 0, 1], [0, 3, 4], [0, 3, 4]],
    )  # fmt: skip
    # the other end moves by (0, 0.4 + 1.2, -0.4) in 0.3 s
    assert path.top_speed == pytest.approx(np.hypot(1.6, 0.4) / 0.3)
