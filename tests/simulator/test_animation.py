"""Pictures of a simulated body: lips of a membrane, hooks, a true scale, and films."""

import os
import signal
import stat

import numpy as np
import pytest
from thesis_stages import stage

from verify.errors import InputError
from verify.simulator import Session
from verify.simulator.animation import (
    Frame,
    Underlay,
    View,
    _labelled,
    _lips,
    beside,
    meshes_of,
    scale_length,
    view_of,
    write_film,
)
from verify.simulator.stage import Hook
from verify.simulator.surfaces import Picture
from verify.xfem.cuts import ToolPath

VIEW = View(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), 0.2, (400, 300))


def sheet(gap, cells=4):
    """Return a square sheet of 0.1 m whose inner cut x = 0.05, 0.025 < y < 0.075 gapes."""
    x, y = np.meshgrid(np.linspace(0, 0.1, cells + 1), np.linspace(0, 0.1, cells + 1))
    grid = np.column_stack([x.ravel(), y.ravel(), 0 * x.ravel()])
    triangles = []
    for row in range(cells):
        for column in range(cells):
            a = row * (cells + 1) + column
            b, c, d = a + 1, a + cells + 1, a + cells + 2
            triangles += [(a, b, d), (a, d, c)]
    places = np.array(triangles)
    lip = np.flatnonzero((abs(grid[:, 0] - 0.05) < 1e-9) & (abs(grid[:, 1] - 0.05) < 0.024))
    right = grid[places].mean(axis=1)[:, 0] > 0.05
    doubled = np.arange(len(grid))
    doubled[lip] = len(grid) + np.arange(len(lip))
    places[right] = doubled[places[right]]
    material = np.concatenate([grid, grid[lip]])
    now = material + np.where(np.arange(len(material)) >= len(grid), gap, 0.0)[:, None] * [1, 0, 0]
    ends = np.flatnonzero((abs(grid[:, 0] - 0.05) < 1e-9) & (abs(grid[:, 1] - 0.05) < 0.026))
    left = np.column_stack([ends[:-1], ends[1:]])
    return Picture(now, material, places, np.zeros(32, bool), np.concatenate([left, doubled[left]]))


def test_lips_have_the_thickness_of_the_membrane_and_only_where_it_gapes():
    walls = _lips(sheet(0.01), 0.002, VIEW)
    left, right = 0.05, 2 * np.hypot(0.025, 0.01)
    assert walls.area == pytest.approx(0.002 * (left + right), rel=1e-6)
    assert walls.bounds[4:] == pytest.approx((-0.002, 0.0))  # away from the eye


def test_what_lies_under_a_skin_is_behind_all_of_it_and_has_its_outline():
    from dataclasses import replace

    view = replace(VIEW, underlay=Underlay(sheet(0.0)))
    (bed, *_) = beside(Frame(0.0, sheet(0.01)), view)[0]
    assert bed.bounds[:4] == pytest.approx((0.0, 0.1, 0.0, 0.1))
    assert bed.bounds[5] < -0.1


@pytest.mark.parametrize("off", [0.0, 0.002, -0.002])
def test_a_hook_is_drawn_on_the_lip_that_is_seen(off):
    """Where it grips is known by the mean of the nodes it holds, in any depth."""
    grips = np.array([0.06 + off, 0.05 - off, -0.01])
    frame = Frame(1.0, sheet(0.01), hooks=[(grips, np.array([1.0, 0.0, 0.0]))])
    ((rod, *_),) = beside(frame, VIEW)
    size = 0.16 * VIEW.width  # of the rod; over the lip its end is drawn 0.05 of it inside
    ends = rod.points[np.argsort(rod.points[:, 0])[:4]]
    assert ends[:, 0].min() == pytest.approx(0.06 - 0.05 * size, abs=1e-3)  # its radius
    assert np.abs(ends[:, 1] - 0.05).max() < 1.5e-3


