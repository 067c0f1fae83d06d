"""A played scene in a window, with the mouse as the scalpel: a tool led by hand.

What it points at, strokes cut as it goes, and these as cuts of a case.
"""

from pathlib import Path
from typing import Any

import numpy as np

from verify.simulator.animation import Frame, beside, look, meshes_of, view_of
from verify.simulator.session import Session
from verify.simulator.stage import Stage
from verify.simulator.surfaces import Picture
from verify.whole_files import write_whole
from verify.xfem.arrays import Floats
from verify.xfem.cuts import ToolPath
from verify.xfem.errors import XfemError

_STEP = 0.2  # of the mean edge: nearer points of the hand add nothing to the path
_DEPTH = 0.05  # of the body's size: how far the blade reaches from where it touches


class LiveScalpel:
    """Leads the blade of a session.

    Parameters
    ----------
    session : Session
    depth : float
        How far the blade reaches on either side of the point touched, m; not used in the plane.

    Attributes
    ----------
    finished : list of ToolPath
        The strokes that have been ended.
    """

    def __init__(self, session: Session, depth: float) -> None:
        self.session, self.depth = session, depth
        self.finished: list[ToolPath] = []
        self._first: tuple[Floats, float] | None = None
        self._cutting = False
        mesh = session.stage.mesh
        self._step = _STEP * float(np.linalg.norm(mesh.edge_vectors, axis=2).mean())
        self._last: Floats | None = None

    def touch(self, place: Floats, towards: Floats) -> None:
        """Lead the tool to a place of the uncut body (3,), the blade along `towards` (3,).

        A movement that a blade cannot make (it would turn back on its sweep) ends the stroke and
        begins another.
        """
        space = self.session.stage.mesh.space
        here = np.asarray(place, dtype=float)[:space]
        if self._last is not None and np.linalg.norm(here - self._last) < self._step:
            return
        self._last = here
        blade, time = self._blade(here, towards), self.session.time
        if not self._cutting:
            if self._first is not None:
                self._begin(blade, time)
            else:
                self._first = (blade, time)
            return
        try:
            self.session.cutter.extend(blade[None], [time])
        except XfemError:
            self.lift()
            self._first = (blade, time)

    def lift(self) -> None:
        """End the stroke."""
        if self._cutting:
            self.finished.append(self.session.cutter.strokes[-1].path)
        self._first, self._cutting, self._last = None, False, None

    def _begin(self, blade: Floats, time: float) -> None:
        assert self._first is not None
        start, moment = self._first
        # from before the touch, so that nothing of it lies in the past of the cutter
        self.session.begin(ToolPath(np.stack([start, blade]), [min(moment, time), time]))
        self._cutting = True

    def _blade(self, here: Floats, towards: Floats) -> Floats:
        if len(here) == 2:
            return here[None]
        reach = self.depth * np.asarray(towards, dtype=float) / np.linalg.norm(towards)
        return np.stack([here - reach, here + reach])


def place_in_sight(picture: Picture, eye: Floats, towards: Floats) -> Floats | None:
    """Find where a line of sight meets the skin first.

    Parameters
    ----------
    picture : Picture
    eye : (3,) float array
        m; what lies behind it is not seen.
    towards : (3,) float array

    Returns
    -------
    (3,) float array or None
        The place in the uncut body, m; None where only the faces of cuts, or nothing, are met.

    Notes
    -----
    Intersection of a line with triangles by Möller and Trumbore, J. Graphics Tools 2 (1997) 21.
    """
    a, b, c = (picture.points[picture.triangles[:, k]] for k in range(3))
    across = np.cross(towards, c - a)
    volume = np.einsum("ij,ij->i", b - a, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", eye - a, across) / volume
        normal = np.cross(eye - a, b - a)
        v = normal @ towards / volume
        distance = np.einsum("ij,ij->i", c - a, normal) / volume
        met = np.flatnonzero((u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (distance >= 0.0))
    if len(met) == 0:
        return None
    first = met[np.argmin(distance[met])]
    if picture.inner[first]:
        return None
    weights = np.array([1.0 - u[first] - v[first], u[first], v[first]])
    return np.asarray(weights @ picture.material[picture.triangles[first]])


def stroke_text(path: ToolPath, name: str = "stroke") -> str:
    """Say a path of a straight blade as a ``[[cuts]]`` of kind ``tool_path``, in TOML."""
    lines = ["[[cuts]]", 'kind = "tool_path"', f'name = "{name}"']
    tips = path.blades[:, 0]
    lines.append(f"points = {_table(tips)}")
    lines.append(f"times = {_row(path.times)}")
    if path.blades.shape[2] == 3:
        blades = path.blades[:, -1] - tips
        lengths = (blades**2).sum(axis=1) ** 0.5
        lines.append(f"direction = {_table(blades)}")
        lines.append(f"depth = {lengths.max():.9g}")
    return "\n".join(lines) + "\n"


def write_stroke(path: ToolPath, file: Path, name: str = "stroke") -> None:
    """Write it into a file, in one step."""
    write_whole(file, stroke_text(path, name))


def _row(values) -> str:  # type: ignore[no-untyped-def]
    return f"[{', '.join(repr(float(f'{value:.9g}')) for value in values)}]"


def _table(rows) -> str:  # type: ignore[no-untyped-def]
    return "[\n" + "".join(f"    {_row(row)},\n" for row in rows) + "]"


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
            f"{frame.time:.2f} s{cost}{self._force()}\nleft: cut, right: turn, wheel: nearer",
            font_size=9, color="black", render=False,
        )  # fmt: skip
        self.plotter.reset_camera_clipping_range()

    def _force(self) -> str:
        """Say what drives the blades that are under way."""
        session, said = self.session, ""
        for stroke, path in enumerate(session.stage.strokes):
            if session.records and path.times[0] < session.time <= path.times[-1]:
                driving, resistance = (float(x[0]) for x in session.blade_forces(stroke, True))
                against = f", resistance {resistance:.3g} N" if np.isfinite(resistance) else ""
                said += f"\ndriving force {driving:.3g} N{against}"
        return said

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
