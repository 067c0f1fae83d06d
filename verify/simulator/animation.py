"""Pictures of a played scene: frames drawn off-screen, their animation, and a window.

What lies under a skin, the depth of the lips of a membrane and the shapes of scalpel and hooks are
drawn and not simulated. In the window the mouse leads the blade: what it points at, strokes that
cut as it goes, and these as cuts of a case. Pictures and window are drawn by the same code.
"""

import io
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from verify.errors import InputError
from verify.files import whole_file, write_whole
from verify.simulator.session import Session
from verify.simulator.stage import Stage
from verify.simulator.surfaces import Picture
from verify.xfem.arrays import Floats, XfemError
from verify.xfem.cuts import ToolPath

_SKIN, _FLESH, _FAT, _STEEL, _LINE = "#e8b79b", "#a8322a", "#e8bf62", "#8b98a5", "#6e1410"
_LIFT = 0.002  # of the width that is seen: so much lines of cuts lie above the skin
_BED = 1.0  # of the width that is seen, along the line of sight: behind every fold of a skin
_SHAFT, _ROUND = 0.16, 0.005  # length and radius of instruments, of that width
_SHEET = 0.6  # height over width below which a body is one
_SHARP = 40.0  # degrees: edges beyond that are drawn as edges


@dataclass(frozen=True)
class Frame:
    """A frame of the animation: the body, the blades as held, the hooks where they grip.

    A blade is its tip and its other end, a hook its place and the direction in which it draws.
    """

    time: float
    picture: Picture
    blades: Sequence[tuple[Floats, Floats]] = ()
    hooks: Sequence[tuple[Floats, Floats]] = ()


@dataclass(frozen=True)
class Underlay:
    """Background of a skin: the uncut body at rest; a membrane's `thickness`, m."""

    picture: Picture
    thickness: float = 0.0

    @cached_property
    def mesh(self) -> Any:
        """Surface for PyVista."""
        return _polydata(self.picture, ~self.picture.inner).clean()


@dataclass(frozen=True)
class View:
    """From where a scene is looked at.

    Attributes
    ----------
    centre : (3,) float array
        m.
    towards : (3,) float array
        From the centre to the eye.
    up : (3,) float array
    width : float
        Of what must be seen, m.
    size : (int, int)
        Pixels.
    """

    centre: Floats
    towards: Floats
    up: Floats
    width: float
    size: tuple[int, int] = (640, 640)
    underlay: Underlay | None = None


def view_of(frames: Sequence[Frame], skin: float | None = None, zoom: float = 1.0) -> View:
    """Choose a view that holds the first and the last frame.

    Below a `skin` (`Stage.skin`) its first frame is drawn as what lies under it. With `zoom` above
    1 the camera is so many times as near. It looks at the gap between the hooks of the last frame,
    else at its blades, else at the middle. A plane body is looked at from above its plane, a sheet
    almost so, a block from a corner.
    """
    points = np.concatenate([frames[k].picture.points for k in (0, -1)])
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high[2] == low[2]
    sheet = high[2] - low[2] < _SHEET * (high[:2] - low[:2]).min()
    eye = np.array((0, 0, 1.0) if flat else (0.25, -0.45, 1.0) if sheet else (0.6, -0.9, 0.7))
    up = np.array([0.0, 1.0, 0.0]) if abs(eye[2]) >= 0.5 * np.linalg.norm(eye) else np.eye(3)[2]
    centre, width = 0.5 * (low + high), float(np.linalg.norm(high - low)) / zoom
    held = frames[-1].hooks or frames[-1].blades
    if zoom > 1.0 and held:
        places = np.mean([place for place, _ in held], axis=0)
        centre = np.pad(places, (0, 3 - len(places)))
    under = Underlay(frames[0].picture, skin) if skin is not None else None
    return View(centre, eye / np.linalg.norm(eye), up, width, underlay=under)


def write_picture(frame: Frame, view: View, path: Path) -> None:
    """Draw one frame into a PNG file."""
    made = io.BytesIO()
    Image.fromarray(_draw([frame], view)[0]).save(made, format="PNG")
    write_whole(path, made.getvalue())


