"""Times of a scene: histories, output times, openings, the state at the beginning."""

import numpy as np
import pytest
from case_texts import body_text, support_text

from verify.errors import InputError
from verify.scene import Rotation, Support, load_scene
from verify.scene.history import factor_at, first_factor, jumps, slope_at

MOVING = (
    body_text("A square", "It shall move.", [1.0, 1.0], [[4, 4]], density="1.0")
    + '[analysis]\nkind = "dynamic"\nduration = 2.0\n'
)
STATIC = MOVING.replace('[analysis]\nkind = "dynamic"\nduration = 2.0\n', "")
HELD = support_text("left", [0, 0])


def load(folder, text):
    (folder / "case.toml").write_text(text)
    return load_scene(folder / "case.toml")


def test_output_times_are_evenly_spaced_and_eleven_unless_said_otherwise(tmp_path):
    assert load(tmp_path, MOVING).analysis.output_times == pytest.approx(np.linspace(0, 2, 11))
    assert load(tmp_path, MOVING + "outputs = 3\n").analysis.output_times == (0.0, 1.0, 2.0)
    assert load(tmp_path, STATIC + HELD).analysis.output_times == (0.0,)


@pytest.mark.parametrize(
    "time, factor, slope",
    [(0.0, 1.0, 0.0), (1.0, 1.0, 2.0), (1.25, 1.5, 2.0), (2.0, -1.0, 0.0), (3.0, -1.0, 0.0)],
)
def test_a_history_is_linear_between_its_times_and_constant_outside(time, factor, slope):
    """After a jump (at 2) the new factor holds; the rate is that of what follows."""
    history = [(1.0, 1.0), (2.0, 3.0), (2.0, -1.0)]
    assert (factor_at(history, time), slope_at(history, time)) == (factor, slope)
    assert (first_factor(history), jumps(history)) == (1.0, [2.0])


def test_a_load_that_jumps_at_the_beginning_was_there_before():
    history = [(0.0, 1.0), (0.0, 0.0)]
    assert (first_factor(history), factor_at(history, 0.0)) == (1.0, 0.0)


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


def test_polylines_that_touch_at_an_end_within_round_off_do_not_lie_on_each_other(tmp_path):
    """1/3 + 1/3 + … is a unit of the last place beyond, as sums are."""
    cuts = ""
    for name, (a, b) in {"one": (0.1, 0.30000000000000004), "two": (0.3, 0.7)}.items():
        cuts += f'[[cuts]]\nkind = "polyline"\nname = "{name}"\npoints = [[{a}, 0.5], [{b}, 0.5]]\n'
    load(tmp_path, STATIC + HELD + cuts)
