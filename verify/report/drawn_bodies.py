"""Pictures of bodies: painted as stills, and packed for views that the reader can turn.

Plane bodies are shaded smoothly, solids facet by facet from the back.
"""

import base64
import io
import json
import math
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import Collection, PolyCollection, TriMesh
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure
from matplotlib.transforms import Affine2D
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from PIL import Image

from verify.report.blocks import Drawing
from verify.report.bodies import Body, View
from verify.report.notation import RAISED

_DPI = 100
_OUTLINE, _ELEMENTS = (0.1, 0.1, 0.1, 1.0), (0.0, 0.0, 0.0, 0.25)
_FACETS = 12_000  # up to which those of solids are split


def draw(body: Body, view: View) -> bytes:
    """Return a picture of `body` as WebP."""
    (width, height), (x0, x1, y0, y1) = view.size, view.window
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    canvas = FigureCanvasAgg(figure)
    onto = Affine2D().translate(-x0, -y0).scale(width / (x1 - x0), height / (y1 - y0))
    for layer in _layers(body, view):  # axes would take longer than the body
        layer.set_transform(onto)
        figure.add_artist(layer)
    canvas.draw()
    made = io.BytesIO()
    image = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
    image.save(made, "WEBP", quality=84, method=3)
    return made.getvalue()


def _layers(body: Body, view: View) -> list[Collection]:
    """Return what is drawn of a body, the lowest first."""
    places = view.projected(body.points)
    if np.ptp(body.points[:, 2]) != 0 or len(body.values) != len(body.points):
        return [_painted(body, view, places)]
    low, high = view.limits
    mesh = TriMesh(Triangulation(places[:, 0], places[:, 1], body.triangles),
                   array=body.values, cmap=view.colours, norm=Normalize(low, high))  # fmt: skip
    lines = ((body.drawn_elements, 0.5, _ELEMENTS), (body.edges, 1.6, _OUTLINE))
    return [
        mesh,
        *(_lined(places[edges][:, :, :2], width, colour) for edges, width, colour in lines),
    ]


def _lined(ends: Any, width: float, colour: Any) -> Collection:
    """Return lines; as polygons they are made at once, as lines one by one."""
    return PolyCollection(ends, facecolors="none", linewidths=width, edgecolors=[colour])


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
    kinds = [(facets, colormaps[view.colours](shades), 0.4, facets[:, :, 2].mean(axis=1))]
    kinds += [(ends[:, [0, 1, 1]], np.tile(colour, (len(ends), 1)), width,
               ends[:, :, 2].mean(axis=1) + lift) for ends, colour, width in lines]  # fmt: skip
    shapes: Any = np.concatenate([corners[:, :, :2] for corners, *_ in kinds])
    depth = np.concatenate([deep for *_, deep in kinds])
    colours = np.concatenate([colour for _, colour, _, _ in kinds])
    widths = np.concatenate([np.full(len(corners), width) for corners, _, width, _ in kinds])
    order = np.argsort(depth, kind="stable")
    return PolyCollection(
        shapes[order],
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
    shades = [to_hex(colour) for colour in colormaps[view.colours](np.linspace(0, 1, 17))]
    stops = "".join(f'<stop offset="{k / 16:g}" stop-color="{c}"/>' for k, c in enumerate(shades))
    left, wide = 16.0, 248.0
    end = left + wide
    parts = [
        f'<defs><linearGradient id="scale">{stops}</linearGradient></defs>',
        f'<rect x="{left}" y="18" width="{wide}" height="10" fill="url(#scale)"/>',
        _text(left + wide / 2, 12, f"{title}, {_unit(power)}"),
    ]
    if view.beyond:  # an arrow of the last colour
        parts.append(f'<path d="M{end} 18L{end + 10} 23L{end} 28z" fill="{shades[-1]}"/>')
    for value in _ticks(top) if drawable else []:
        at = left + wide * value / top
        parts.append(f'<path d="M{at:.2f} 28v3" stroke="#1b1b1b" stroke-width="0.8"/>')
        parts.append(_text(at, 42, f"{value:.4g}"))
    beyond = " and above" if view.beyond else ""
    words = f"Colours: {title} from 0 to {high:.3g} m{beyond}"
    return Drawing("".join(parts), (280.0, 46.0), words, "colour-bar")


def _text(x: float, y: float, words: str) -> str:
    return f'<text x="{x:.2f}" y="{y:g}" text-anchor="middle" font-size="10.5">{words}</text>'


def _unit(power: int) -> str:
    return f"10{str(power).translate(RAISED)} m" if power else "m"


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
        "data-vertices": _packed(np.round(vertices).astype("<u2")),
        "data-triangles": _packed(index[:cut].astype("<u4")),
        "data-edges": _packed(index[cut:].astype("<u4")),
        "data-colours": _packed(np.round(255 * colours).astype(np.uint8)),
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


def _packed(numbers: NDArray[Any]) -> str:
    return base64.b64encode(np.ascontiguousarray(numbers).tobytes()).decode("ascii")
