"""Bodies of stored fields, views of them, and their pictures: stills, and views that can be turned.

Plane bodies are shaded smoothly, solids facet by facet from the back.
"""

import base64
import io
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
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

from verify.errors import InputError
from verify.geometry.simplices import mesh_edges
from verify.read_mesh import read_with_meshio
from verify.report.notation import RAISED, Drawing
from verify.solution import Solution

_FEATURE_ANGLE = 30.0  # degrees between facets beyond which a 3D edge is drawn
_SIDES = ((0, 1), (1, 2), (2, 0))  # of a triangle
_MOST_EDGES = 4000  # of elements that are drawn; more would be too dense to be seen


@dataclass(frozen=True)
class Body:
    """A surface to draw.

    Parameters
    ----------
    points : (n, 3) float array
        Where the nodes are drawn, m.
    triangles : (m, 3) int array
    edges : (e, 2) int array
        Outline; the two faces of a cut are part of it, since nodes are doubled there.
    values : (n,) or (m,) float array
        Coloured values, per node or per triangle.
    element_edges : (k, 2) int array
        Edges of the elements.
    material : (n, 3) float array
        Where the nodes are in the undeformed body, m.
    """

    points: NDArray[np.float64]
    triangles: NDArray[np.int64]
    edges: NDArray[np.int64]
    values: NDArray[np.float64]
    element_edges: NDArray[np.int64]
    material: NDArray[np.float64]

    @property
    def drawn_elements(self) -> NDArray[np.int64]:
        """Edges of the elements, none where they would be too dense to be seen."""
        return self.element_edges if len(self.element_edges) <= _MOST_EDGES else self.edges[:0]


def deformed_bodies(solution: Solution, scale: float, steps: Sequence[int] = (-1,)) -> list[Body]:
    """Return the body displaced by `scale` times its displacement at times, coloured by |u|."""
    cells = _straight(solution.cells, solution.cell_type)
    still = _body(solution.points, cells, np.zeros(len(solution.points)), solution.cells)
    moves = (solution.displacement[step] for step in steps)
    return [replace(still, points=_in_space(solution.points + scale * u),
                    values=np.linalg.norm(u, axis=1)) for u in moves]  # fmt: skip


def error_body(path: Path) -> Body:
    """Return the undeformed body of a stored error field, coloured by the error.

    Raises
    ------
    InputError
        If the file is not a mesh of simplices with point or cell data ``error``.
    """
    mesh = read_with_meshio(path, "vtu", "an error field")
    for kind in ("tetra10", "tetra", "triangle6", "triangle"):
        if kind in mesh.cells_dict:
            break
    else:
        raise InputError("the error field has no triangles or tetrahedra", str(path))
    cells = np.asarray(mesh.cells_dict[kind], dtype=np.int64)
    points = np.asarray(mesh.points, dtype=float)
    # triangles off z = 0 are a membrane
    dimension = 3 if kind.startswith("tetra") or np.ptp(points[:, 2]) > 0.0 else 2
    points = points[:, :dimension]
    if "error" in mesh.point_data:
        values = np.asarray(mesh.point_data["error"], dtype=float)
        values = values if values.ndim == 1 else np.linalg.norm(values, axis=1)
        if len(values) != len(points) or not np.isfinite(values).all():
            raise InputError("the error field has values that are not finite", str(path))
        return _body(points, _straight(cells, kind), values, cells)
    per_cell = mesh.cell_data_dict.get("error", {}).get(kind)
    if per_cell is None or dimension == 3 or kind == "triangle6":
        raise InputError("the error field has no point data 'error'", str(path))
    return _body(points, cells, np.asarray(per_cell, dtype=float).reshape(-1), cells)


