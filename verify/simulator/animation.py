"""Frames of a played scene, drawn off-screen, and the animation that they make.

Drawn, and not simulated: what lies under a skin, the depth of the lips of a membrane, the shapes of
scalpel and hooks.
"""

import io
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont
from scipy.spatial import cKDTree

from verify.errors import InputError
from verify.simulator.surfaces import Picture
from verify.whole_files import whole_file, write_whole
from verify.xfem.arrays import Floats

_SKIN, _FLESH, _FAT, _STEEL = "#e8b79b", "#a8322a", "#e8bf62", "#8b98a5"
_BED = 1.0  # of the width that is seen, along the line of sight: behind every fold of a skin
_SHAFT, _ROUND = 0.16, 0.005  # length and radius of instruments, of that width
_SHEET = 0.6  # height over width below which a body is one
_SHARP = 40.0  # degrees: edges beyond that are drawn as edges


@dataclass(frozen=True)
class Frame:
    """What is seen at a time: the body, the blades as they are held, the hooks where they grip.

    A blade is its tip and its other end, a hook its place and the direction in which it draws.
    """

    time: float
    picture: Picture
    blades: Sequence[tuple[Floats, Floats]] = ()
    hooks: Sequence[tuple[Floats, Floats]] = ()


@dataclass(frozen=True)
class Underlay:
    """What is drawn with a skin: the uncut body at rest, behind it; a membrane's `thickness`, m."""

    picture: Picture
    thickness: float = 0.0


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


def view_of(
    frames: Sequence[Frame],
    towards: Sequence[float] | None = None,
    underlay: Underlay | None = None,
    zoom: float = 1.0,
) -> View:
    """Choose a view that holds the first and the last frame.

    With `zoom` above 1 it is so many times as near, about what the hooks of the last frame hold
    apart, else about its blades, else about the middle. A plane body is looked at from above its
    plane, a sheet almost so, a block from a corner.
    """
    points = np.concatenate([frames[k].picture.points for k in (0, -1)])
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high[2] == low[2]
    sheet = high[2] - low[2] < _SHEET * (high[:2] - low[:2]).min()
    usual = (0.0, 0.0, 1.0) if flat else (0.25, -0.45, 1.0) if sheet else (0.6, -0.9, 0.7)
    eye = np.array(towards if towards is not None else usual)
    up = np.array([0.0, 1.0, 0.0]) if abs(eye[2]) >= 0.5 * np.linalg.norm(eye) else np.eye(3)[2]
    centre, width = 0.5 * (low + high), float(np.linalg.norm(high - low)) / zoom
    held = frames[-1].hooks or frames[-1].blades
    if zoom > 1.0 and held:
        places = np.mean([place for place, _ in held], axis=0)
        centre = np.pad(places, (0, 3 - len(places)))
    return View(centre, eye / np.linalg.norm(eye), up, width, underlay=underlay)


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
        plotter.clear_actors()
        for mesh, colour, smooth in [*meshes_of(frame), *beside(frame, view)]:
            plotter.add_mesh(
                mesh, color=colour, smooth_shading=smooth, split_sharp_edges=smooth,
                feature_angle=_SHARP, specular=0.15, reset_camera=False, render=False,
                line_width=4.0,
            )  # fmt: skip
        look(plotter.camera, view)
        plotter.reset_camera_clipping_range()
        plotter.render()
        images.append(_labelled(np.array(plotter.screenshot(return_img=True)), frame, view))
    plotter.close()
    return images


def look(camera: Any, view: View) -> None:
    """Let a camera of PyVista look from where a view does."""
    camera.focal_point, camera.up = view.centre, view.up
    camera.position = view.centre + 2.0 * view.width * view.towards
    camera.parallel_projection, camera.parallel_scale = True, 0.5 * view.width


def meshes_of(frame: Frame) -> list[tuple[Any, str, bool]]:
    """Meshes of a frame for PyVista: skin and faces of cuts; colour; if shaded smoothly."""
    import pyvista

    picture, found = frame.picture, []
    for inner, colour in ((False, _SKIN), (True, _FLESH)):
        triangles = picture.triangles[picture.inner == inner]
        if len(triangles):
            used, place = np.unique(triangles, return_inverse=True)
            mesh = pyvista.PolyData.from_regular_faces(
                picture.points[used], place.reshape(triangles.shape)
            )
            found.append((mesh if inner else mesh.clean(), colour, not inner))
    return found


def beside(frame: Frame, view: View) -> list[tuple[Any, str, bool]]:
    """Meshes of what is drawn and not simulated: tissue under a skin, lips, instruments."""
    import pyvista

    found: list[tuple[Any, str, bool]] = []
    if view.underlay is not None:
        rest = _outer(view.underlay.picture)
        found.append((rest.translate(-_BED * view.width * view.towards), _FAT, True))
        if view.underlay.thickness:
            found += _lips(_outer(frame.picture), rest, view.underlay.thickness, view)
    for tip, end in frame.blades:
        ends = [np.pad(point, (0, 3 - len(point))) for point in (tip, end)]
        if (ends[0] != ends[1]).any():
            found.append((_tube(ends, view), _STEEL, True))
    for place, way in frame.hooks:
        out = way / (np.linalg.norm(way) or 1.0) - (way @ view.towards) * view.towards
        out = out / (np.linalg.norm(out) or 1.0)
        size = _SHAFT * view.width
        turns = ((-0.05, 0.0), (0.0, -0.03), (0.06, 0.04), (0.3, 0.12), (1.0, 0.3))
        bent = [np.pad(place, (0, 3 - len(place))) + size * (a * out + b * view.towards)
                for a, b in turns]  # fmt: skip
        found.append((_tube(pyvista.Spline(np.array(bent), 40).points, view), _STEEL, True))
    return found


def _outer(picture: Picture) -> Any:
    """Surface of a body without the faces of its cuts; points that coincide are one."""
    import pyvista

    triangles: Any = picture.triangles[~picture.inner]
    mesh = pyvista.PolyData.from_regular_faces(picture.points, triangles)
    mesh["material"] = picture.material
    return mesh.clean()


def _lips(now: Any, rest: Any, thickness: float, view: View) -> list[tuple[Any, str, bool]]:
    """Walls of the depth of a membrane below the borders that are new."""
    import pyvista

    def border(mesh: Any) -> Any:
        return mesh.extract_feature_edges(
            boundary_edges=True, feature_edges=False, manifold_edges=False, non_manifold_edges=False
        )

    mesh = border(now.compute_normals(cell_normals=False, split_vertices=False))
    if not mesh.n_cells:
        return []
    away = cKDTree(border(rest)["material"]).query(mesh["material"])[0]
    edges = mesh.lines.reshape(-1, 3)[:, 1:]
    edges = edges[(away[edges] > 1e-9 * view.width).any(axis=1)]
    if not len(edges):
        return []
    normals = mesh["Normals"] * np.where(mesh["Normals"] @ view.towards < 0.0, -1.0, 1.0)[:, None]
    points = np.concatenate([mesh.points, mesh.points - thickness * normals])
    walls: Any = np.column_stack([edges, edges[:, ::-1] + len(mesh.points)])
    return [(pyvista.PolyData.from_regular_faces(points, walls), _FLESH, False)]


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
