"""A played scene in a window, with the mouse as the scalpel."""

from pathlib import Path
from typing import Any

import numpy as np

from verify.simulator.animation import Frame, beside, look, meshes_of, view_of
from verify.simulator.live_scalpel import LiveScalpel, place_in_sight, write_stroke
from verify.simulator.session import Session
from verify.simulator.stage import Stage
from verify.xfem.arrays import Floats

_DEPTH = 0.05  # of the body's size: how far the blade reaches from where it touches


def play_in_window(stage: Stage, title: str, stroke_file: Path) -> None:
    """Play until the window is closed; strokes of the mouse are written to a file as they end."""
    window = PlayWindow(stage, title, stroke_file)
    milliseconds = max(1, round(1e3 * stage.time_step))
    window.plotter.add_timer_event(
        max_steps=10**9, duration=milliseconds, callback=lambda _: window.tick()
    )
    window.plotter.show()


class PlayWindow:
    """The window: left button cuts, right button turns, wheel comes nearer.

    Parameters
    ----------
    stage : Stage
    title : str
    stroke_file : Path
        Where each stroke of the mouse is written as it ends.
    off_screen : bool
        Without a display, for tests: events are then sent to `plotter.iren.interactor`.

    Attributes
    ----------
    plotter : pyvista.Plotter
    session : Session
    scalpel : LiveScalpel
    """

    def __init__(
        self,
        stage: Stage,
        title: str,
        stroke_file: Path,
        off_screen: bool = False,
    ) -> None:
        import pyvista

        self.session = Session(stage, account=False)
        frame = self._frame()
        self._view = view = view_of([frame, frame])
        self.scalpel = LiveScalpel(self.session, _DEPTH * view.width)
        self.plotter: Any = pyvista.Plotter(
            title=title, window_size=list(view.size), off_screen=off_screen
        )
        self.plotter.background_color = pyvista.Color("white")
        self._stroke_file, self._down = stroke_file, False
        self._take_the_mouse()
        look(self.plotter.camera, view)
        self._draw(frame)

    def tick(self) -> None:
        """Take one step and draw it."""
        self.session.step()
        self._draw(self._frame())
        self.plotter.render()

    def _frame(self) -> Frame:
        session = self.session
        return Frame(session.time, session.picture(), session.blades(), session.hooks())

    def _draw(self, frame: Frame) -> None:
        self.plotter.clear_actors()
        for mesh, colour, smooth in [*meshes_of(frame), *beside(frame, self._view)]:
            self.plotter.add_mesh(
                mesh, color=colour, smooth_shading=smooth, reset_camera=False, render=False
            )
        records = self.session.records
        cost = f", step {1e3 * sum(records[-1].seconds.values()):.1f} ms" if records else ""
        self.plotter.add_text(
            f"{frame.time:.2f} s{cost}\nleft: cut, right: turn, wheel: nearer",
            font_size=9, color="black", render=False,
        )  # fmt: skip
        self.plotter.reset_camera_clipping_range()

    def _take_the_mouse(self) -> None:
        """Give the left button to the scalpel, and turning, which it does usually, to the right.

        A style that finds an observer of an event leaves the event to it.
        """
        from vtkmodules.vtkInteractionStyle import vtkInteractorStyleTrackballCamera

        style: Any = vtkInteractorStyleTrackballCamera()
        style.AddObserver("LeftButtonPressEvent", self._press)
        style.AddObserver("MouseMoveEvent", lambda *_: self._move(style))
        style.AddObserver("LeftButtonReleaseEvent", self._release)
        style.AddObserver("RightButtonPressEvent", lambda *_: self._turn(style))
        style.AddObserver("RightButtonReleaseEvent", lambda *_: style.EndRotate())
        self.plotter.iren.style = style

    def _turn(self, style: Any) -> None:
        style.SetCurrentRenderer(self.plotter.renderer)
        style.StartRotate()

    def _press(self, *_: Any) -> None:
        self._down = True
        self._cut()

    def _move(self, style: Any) -> None:
        if self._down:
            self._cut()
        else:
            style.OnMouseMove()

    def _release(self, *_: Any) -> None:
        self._down = False
        before = len(self.scalpel.finished)
        self.scalpel.lift()
        if len(self.scalpel.finished) > before:
            write_stroke(self.scalpel.finished[-1], self._stroke_file)

    def _cut(self) -> None:
        x, y = self.plotter.iren.interactor.GetEventPosition()
        near, far = (self._seen_at(x, y, depth) for depth in (0.0, 1.0))
        place = place_in_sight(self.session.picture(), near, far - near)
        if place is not None:
            self.scalpel.touch(place, far - near)

    def _seen_at(self, x: int, y: int, depth: float) -> Floats:
        """Find the point (3,) of space behind a pixel: 0 is the near end of what is seen."""
        renderer = self.plotter.renderer
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        point = np.array(renderer.GetWorldPoint())
        return np.asarray(point[:3] / point[3])
