"""Pictures of a simulated body: lips of a membrane, hooks, a true scale, and films."""

import os
import signal
import stat
from dataclasses import replace

import numpy as np
import pytest
from thesis_stages import stage

from verify.errors import InputError
from verify.simulator import Session
from verify.simulator.animation import (
    Frame,
    View,
    _labelled,
    _lips,
    beside,
    meshes_of,
    scale_length,
    write_film,
)
from verify.simulator.surfaces import Picture
from verify.xfem.mesh import rectangle_mesh

VIEW = View(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), 0.2, (400, 300))


def sheet(gap):
    """Return a square sheet of 0.1 m whose inner cut x = 0.05, 0.025 < y < 0.075 gapes."""
    mesh = rectangle_mesh((4, 4), upper=(0.1, 0.1))
    grid, places = np.pad(mesh.points, ((0, 0), (0, 1))), mesh.cells.copy()
    on_cut, off = abs(grid[:, 0] - 0.05) < 1e-9, abs(grid[:, 1] - 0.05)
    lip = np.flatnonzero(on_cut & (off < 0.024))
    doubled = np.arange(len(grid))
    doubled[lip] = len(grid) + np.arange(len(lip))
    right = grid[places].mean(axis=1)[:, 0] > 0.05
    places[right] = doubled[places[right]]
    material = np.concatenate([grid, grid[lip]])
    now = material + np.where(np.arange(len(material)) >= len(grid), gap, 0.0)[:, None] * [1, 0, 0]
    ends = np.flatnonzero(on_cut & (off < 0.026))
    left = np.column_stack([ends[:-1], ends[1:]])
    return Picture(now, material, places, np.zeros(32, bool), np.concatenate([left, doubled[left]]))


def test_lips_have_the_thickness_of_the_membrane_and_only_where_it_gapes():
    walls = _lips(sheet(0.01), 0.002, VIEW)
    left, right = 0.05, 2 * np.hypot(0.025, 0.01)
    assert walls.area == pytest.approx(0.002 * (left + right), rel=1e-6)
    assert walls.bounds[4:] == pytest.approx((-0.002, 0.0))  # away from the eye


def test_a_hook_is_drawn_on_the_lip_that_is_seen():
    """Where it grips is known by the mean of the nodes it holds, in any depth."""
    grips = np.array([0.062, 0.048, -0.01])
    frame = Frame(1.0, sheet(0.01), hooks=[(grips, np.array([1.0, 0.0, 0.0]))])
    ((rod, *_),) = beside(frame, VIEW)
    size = 0.16 * VIEW.width  # of the rod; over the lip its end is drawn 0.05 of it inside
    ends = rod.points[np.argsort(rod.points[:, 0])[:4]]
    assert ends[:, 0].min() == pytest.approx(0.06 - 0.05 * size, abs=1e-3)  # its radius
    assert np.abs(ends[:, 1] - 0.05).max() < 1.5e-3


@pytest.mark.parametrize("name", ["hand_straight", "square_dissected"])
def test_the_line_of_a_closed_cut_is_drawn_behind_the_blade_and_nowhere_else(name):
    """Skin in space and a plane body: lips that touch are seen."""
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


def test_the_scale_is_a_round_length_of_its_true_size():
    for width, length in ((0.2, 0.02), (0.28, 0.05), (1.0, 0.2), (0.5, 0.1)):
        assert scale_length(width) == pytest.approx(length)
    blank = np.full((300, 400, 3), 255, dtype=np.uint8)
    image = _labelled(blank, Frame(1.5, sheet(0.0)), replace(VIEW, width=0.28))
    row = (image[285, :200].sum(axis=1) == 0).sum()
    assert row == pytest.approx(0.05 / 0.28 * 300, abs=3)
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
