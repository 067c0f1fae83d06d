"""Draws bodies without OpenGL: what a report falls back to where VTK cannot render."""

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from numpy.typing import NDArray

from verify.report.bodies import Body
from verify.report.view import View

__all__ = ["draw"]

_DPI = 100


def draw(body: Body, view: View, target: Path) -> None:
    """Write a picture of `body` to the PNG file `target`, seen as VTK would show it."""
    figure = Figure(figsize=(view.size[0] / _DPI, view.size[1] / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    places = view.projected(body.points)
    if np.ptp(body.points[:, 2]) == 0 and len(body.values) == len(body.points):
        axes.tripcolor(
            Triangulation(places[:, 0], places[:, 1], body.triangles),
            body.values,
            shading="gouraud",
            cmap=view.colours,
            vmin=view.limits[0],
            vmax=view.limits[1],
        )
    else:
        axes.add_collection(_painted(body, view, places))
    for edges, width, colour, opacity in (
        (body.element_edges, 0.5, "black", 0.25),
        (_seen(body, places), 1.6, "#1a1a1a", 1.0),
    ):
        segments = list(places[edges][:, :, :2])
        axes.add_collection(
            LineCollection(segments, linewidths=width, colors=colour, alpha=opacity)
        )
    axes.set_xlim(view.window[0], view.window[1])
    axes.set_ylim(view.window[2], view.window[3])
    figure.savefig(target, format="png", facecolor="white")


def _painted(body: Body, view: View, places: NDArray[np.float64]) -> PolyCollection:
    """Return the triangles from the farthest to the nearest, each in its mean colour."""
    order = np.argsort(places[body.triangles][:, :, 2].mean(axis=1))
    per_triangle = body.values
    if len(body.values) == len(body.points):
        per_triangle = body.values[body.triangles].mean(axis=1)
    painted = PolyCollection(
        list(places[body.triangles[order]][:, :, :2]),
        cmap=view.colours,
        edgecolors="face",
        linewidths=0.3,
    )
    painted.set_array(per_triangle[order])
    painted.set_clim(*view.limits)
    return painted


def _seen(body: Body, places: NDArray[np.float64]) -> NDArray[np.int64]:
    """Leave out lines on the far half of a solid: nothing here hides them."""
    depth = places[:, 2]
    if np.ptp(depth) == 0:
        return body.edges
    return body.edges[depth[body.edges].mean(axis=1) > depth.mean()]
