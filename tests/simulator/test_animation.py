"""Pictures of a simulated body: lips of a membrane, hooks, a true scale, and films."""

import os
import signal
import stat

import numpy as np
import pytest

from verify.errors import InputError
from verify.simulator.animation import (
    View,
    write_film,
)

VIEW = View(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), 0.2, (400, 300))


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
