"""The window of ``verify play --window``: its mouse is driven through the interactor's events."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image
from thesis_stages import CASES

from verify.cli import main
from verify.scene import load_scene
from verify.simulator import animation
from verify.simulator.animation import Frame, PlayWindow, place_in_sight, write_picture
from verify.simulator.stage import stage_of
from verify.simulator.surfaces import Picture


def _two_sheets() -> Picture:
    """Squares of two triangles at z = 1 and z = 0, drawn 3 to the right of where they are."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    material = np.concatenate([np.c_[square, np.full(4, z)] for z in (1.0, 0.0)])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    moved, nothing = material + np.array([3.0, 0.0, 0.0]), np.empty((0, 2), dtype=np.int64)
    return Picture(moved, material, triangles, np.zeros(4, bool), nothing)


def test_sight_meets_the_nearest_skin_and_says_its_place_in_the_uncut_body() -> None:
    at, down = (0.2, 0.7), np.array([0.0, 0.0, -2.0])
    eye = np.array([at[0] + 3.0, at[1], 5.0])
    place = place_in_sight(_two_sheets(), eye, down)
    np.testing.assert_allclose(place, [*at, 1.0], atol=1e-14)
    from_below = place_in_sight(_two_sheets(), eye - [0, 0, 9.0], -down)
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


def test_the_left_button_cuts_and_writes_all_strokes_also_one_under_way_as_the_window_is_closed(
    window, tmp_path, monkeypatch, capsys
) -> None:
    said = [a.GetText(2) for a in window.plotter.actors.values() if hasattr(a, "GetText")]
    assert any("stroke.toml" in text for text in said)  # before the first stroke
    eye, file = np.array(window.plotter.camera.position), tmp_path / "stroke.toml"
    for x in (280, 350):
        _send(window, "LeftButtonPressEvent", x, 430)
        for y in range(420, 250, -20):
            _send(window, "MouseMoveEvent", x, y)
            window.tick()
        if x == 280:
            _send(window, "LeftButtonReleaseEvent", x, 250)
            window.tick()
            assert file.read_text().startswith('[[cuts]]\nkind = "tool_path"')
    assert window.session.cutter.body.split_cells.any()
    np.testing.assert_array_equal(window.plotter.camera.position, eye)  # it does not turn the body
    # each place touched is in the middle of a blade, on the surface of the block that is seen
    places, box = window.scalpel.finished[0].blades.mean(axis=1), window.session.stage.mesh.points
    outside = np.minimum(places - box.min(axis=0), box.max(axis=0) - places).min(axis=1)
    np.testing.assert_allclose(outside, 0.0, atol=1e-9)
    window.plotter.show = lambda: None  # the loop of events, in which the user closes it
    monkeypatch.setattr(animation, "PlayWindow", lambda *_: window)
    monkeypatch.setattr(animation, "display_is_open", lambda: True)
    monkeypatch.setenv("DISPLAY", ":0")
    command = ["play", str(CASES / "block_cut_once.toml"), "--window", "--stroke", str(file)]
    assert main(command) == 0
    assert f"strokes of the mouse: 2, in {file}" in capsys.readouterr().out
    assert re.findall(r'name = "(.*)"', file.read_text()) == ["stroke_1", "stroke_2"]
    window.scalpel.finished.clear()
    assert main(command) == 0
    assert "no stroke was made" in capsys.readouterr().out


@pytest.mark.graphics
def test_the_window_shows_what_a_picture_shows(tmp_path) -> None:
    """A gaping wound: fat below it, its lips, its hooks, in the same colours at the same pixels."""
    stage = stage_of(load_scene(CASES / "hand_straight.toml"))
    stage = replace(stage, hooks=[replace(hook, begin=1.0) for hook in stage.hooks], tolerance=1e-4)
    window = PlayWindow(stage, "hand", tmp_path / "stroke.toml", off_screen=True)
    session = window.session
    while session.time < 1.8:
        session.step()
    window.tick()
    window.plotter.show(auto_close=False)
    seen = np.array(window.plotter.screenshot(return_img=True), dtype=int)
    now = Frame(session.time, session.picture(), session.blades(), session.hooks())
    write_picture(now, window.view, tmp_path / "now.png")
    with Image.open(tmp_path / "now.png") as image:
        drawn = np.asarray(image.convert("RGB"), dtype=int)
    window.plotter.close()
    middle = slice(100, 540)
    assert np.abs(seen - drawn).max(axis=2)[middle, middle].mean() < 0.5
    fat = (drawn[..., 2] < 0.6 * drawn[..., 0]) & (drawn[..., 1] > 0.6 * drawn[..., 0])
    assert fat[middle, middle].sum() > 200


def test_a_display_that_cannot_be_opened_is_an_error_of_one_line(tmp_path) -> None:
    environment = {**os.environ, "DISPLAY": ":4711"}
    environment.pop("WAYLAND_DISPLAY", None)
    command = [sys.executable, "-m", "verify", "play", str(CASES / "triangle.toml"), "--window"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2, done.stderr
    (line,) = done.stderr.splitlines()
    assert "display ':4711' cannot be opened; use --out FILE.gif" in line
    assert not done.stdout