def zoomed(body: Body, window: tuple[float, float, float, float]) -> Body:
    """Return the triangles of a plane body that reach into a window (x0, x1, y0, y1)."""
    x0, x1, y0, y1 = window
    low = body.points[body.triangles].min(axis=1)
    high = body.points[body.triangles].max(axis=1)
    seen = (high[:, 0] > x0) & (low[:, 0] < x1) & (high[:, 1] > y0) & (low[:, 1] < y1)
    nodal = len(body.values) == len(body.points)
    used, index = np.unique(body.triangles[seen], return_inverse=True)
    new = np.full(len(body.points), -1)
    new[used] = np.arange(len(used))
    edges, inner = (
        kept[(kept >= 0).all(axis=1)] for kept in (new[body.edges], new[body.element_edges])
    )
    values = body.values[used] if nodal else body.values[seen]
    points, material = body.points[used], body.material[used]
    return Body(points, index.reshape(-1, 3), edges, values, inner, material)


def _straight(cells: NDArray[np.int64], kind: str) -> NDArray[np.int64]:
    """Return quadratic triangles as four straight ones, tetrahedra by their corners."""
    if kind == "triangle6":
        a, b, c, ab, bc, ca = cells.T
        return np.concatenate(
            [np.column_stack(t) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
        )
    return cells[:, :4] if kind.startswith("tetra") else cells


def _body(
    points: NDArray[np.float64],
    cells: NDArray[np.int64],
    values: NDArray[np.float64],
    elements: NDArray[np.int64],
) -> Body:
    flat, drawn = points.shape[1] == 2, _in_space(points)
    if cells.shape[1] == 3:
        triangles, inner = cells, mesh_edges(elements[:, :3])
        edges = _single(cells, _SIDES) if flat else _creases(drawn, triangles, oriented=False)
    else:
        triangles = _single(cells, ((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)))
        edges, inner = _creases(drawn, triangles), mesh_edges(triangles)
    return Body(drawn, triangles, edges, values, inner, drawn)


def _in_space(points: NDArray[np.float64]) -> NDArray[np.float64]:
    flat = points.shape[1] == 2
    return np.column_stack([points, np.zeros(len(points))]) if flat else points


def _keys(found: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return one number for each row of nodes, the same for rows of the same nodes."""
    shape = (int(found.max(initial=0)) + 1,) * found.shape[1]
    return np.asarray(np.ravel_multi_index(tuple(np.sort(found, axis=1).T), shape))


def _single(cells: NDArray[np.int64], faces: tuple[tuple[int, ...], ...]) -> NDArray[np.int64]:
    """Return the faces that belong to one cell only, as the cell orients them."""
    found = np.concatenate([cells[:, list(face)] for face in faces])
    _, first, count = np.unique(_keys(found), return_index=True, return_counts=True)
    single: NDArray[np.int64] = found[np.sort(first[count == 1])]
    return single


def _creases(
    points: NDArray[np.float64], triangles: NDArray[np.int64], oriented: bool = True
) -> NDArray[np.int64]:
    """Return the edges of a surface where it ends or bends sharply.

    Triangles that are not `oriented` alike bend by less than a right angle.
    """
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    edges = np.concatenate([triangles[:, [i, j]] for i, j in _SIDES])
    owner = np.tile(np.arange(len(triangles)), 3)
    _, first, inverse, count = np.unique(
        _keys(edges), return_index=True, return_inverse=True, return_counts=True
    )
    unique, turned = np.sort(edges[first], axis=1), normals[owner]
    if not oriented:
        alike = np.einsum("ij,ij->i", turned, turned[first][inverse])
        turned = np.where(alike[:, None] < 0.0, -turned, turned)
    total = np.zeros((len(unique), 3))
    np.add.at(total, inverse, turned)
    # |n1 + n2| = 2 cos(angle/2) for the two facets of an inner edge
    sharp = np.linalg.norm(total, axis=1) < 2 * np.cos(np.deg2rad(_FEATURE_ANGLE) / 2)
    creases: NDArray[np.int64] = unique[(count != 2) | sharp]
    return creases


_PIXELS = 560_000  # of a picture: 2 × what a page shows of it, for sharp displays
_MARGIN = 0.03
# A 3D body is seen from the front, right and above (elevation 24°, azimuth −58°)
_ELEVATION, _AZIMUTH = np.deg2rad(24.0), np.deg2rad(-58.0)


@dataclass(frozen=True)
class View:
    """A parallel projection and a colour scale.

    Parameters
    ----------
    axes : (3, 3) array
        Unit vectors of the picture as rows: right, up, towards the viewer.
    window : (x0, x1, y0, y1)
        Visible part, in the picture's axes, m.
    size : (width, height)
        In pixels.
    colours : str
        Name of the matplotlib colour map.
    limits : (low, high)
        Values at its ends.
    beyond : bool
        Whether there are values above `limits`, which have the last colour.
    """

    axes: NDArray[np.float64]
    window: tuple[float, float, float, float]
    size: tuple[int, int]
    colours: str
    limits: tuple[float, float]
    beyond: bool = False

    def projected(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (n, 3): place in the picture, and depth towards the viewer."""
        return np.asarray(points @ self.axes.T)


def common_view(
    bodies: Sequence[Body], colours: str, top: float | None = None, pixels: int = _PIXELS
) -> View:
    """Return the one view in which all `bodies` are seen whole, with one colour scale.

    It ends at `top`, by default at the largest value.
    """
    axis = np.eye(3)
    if any(np.ptp(body.points[:, 2]) > 0 for body in bodies):
        e, a = _ELEVATION, _AZIMUTH
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        axis = np.array([right, np.cross(towards, right), towards])
    places = np.concatenate([body.points @ axis[:2].T for body in bodies])
    low, high = places.min(axis=0), places.max(axis=0)
    room = _MARGIN * float((high - low).max()) or 1.0
    width, height = (high - low) + 2 * room
    # a very slender body still gets a picture some tens of pixels wide
    ratio = min(max(width / height, 1 / 12), 12.0)
    size = (round((pixels * ratio) ** 0.5), round((pixels / ratio) ** 0.5))
    most = max(float(body.values.max()) for body in bodies)
    top = most if top is None else top
    centre = (low + high) / 2
    half = np.array([max(width, height * ratio), max(height, width / ratio)]) / 2
    (x0, y0), (x1, y1) = centre - half, centre + half
    window = float(x0), float(x1), float(y0), float(y1)
    return View(axis, window, size, colours, (0.0, top if top > 0 else 1.0), beyond=most > top)


_DPI = 100
_OUTLINE, _ELEMENTS = (0.1, 0.1, 0.1, 1.0), (0.0, 0.0, 0.0, 0.25)
_FACETS = 12_000  # up to which facets of solids are split


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
    """Return the layers of the picture of a body, the lowest first."""
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
    return PolyCollection(shapes[order], facecolors=colours[order], edgecolors=colours[order],
                          linewidths=widths[order])  # fmt: skip


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
    unit = f"10{str(power).translate(RAISED)} m" if power else "m"
    shades = [to_hex(colour) for colour in colormaps[view.colours](np.linspace(0, 1, 17))]
    stops = "".join(f'<stop offset="{k / 16:g}" stop-color="{c}"/>' for k, c in enumerate(shades))
    left, wide = 16.0, 248.0
    end = left + wide
    parts = [
        f'<defs><linearGradient id="scale">{stops}</linearGradient></defs>',
        f'<rect x="{left}" y="18" width="{wide}" height="10" fill="url(#scale)"/>',
        _text(left + wide / 2, 12, f"{title}, {unit}"),
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
    first, then the faces of cuts.

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
    depth = view.projected(points)[:, 2]
    centre = np.array([(x0 + x1) / 2, (y0 + y1) / 2, (depth.min() + depth.max()) / 2])
    middle = centre @ view.axes
    head: dict[str, Any] = {
        "low": low.tolist(), "span": span.tolist(), "axes": view.axes.ravel().tolist(),
        "middle": middle.tolist(), "half": [(x1 - x0) / 2, (y1 - y0) / 2],
        "depth": float(np.linalg.norm(points - middle, axis=1).max()) * 1.05,
        "size": list(view.size), "outer": int((~inside).sum()), "triangles": len(triangles),
        "edges": len(edges), "outline": len(body.edges),
    }  # fmt: skip
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