def write_animation(frames: Sequence[Frame], view: View, path: Path, per_second: float) -> None:
    """Draw all frames into a GIF file, in one step.

    Parameters
    ----------
    frames : sequence of Frame
    view : View
    path : Path
    per_second : float
        Frames shown in a second.
    """
    images = [Image.fromarray(image) for image in _draw(frames, view)]
    # one palette, of the first, the middle and the last: a flicker between palettes is seen
    width, height = images[0].size
    chosen = Image.new("RGB", (width, 3 * height))
    for k, image in enumerate((images[0], images[len(images) // 2], images[-1])):
        chosen.paste(image, (0, k * height))
    palette = chosen.quantize(256, method=Image.Quantize.MEDIANCUT)
    first, *rest = (image.quantize(palette=palette) for image in images)
    made = io.BytesIO()  # written by itself, Pillow does not say that the disk is full
    first.save(
        made,
        format="GIF",
        save_all=True,
        append_images=rest,
        duration=max(20, round(1000.0 / per_second)),
        loop=0,
    )
    write_whole(path, made.getvalue())


def write_film(frames: Sequence[Frame], view: View, path: Path, per_second: float) -> None:
    """Draw all frames into an MP4 file (H.264), by a program ``ffmpeg`` in the path.

    Raises
    ------
    InputError
        If there is none, or it fails.
    """
    if (program := shutil.which("ffmpeg")) is None:
        raise InputError("MP4 needs the program ffmpeg, which is not in the path; or use .gif")
    with whole_file(path) as partial:
        command = [
            program, "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24",
            "-s", f"{view.size[0]}x{view.size[1]}", "-r", f"{per_second:g}", "-i", "-",
            "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(partial),
        ]  # fmt: skip
        with tempfile.TemporaryFile() as raw:  # a pipe that it closes kills a process with PETSc
            raw.writelines(image.tobytes() for image in _draw(frames, view))
            raw.seek(0)
            done = subprocess.run(command, stdin=raw, capture_output=True)
        if done.returncode:
            said = done.stderr.decode(errors="replace").strip().splitlines() or ["no reason given"]
            raise InputError(f"ffmpeg failed: {said[-1]}", str(path))


def _draw(frames: Sequence[Frame], view: View) -> list[NDArray[np.uint8]]:
    import pyvista
    from vtkmodules.vtkCommonCore import vtkLogger

    # without a display VTK warns that there is none, and then draws all the same
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    plotter = pyvista.Plotter(off_screen=True, window_size=list(view.size))
    plotter.background_color = pyvista.Color("white")
    images = []
    for frame in frames:
        look(plotter.camera, view)
        show(plotter, frame, view)
        plotter.render()
        images.append(_labelled(np.array(plotter.screenshot(return_img=True)), frame, view))
    plotter.close()
    return images


def show(plotter: Any, frame: Frame, view: View) -> None:
    """Put a frame in the place of what a plotter of PyVista shows; not rendered yet."""
    plotter.clear_actors()
    for mesh, colour, smooth in [*meshes_of(frame, view), *beside(frame, view)]:
        plotter.add_mesh(
            mesh, color=colour, smooth_shading=smooth, split_sharp_edges=smooth,
            feature_angle=_SHARP, specular=0.15, reset_camera=False, render=False, line_width=3.0,
        )  # fmt: skip
    plotter.reset_camera_clipping_range()


def look(camera: Any, view: View) -> None:
    """Let a camera of PyVista look from where a view does."""
    camera.focal_point, camera.up = view.centre, view.up
    camera.position = view.centre + 2.0 * view.width * view.towards
    camera.parallel_projection, camera.parallel_scale = True, 0.5 * view.width


def meshes_of(frame: Frame, view: View) -> list[tuple[Any, str, bool]]:
    """Make meshes for PyVista: skin, faces of cuts, their lines; colour; if shaded smoothly."""
    import pyvista

    picture, found = frame.picture, []
    for inner, colour in ((False, _SKIN), (True, _FLESH)):
        chosen = picture.inner == inner
        if chosen.any():
            mesh = _polydata(picture, chosen)
            found.append((mesh if inner else mesh.clean(), colour, not inner))
    if len(picture.lines):
        used, place = np.unique(picture.lines, return_inverse=True)
        points = picture.points[used] + _LIFT * view.width * view.towards
        lines: Any = np.pad(place.reshape(-1, 2), ((0, 0), (1, 0)), constant_values=2)
        found.append((pyvista.PolyData(points, lines=lines.ravel()), _LINE, False))
    return found


def _polydata(picture: Picture, chosen: NDArray[np.bool_]) -> Any:
    import pyvista

    used, place = np.unique(picture.triangles[chosen], return_inverse=True)
    triangles: Any = place.reshape(-1, 3)
    return pyvista.PolyData.from_regular_faces(picture.points[used], triangles)


def beside(frame: Frame, view: View) -> list[tuple[Any, str, bool]]:
    """Make meshes that are drawn and not simulated: tissue under a skin, lips, instruments."""
    import pyvista

    found: list[tuple[Any, str, bool]] = []
    if view.underlay is not None:
        found.append((view.underlay.mesh.translate(-_BED * view.width * view.towards), _FAT, True))
        if view.underlay.thickness and len(frame.picture.lines):
            found.append((_lips(frame.picture, view.underlay.thickness, view), _FLESH, False))
    for tip, end in frame.blades:
        ends = [np.pad(point, (0, 3 - len(point))) for point in (tip, end)]
        if (ends[0] != ends[1]).any():
            found.append((_tube(ends, view), _STEEL, True))
    for place, way in frame.hooks:
        out = way / (np.linalg.norm(way) or 1.0) - (way @ view.towards) * view.towards
        out = out / (np.linalg.norm(out) or 1.0)
        size = _SHAFT * view.width
        turns = ((-0.05, 0.0), (0.0, -0.03), (0.06, 0.04), (0.3, 0.12), (1.0, 0.3))
        edge = _on_edge(np.pad(place, (0, 3 - len(place))), frame.picture, view)
        bent = [edge + size * (a * out + b * view.towards) for a, b in turns]
        found.append((_tube(pyvista.Spline(np.array(bent), 40).points, view), _STEEL, True))
    return found


def _on_edge(place: Floats, picture: Picture, view: View) -> Floats:
    """Find where a hook grips on the lines of cuts: the nearest, of these the one that is seen."""
    if not len(picture.lines):
        return place
    points = picture.points[np.unique(picture.lines)]
    away = points - place
    height = away @ view.towards
    aside = np.linalg.norm(away - height[:, None] * view.towards, axis=1)
    near = np.flatnonzero(aside <= aside.min() + _LIFT * view.width)
    return np.asarray(points[near[np.argmax(height[near])]])


def _lips(picture: Picture, thickness: float, view: View) -> Any:
    """Make walls of the depth of a membrane below the lines of its cuts."""
    import pyvista

    triangles: Any = picture.triangles
    mesh = pyvista.PolyData.from_regular_faces(picture.points, triangles)
    mesh = mesh.compute_normals(cell_normals=False, split_vertices=False, consistent_normals=False)
    ends, edges = np.unique(picture.lines, return_inverse=True)
    edges = edges.reshape(-1, 2)
    normals = mesh["Normals"][ends]
    normals = normals * np.where(normals @ view.towards < 0.0, -1.0, 1.0)[:, None]
    points = np.concatenate([picture.points[ends], picture.points[ends] - thickness * normals])
    walls: Any = np.column_stack([edges, edges[:, ::-1] + len(ends)])
    return pyvista.PolyData.from_regular_faces(points, walls)


def _tube(points: Any, view: View) -> Any:
    import pyvista

    return pyvista.MultipleLines(np.asarray(points)).tube(radius=_ROUND * view.width)


def _labelled(image: NDArray[np.uint8], frame: Frame, view: View) -> NDArray[np.uint8]:
    """Write the time into an image, and a scale that is true across the line of sight."""
    drawn = Image.fromarray(image)
    pen = ImageDraw.Draw(drawn)
    font = ImageFont.load_default(0.028 * view.size[1])
    left, below = 0.04 * view.size[0], 0.95 * view.size[1]
    length = scale_length(view.width)
    end = left + length / view.width * view.size[1]  # the camera sees the width from top to bottom
    pen.line([(left, below), (end, below)], fill="black", width=4)
    said = f"{1e3 * length:g} mm" if length < 0.1 else f"{length:g} m"
    pen.text((left, below - 6), said, fill="black", font=font, anchor="lb")
    pen.text((0.96 * view.size[0], below), f"t = {frame.time:.2f} s", fill="black", font=font,
             anchor="rb")  # fmt: skip
    return np.asarray(drawn)


def scale_length(width: float) -> float:
    """Return the length 1, 2 or 5 times a power of ten that is at most a fifth of `width`, m."""
    power = 10.0 ** np.floor(np.log10(width / 5.0))
    return float(max(m * power for m in (1.0, 2.0, 5.0) if m * power <= width / 5.0))


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


def stroke_text(path: ToolPath, name: str) -> str:
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


def write_strokes(paths: Sequence[ToolPath], file: Path) -> None:
    """Write strokes as cuts of a case into a file, in one step."""
    write_whole(file, "\n".join(stroke_text(p, f"stroke_{n}") for n, p in enumerate(paths, 1)))


def _row(values) -> str:  # type: ignore[no-untyped-def]
    return f"[{', '.join(repr(float(f'{value:.9g}')) for value in values)}]"


def _table(rows) -> str:  # type: ignore[no-untyped-def]
    return "[\n" + "".join(f"    {_row(row)},\n" for row in rows) + "]"


def display_is_open() -> bool:
    """Whether a window can be opened: without a display VTK draws off-screen and says nothing."""
    from vtkmodules import vtkRenderingOpenGL2  # noqa: F401 - makes windows
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkRenderingCore import vtkRenderWindow

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)
    return not re.match(r"vtk(EGL|OS|OSMesa)", vtkRenderWindow().GetClassName())


def play_in_window(stage: Stage, title: str, stroke_file: Path) -> tuple[float, int]:
    """Play until the window is closed; strokes of the mouse are written to a file as they end.

    Returns
    -------
    (float, int)
        Time of the scene then, s, and how many strokes were made.
    """
    window = PlayWindow(stage, title, stroke_file)
    milliseconds = max(1, round(1e3 * stage.time_step))
    window.plotter.add_timer_event(
        max_steps=10**9, duration=milliseconds, callback=lambda _: window.tick()
    )
    window.plotter.show()
    window.lift()
    return window.session.time, len(window.scalpel.finished)


class PlayWindow:
    """The window: left button cuts, right button turns, wheel comes nearer.

    Parameters
    ----------
    stage : Stage
    title : str
    stroke_file : Path
        Where the strokes of the mouse are written, all again as one ends.
    off_screen : bool
        Without a display, for tests: events are then sent to `plotter.iren.interactor`.

    Attributes
    ----------
    plotter : pyvista.Plotter
    session : Session
    scalpel : LiveScalpel
    view : View
        That from which it is looked at first.
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
        self.view = view = view_of([frame, frame], skin=stage.skin)
        self.scalpel = LiveScalpel(self.session, _DEPTH * view.width)
        self.plotter: Any = pyvista.Plotter(
            title=title, window_size=list(view.size), off_screen=off_screen
        )
        self.plotter.background_color = pyvista.Color("white")
        self._stroke_file, self._down, self._written = stroke_file, False, 0
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
        show(self.plotter, frame, self.view)
        records = self.session.records
        cost = f", step {1e3 * sum(records[-1].seconds.values()):.1f} ms" if records else ""
        self.plotter.add_text(
            f"{frame.time:.2f} s{cost}{self._force()}\n"
            f"left: cut (into {self._stroke_file.name}), right: turn, wheel: nearer",
            font_size=9, color="black", render=False,
        )  # fmt: skip

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
        self.lift()

    def lift(self) -> None:
        """End the stroke under way, and write all there are."""
        self.scalpel.lift()
        if len(self.scalpel.finished) > self._written:
            self._written = len(self.scalpel.finished)
            write_strokes(self.scalpel.finished, self._stroke_file)

    def _cut(self) -> None:
        x, y = self.plotter.iren.interactor.GetEventPosition()
        near, far = (self._seen_at(x, y, depth) for depth in (0.0, 1.0))
        place = place_in_sight(self.session.picture(), near, far - near)
        if place is not None:
            self.scalpel.touch(place, far - near)

    def _seen_at(self, x: int, y: int, depth: float) -> Floats:
        """Find the point (3,) of space behind a pixel: 0 is the near end of the view."""
        renderer = self.plotter.renderer
        renderer.SetDisplayPoint(x, y, depth)
        renderer.DisplayToWorld()
        point = np.array(renderer.GetWorldPoint())
        return np.asarray(point[:3] / point[3])
