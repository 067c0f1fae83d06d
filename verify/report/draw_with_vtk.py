"""Draws bodies with PyVista, off-screen. Run as a program, in a process of its own.

Without a working OpenGL, VTK does not raise an exception: it ends the process. So the report
starts this file as a child and looks at what it has left behind.
"""

import pickle
import sys
from pathlib import Path

import numpy as np
import pyvista
from matplotlib import colormaps

from verify.report.bodies import Body
from verify.report.view import View

__all__ = ["draw", "main"]


def draw(body: Body, view: View, target: Path) -> None:
    """Write a picture of `body` to the PNG file `target`."""
    plotter = pyvista.Plotter(off_screen=True, window_size=list(view.size), lighting="none")
    plotter.background_color = pyvista.Color("white")
    surface = pyvista.PolyData.from_regular_faces(body.points, body.triangles.astype(int))
    surface["values"] = body.values
    plotter.add_mesh(
        surface,
        scalars="values",
        cmap=colormaps[view.colours],
        clim=view.limits,
        show_scalar_bar=False,
        lighting=False,
    )
    x0, x1, y0, y1 = view.window
    lift = 1e-4 * max(x1 - x0, y1 - y0) * np.array(view.towards)  # lines lie on the surface
    for edges, width, colour, opacity in (
        (body.element_edges, 0.8, "black", 0.25),
        (body.edges, 2.6, "#1a1a1a", 1.0),
    ):
        if len(edges):
            segments = np.column_stack([np.full(len(edges), 2), edges]).ravel()
            lines = pyvista.PolyData(body.points + lift, lines=segments)
            plotter.add_mesh(lines, color=colour, line_width=width, opacity=opacity, lighting=False)
    _aim(plotter, body, view)
    plotter.enable_anti_aliasing("ssaa")
    plotter.screenshot(str(target))
    plotter.close()


def main(job: Path) -> None:
    """Draw what the pickled `job`, list of (Body, View, file name), asks for, beside it."""
    for body, view, name in pickle.loads(job.read_bytes()):
        draw(body, view, job.with_name(name))


def _aim(plotter: pyvista.Plotter, body: Body, view: View) -> None:
    x0, x1, y0, y1 = view.window
    towards = np.array(view.towards)
    depth = body.points @ towards
    centre = (x0 + x1) / 2 * np.array(view.right) + (y0 + y1) / 2 * np.array(view.up)
    centre = centre + (depth.min() + depth.max()) / 2 * towards
    distance = float(np.ptp(depth)) + (x1 - x0) + (y1 - y0)
    camera = plotter.camera
    camera.position = tuple(centre + distance * towards)
    camera.focal_point = tuple(centre)
    camera.up = view.up
    camera.parallel_projection = True
    camera.parallel_scale = (y1 - y0) / 2
    camera.clipping_range = (1e-3 * distance, 3 * distance)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