@pytest.mark.parametrize("name", ["face_incision", "hand_straight", "square_dissected"])
def test_the_line_of_a_closed_cut_is_drawn_behind_the_blade_and_nowhere_else(name):
    """Skin in space as a membrane and as a solid, and a plane body: lips that touch are seen."""
    session = Session(stage(name, tolerance=1e-6), account=False)
    paths, edge = session.stage.strokes, session.stage.smoothing / 2.0
    assert len(session.picture().lines) == 0
    while (now := paths[0].travel_at(session.time)) < 0.4 * paths[0].length:
        session.step()
    picture = session.picture()
    ends = picture.material[np.unique(picture.lines)][:, : session.stage.mesh.space]
    apart, _, travel = paths[0].sweep.probed(ends).T
    assert np.abs(apart).max() < 0.1 * edge
    # elements open as the blade comes to the support of one of their nodes
    assert now - edge < travel.max() < now + 3.0 * edge
    assert np.diff(np.sort(travel)).max() < edge
    lines = [mesh for mesh, *_ in meshes_of(Frame(0.0, picture), VIEW) if mesh.n_lines]
    assert [mesh.n_lines for mesh in lines] == [len(picture.lines)]


def test_a_hook_grips_at_the_edge_of_its_cut_wherever_along_the_blade():
    path = ToolPath.of_tip([[0, 0, 0.1], [0.04, 0.03, 0.1]], [0.0, 1.0], [0.0, 0.0, -0.2])
    across = 0.01 * np.array([-0.6, 0.8, 0.0])
    at = np.array([0.02, 0.015, 0.043]) + across
    hook = Hook(at, 0.02, 0, 1, across, False, 0.0, 1.0)
    sample = 0.05 / 99  # of a path of 0.05 m in 100 places
    assert hook.at_edge(path) == pytest.approx(at - across, abs=sample / 2)


def test_a_near_view_is_about_what_the_hooks_hold_apart():
    hooks = [
        (np.array([0.03, 0.02, 0.0]), np.eye(3)[0]),
        (np.array([0.05, 0.04, 0.0]), np.eye(3)[1]),
    ]
    frames = [Frame(0.0, sheet(0.0)), Frame(1.0, sheet(0.01), hooks=hooks)]
    far, near = view_of(frames), view_of(frames, zoom=2.0)
    assert near.width == pytest.approx(far.width / 2)
    assert near.centre == pytest.approx([0.04, 0.03, 0.0])


@pytest.mark.parametrize(("width", "length"), [(0.2, 0.02), (0.28, 0.05), (1.0, 0.2), (0.5, 0.1)])
def test_the_scale_is_a_round_length_of_its_true_size(width, length):
    assert scale_length(width) == pytest.approx(length)
    from dataclasses import replace

    view = replace(VIEW, width=width)
    blank = np.full((300, 400, 3), 255, dtype=np.uint8)
    image = _labelled(blank, Frame(1.5, sheet(0.0)), view)
    row = (image[285, :200].sum(axis=1) == 0).sum()
    assert row == pytest.approx(length / width * 300, abs=3)
    assert (image[:, 250:] < 100).any()  # the time


def fake_ffmpeg(folder, script):
    program = folder / "ffmpeg"
    program.write_text(f"#!/bin/sh\nfor last; do :; done\n{script}\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)


def test_a_film_is_written_by_ffmpeg_whole_or_not_at_all(tmp_path, monkeypatch):
    images = [np.full((300, 400, 3), k, dtype=np.uint8) for k in range(3)]
    monkeypatch.setattr("verify.simulator.animation._draw", lambda frames, view: images)
    monkeypatch.setenv("PATH", str(tmp_path))
    film = tmp_path / "a.mp4"
    with pytest.raises(InputError, match="ffmpeg"):
        write_film([], VIEW, film, 10.0)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.defpath}")
    fake_ffmpeg(tmp_path, 'echo "no room" >&2; exit 1')
    # PETSc, where it is loaded, ends a process that writes into a pipe that nobody reads
    handler = signal.signal(signal.SIGPIPE, signal.SIG_DFL)
    try:
        with pytest.raises(InputError, match="no room"):
            write_film([], VIEW, film, 10.0)
    finally:
        signal.signal(signal.SIGPIPE, handler)
    assert not film.exists()
    fake_ffmpeg(tmp_path, 'cat > "$last"')
    write_film([], VIEW, film, 10.0)
    assert film.read_bytes() == b"".join(image.tobytes() for image in images)
