"""Pictures of bodies: painted as stills, and packed for views that the reader can turn.

Plane bodies are shaded smoothly, solids facet by facet from the back.
"""

import base64
import io
import json
import math
from typing import Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from PIL import Image

from verify.report.blocks import Drawing
from verify.report.bodies import Body, View
from verify.report.notation import RAISED
from verify.report.plots import drawing

_DPI = 100
_OUTLINE, _ELEMENTS = (0.1, 0.1, 0.1, 1.0), (0.0, 0.0, 0.0, 0.25)
_FACETS = 12_000  # up to which those of solids are split


def draw(body: Body, view: View) -> bytes:
    """Return a picture of `body` as WebP."""
    figure = Figure(figsize=(view.size[0] / _DPI, view.size[1] / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    places = view.projected(body.points)
    if np.ptp(body.points[:, 2]) == 0 and len(body.values) == len(body.points):
        mesh = Triangulation(places[:, 0], places[:, 1], body.triangles)
        axes.tripcolor(mesh, body.values, shading="gouraud", cmap=view.colours,
                       vmin=view.limits[0], vmax=view.limits[1])  # fmt: skip
        for edges, width, colour in ((body.drawn_elements, 0.5, _ELEMENTS),
                                     (body.edges, 1.6, _OUTLINE)):  # fmt: skip
            segments = list(places[edges][:, :, :2])
            axes.add_collection(LineCollection(segments, linewidths=width, colors=[colour]))
    else:
        axes.add_collection(_painted(body, view, places))
    axes.set_xlim(view.window[0], view.window[1])
    axes.set_ylim(view.window[2], view.window[3])
    canvas.draw()
    made = io.BytesIO()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(made, "WEBP", quality=84, method=4)
    return made.getvalue()


def _painted(body: Body, view: View, places: NDArray[np.float64]) -> PolyCollection:
    """Return facets and lines from the farthest to the nearest, so that the near hide the far."""
    if len(body.values) == len(body.points):
        values = body.values[body.triangles]
    else:
        values = np.repeat(body.values[:, None], 3, axis=1)
    facets = np.concatenate([places[body.triangles], values[:, :, None]], axis=2)
    lines = [(places[body.drawn_elements], _ELEMENTS, 0.5), (places[body.edges], _OUTLINE, 1.6)]
    while 4 * len(facets) <= _FACETS:
        facets = _quartered(facets)
        lines = [(_halved(ends), colour, width) for ends, colour, width in lines]
    low, high = view.limits
    shades = (facets[:, :, 3].mean(axis=1) - low) / ((high - low) or 1.0)
    lift = 0.005 * (view.window[1] - view.window[0])  # lines lie on the facets beside them
    kinds = [(facets, colormaps[view.colours](shades), 0.4, 0.0)]
    kinds += [(e, np.tile(colour, (len(e), 1)), width, lift) for e, colour, width in lines]
    shapes = [shape for corners, *_ in kinds for shape in corners[:, :, :2]]
    depth = np.concatenate([corners[:, :, 2].mean(axis=1) + up for corners, _, _, up in kinds])
    colours = np.concatenate([colour for _, colour, _, _ in kinds])
    widths = np.concatenate([np.full(len(corners), width) for corners, _, width, _ in kinds])
    order = np.argsort(depth, kind="stable")
    return PolyCollection(
        [shapes[n] for n in order],
        facecolors=colours[order],
        edgecolors=colours[order],
        linewidths=widths[order],
    )


def _quartered(facets: NDArray[np.float64]) -> NDArray[np.float64]:
    """Split triangles at the middles of their sides: colours get smooth, and hiding exact."""
    a, b, c = np.moveaxis(facets, 1, 0)
    ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
    parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    return np.concatenate([np.stack(part, axis=1) for part in parts])


def _halved(edges: NDArray[np.float64]) -> NDArray[np.float64]:
    a, b = np.moveaxis(edges, 1, 0)
    return np.concatenate([np.stack([a, (a + b) / 2], 1), np.stack([(a + b) / 2, b], 1)])


_LEAST = 1e-300  # below, numbers lose their digits


def colour_bar(view: View, title: str) -> Drawing:
    """Return the scale of `view`'s colours with round numbers below it."""
    high = view.limits[1]
    drawable = math.isfinite(high) and high > _LEAST
    power = math.floor(math.log10(high)) if drawable else 0
    power = 0 if -3 <= power < 4 else power
    top = high / 10.0**power if drawable else 1.0
    with rc_context({"font.size": 9}):
        figure = Figure(figsize=(4.2, 0.55))
        FigureCanvasSVG(figure)
        axes = figure.add_axes((0.06, 0.42, 0.88, 0.2))
        axes.imshow(np.linspace(0, 1, 64)[None], aspect="auto", cmap=view.colours,
                    extent=(0.0, top, 0.0, 1.0), interpolation="nearest")  # fmt: skip
        if view.beyond:  # an arrow of the last colour
            tip = [(1.0, 0.0), (1.04, 0.5), (1.0, 1.0)]
            axes.add_patch(Polygon(tip, transform=axes.transAxes, clip_on=False,
                                   color=colormaps[view.colours](1.0)))  # fmt: skip
        axes.set_yticks([])
        axes.set_xticks(_ticks(top) if drawable else [], [f"{v:.4g}" for v in _ticks(top)]
                        if drawable else [])  # fmt: skip
        unit = f"10{str(power).translate(RAISED)} m" if power else "m"
        axes.set_title(f"{title} ({unit})", fontsize=9, pad=3)
        beyond = " and above" if view.beyond else ""
        words = f"Colours: {title} from 0 to {high:.3g} m{beyond}"
        return drawing(figure, words, "colour-bar")


def _ticks(high: float) -> list[float]:
    """Return four to six round values from 0 to `high`."""
    power = 10.0 ** math.floor(math.log10(high / 4))
    step = next(m * power for m in (1, 2, 2.5, 5, 10) if high / (m * power) <= 5.5)
    return [i * step for i in range(int(high / step * (1 + 1e-9)) + 1)]


_TRIANGLES = 120_000  # of a surface beyond which only the still is shown
_STEPS = 65535


def packed(body: Body, view: View) -> dict[str, str]:
    """Return the attributes of the element that ``turntable.js`` makes a view of.

    Places and values are 16-bit shares of their ranges. The triangles of the outer surface come
    first, then those of the faces of cuts.

    Returns
    -------
    dict of str to str
        Empty for a plane body, one too large, or one with values per triangle.
    """
    flat = np.ptp(body.points[:, 2]) == 0
    if flat or len(body.triangles) > _TRIANGLES or len(body.values) != len(body.points):
        return {}
    inside = _cut_faces(body)
    triangles = np.concatenate([body.triangles[~inside], body.triangles[inside]])
    edges = np.concatenate([body.edges, body.drawn_elements])
    used, index = np.unique(np.concatenate([triangles.ravel(), edges.ravel()]), return_inverse=True)
    points = body.points[used]
    low, span = points.min(axis=0), np.maximum(np.ptp(points, axis=0), 1e-300)
    bottom, top = view.limits
    value = np.clip((body.values[used] - bottom) / ((top - bottom) or 1.0), 0, 1)
    vertices = np.column_stack([(points - low) / span, value]) * _STEPS
    x0, x1, y0, y1 = view.window
    axes = np.array([view.right, view.up, view.towards])
    depth = view.projected(points)[:, 2]
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2, (depth.min() + depth.max()) / 2])
    middle = centre @ axes
    head: dict[str, Any] = {
        "low": low.tolist(),
        "span": span.tolist(),
        "axes": axes.ravel().tolist(),
        "middle": middle.tolist(),
        "half": [(x1 - x0) / 2, (y1 - y0) / 2],
        "depth": float(np.linalg.norm(points - middle, axis=1).max()) * 1.05,
        "size": list(view.size),
        "outer": int((~inside).sum()),
        "triangles": len(triangles),
        "edges": len(edges),
        "outline": len(body.edges),
    }
    colours = colormaps[view.colours](np.linspace(0, 1, 64))[:, :3]
    cut = 3 * len(triangles)
    return {
        "data-head": json.dumps(head),
        "data-vertices": _text(np.round(vertices).astype("<u2")),
        "data-triangles": _text(index[:cut].astype("<u4")),
        "data-edges": _text(index[cut:].astype("<u4")),
        "data-colours": _text(np.round(255 * colours).astype(np.uint8)),
    }


def _cut_faces(body: Body) -> NDArray[np.bool_]:
    """Find the triangles that lie on another one in the undeformed body: the faces of cuts."""
    room = float(np.ptp(body.material, axis=0).max()) or 1.0
    corners = np.round(body.material[body.triangles] / room * 1e8)
    order = np.lexsort(np.moveaxis(corners, -1, 0)[::-1], axis=-1)
    sorted_ = np.take_along_axis(corners, order[:, :, None], axis=1).reshape(len(corners), 9)
    _, inverse, count = np.unique(sorted_, axis=0, return_inverse=True, return_counts=True)
    found: NDArray[np.bool_] = count[inverse.reshape(-1)] > 1
    return found


def _text(numbers: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode("ascii")
