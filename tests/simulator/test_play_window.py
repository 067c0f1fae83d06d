"""The window of ``verify play --window``: its mouse is driven through the interactor's events."""

import numpy as np
import pytest
from thesis_stages import CASES

from verify.scene import load_scene
from verify.simulator.animation import PlayWindow, place_in_sight
from verify.simulator.stage import stage_of
from verify.simulator.surfaces import Picture


def _two_sheets(inner: bool) -> Picture:
    """Squares of two triangles at z = 1 and z = 0, drawn 3 to the right of where they are."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    material = np.concatenate([np.c_[square, np.full(4, z)] for z in (1.0, 0.0)])
    half = np.array([[0, 1, 2], [0, 2, 3]])
    triangles = np.concatenate([half, half + 4])
    return Picture(
        material + np.array([3.0, 0.0, 0.0]),
        material,
        triangles,
        np.array([inner, inner, False, False]),
    )


@pytest.mark.parametrize("at", [(0.2, 0.7), (0.9, 0.1), (0.5, 0.5)])
def test_sight_meets_the_nearest_skin_and_says_its_place_in_the_uncut_body(at) -> None:
    eye, down = np.array([at[0] + 3.0, at[1], 5.0]), np.array([0.0, 0.0, -2.0])
    place = place_in_sight(_two_sheets(inner=False), eye, down)
    np.testing.assert_allclose(place, [*at, 1.0], atol=1e-14)
    from_below = place_in_sight(_two_sheets(inner=False), eye - [0, 0, 9.0], -down)
    np.testing.assert_allclose(from_below, [*at, 0.0], atol=1e-14)


@pytest.fixture
def window(tmp_path):
    stage = stage_of(load_scene(CASES / "block_cut_once.toml"))
    bare = type(stage)(**{**vars(stage), "strokes": [], "hooks": [], "visual": None})
    window = PlayWindow(bare, "block", tmp_path / "stroke.toml", off_screen=True)
    window.plotter.show(auto_close=False)
    yield window
    window.plotter.close()


def _send(window, event: str, x: float, y: float) -> None:
    interactor = window.plotter.iren.interactor
    interactor.SetEventInformation(int(x), int(y))
    interactor.InvokeEvent(event)


def test_the_left_button_cuts_and_writes_its_stroke_and_does_not_turn_the_body(
    window, tmp_path
) -> None:
    eye = np.array(window.plotter.camera.position)
    _send(window, "LeftButtonPressEvent", 320, 430)
    for y in range(420, 250, -10):
        _send(window, "MouseMoveEvent", 320, y)
        window.tick()
    _send(window, "LeftButtonReleaseEvent", 320, 250)
    window.tick()
    assert window.session.cutter.body.split_cells.any()
    np.testing.assert_array_equal(window.plotter.camera.position, eye)
    path = window.scalpel.finished[0]
    assert (tmp_path / "stroke.toml").read_text().startswith('[[cuts]]\nkind = "tool_path"')
    # each place touched is in the middle of a blade, on the surface of the block that is seen
    places = path.blades.mean(axis=1)
    box = window.session.stage.mesh.points
    outside = np.minimum(places - box.min(axis=0), box.max(axis=0) - places).min(axis=1)
    np.testing.assert_allclose(outside, 0.0, atol=1e-9)
