"""A played scene in a window, with the mouse as the scalpel."""

from pathlib import Path
from typing import Any

import numpy as np

from verify.replay.animation import Frame, meshes_of, view_of
from verify.replay.live_scalpel import LiveScalpel
from verify.replay.session import Session
from verify.replay.stage import Stage
from verify.replay.stroke_file import write_stroke

__all__ = ["play_in_window"]

_DEPTH = 0.05  # of the body's size: how far the blade reaches from where it touches


def play_in_window(stage: Stage, title: str, stroke_file: Path) -> None:
    """Play until the window is closed; strokes of the mouse are written to a file as they end."""
    import pyvista

    session = Session(stage, account=False)
    frame = Frame(0.0, session.picture(), session.blades())
    view = view_of([frame, frame])
    plotter = pyvista.Plotter(title=title, window_size=list(view.size))
    plotter.background_color = pyvista.Color("white")
    scalpel = LiveScalpel(session, _DEPTH * view.width)
    _Hand(plotter, session, scalpel, stroke_file)

    def tick(_: int) -> None:
        session.step()
        plotter.clear_actors()
        frame = Frame(session.time, session.picture(), session.blades())
        for mesh, colour, smooth in meshes_of(frame):
            plotter.add_mesh(mesh, color=colour, smooth_shading=smooth, reset_camera=False)
        plotter.render()

    plotter.camera.focal_point, plotter.camera.up = view.centre, view.up
    plotter.camera.position = view.centre + 1.5 * view.width * view.towards
    milliseconds = max(1, round(1e3 * stage.time_step))
    plotter.add_timer_event(  # type: ignore[call-arg]
        max_steps=10**9, duration=milliseconds, callback=tick
    )
    plotter.show()


class _Hand:
    """Turns the movements of the mouse into those of the scalpel."""

    def __init__(
        self, plotter: Any, session: Session, scalpel: LiveScalpel, stroke_file: Path
    ) -> None:
        self._plotter, self._session, self._scalpel = plotter, session, scalpel
        self._file, self._down = stroke_file, False
        style = plotter.iren
        style.add_observer("LeftButtonPressEvent", self._press)
        style.add_observer("MouseMoveEvent", self._move)
        style.add_observer("LeftButtonReleaseEvent", self._release)

    def _press(self, *_: Any) -> None:
        self._down = True
        self._move()

    def _move(self, *_: Any) -> None:
        if not self._down:
            return
        camera = self._plotter.camera
        towards = np.array(camera.focal_point) - np.array(camera.position)
        place = _touched(self._session, self._plotter.pick_mouse_position(), towards)
        if place is not None:
            self._scalpel.touch(place, towards)

    def _release(self, *_: Any) -> None:
        self._down = False
        self._scalpel.lift()
        if self._scalpel.finished:
            write_stroke(self._scalpel.finished[-1], self._file)


def _touched(session: Session, near: Any, towards: Any) -> Any:
    """Find the material point of the nearest vertex in sight of a place; None if it is far off."""
    if near is None:
        return None
    picture = session.picture()
    used = np.unique(picture.triangles[~picture.inner])
    away = np.linalg.norm(
        np.cross(picture.points[used] - np.asarray(near), towards / np.linalg.norm(towards)), axis=1
    )
    closest = int(np.argmin(away))
    edge = np.linalg.norm(session.stage.mesh.edge_vectors, axis=2).mean()
    return picture.material[used[closest]] if away[closest] < edge else None
