"""Frames of a played scene, drawn off-screen, and the animation that they make."""

import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from verify.simulator.surfaces import Picture
from verify.whole_files import write_whole

__all__ = ["Frame", "View", "view_of", "write_animation", "write_picture"]

_Floats = NDArray[np.float64]

_SKIN, _FLESH, _BLADE = "#e8b79b", "#a8322a", "#5a6570"
_SHEET = 0.6  # height over width below which a body is one
_SHARP = 40.0  # degrees: edges beyond that are drawn as edges


@dataclass(frozen=True)
class Frame:
    """What is seen at a time: the body, and the blades as they are held."""

    time: float
    picture: Picture
    blades: Sequence[tuple[_Floats, _Floats]] = ()


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

    centre: _Floats
    towards: _Floats
    up: _Floats
    width: float
    size: tuple[int, int] = (640, 640)


def view_of(frames: Sequence[Frame], towards: Sequence[float] | None = None) -> View:
    """Choose a view that holds the first and the last frame.

    A plane body is looked at from above its plane, a sheet almost so, a block from a corner.
    """
    points = np.concatenate([frames[k].picture.points for k in (0, -1)])
    low, high = points.min(axis=0), points.max(axis=0)
    flat = high[2] == low[2]
    sheet = high[2] - low[2] < _SHEET * (high[:2] - low[:2]).min()
    usual = (0.0, 0.0, 1.0) if flat else (0.2, -0.2, 1.0) if sheet else (0.6, -0.9, 0.7)
    eye = np.array(towards if towards is not None else usual)
    up = np.array([0.0, 1.0, 0.0]) if abs(eye[2]) >= 0.5 * np.linalg.norm(eye) else np.eye(3)[2]
    return View(
        0.5 * (low + high), eye / np.linalg.norm(eye), up, float(np.linalg.norm(high - low))
    )


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
    palette = images[-1].quantize(128)
    first, *rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
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
        for mesh, colour, smooth in meshes_of(frame):
            plotter.add_mesh(
                mesh, color=colour, smooth_shading=smooth, split_sharp_edges=smooth,
                feature_angle=_SHARP, specular=0.15, reset_camera=False, render=False,
                line_width=4.0,
            )  # fmt: skip
        plotter.camera.parallel_projection = True
        plotter.camera.focal_point = view.centre
        plotter.camera.position = view.centre + 2.0 * view.width * view.towards
        plotter.camera.up = view.up
        plotter.camera.parallel_scale = 0.5 * view.width
        plotter.reset_camera_clipping_range()
        plotter.render()
        images.append(np.array(plotter.screenshot(return_img=True)))
    plotter.close()
    return images


def meshes_of(frame: Frame) -> list[tuple[Any, str, bool]]:
    """Meshes of a frame for PyVista: skin, faces of cuts, blades; colour; if shaded smoothly."""
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
    for tip, end in frame.blades:
        ends = [np.pad(point, (0, 3 - len(point))) for point in (tip, end)]
        if (ends[0] != ends[1]).any():
            found.append((pyvista.Line(ends[0], ends[1]), _BLADE, False))
    return found
