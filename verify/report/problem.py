"""The problem of a case, in words (body, material, cuts, supports, loads, mesh) and as a sketch."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from numpy.typing import NDArray
from pydantic import TypeAdapter, ValidationError

from verify.errors import InputError
from verify.geometry.simplices import rim_edges
from verify.report.notation import Drawing
from verify.report.plots import drawing
from verify.scene.tool_path import Cut

# what says nothing where it is so
_USUAL: dict[str, Any] = {
    "opens_at": 0.0, "expected": None, "damping": [0.0, 0.0], "starts_at": 0.0, "name": "cut",
    "schema": 1,
}  # fmt: skip
_UNITS = {"young": "Pa", "density": "kg/m³", "speed": "m/s", "duration": "s", "time_step": "s",
          "acceleration": "m/s²", "opens_at": "s", "starts_at": "s", "thickness": "m",
          "lower": "m", "upper": "m", "radius": "m", "depth": "m", "traction": "Pa",
          "pressure": "Pa", "force": "N/m³"}  # fmt: skip
_NAMES = {"young": "E", "poisson": "ν", "where": "on", "cells": "elements"}
_SHOWN = 8  # entries of a list


def problem_facts(scene: Mapping[str, Any]) -> list[tuple[str, list[str]]]:
    """Return what the scene of a result asks, as headings with lines."""
    facts: list[tuple[str, list[str]]] = []
    for key, title in (("geometry", "Body"), ("material", "Material"), ("analysis", "Kinematics"),
                       ("cuts", "Cuts"), ("supports", "Supports"), ("loads", "Loads"),
                       ("initial", "Initially"), ("exact", "Exact solution"),
                       ("mesh", "Mesh")):  # fmt: skip
        found = scene.get(key)
        lines = [_line(entry) for entry in (found if isinstance(found, list) else [found])]
        if lines := [line for line in lines if line]:
            more = len(lines) - _SHOWN
            facts.append((title, lines[:_SHOWN] + ([f"and {more} more"] if more > 0 else [])))
    return facts


def _line(entry: Any) -> str:
    if not isinstance(entry, Mapping):
        return "" if entry in (None, [], {}) else _words(entry)
    said = [_words(entry[key]) for key in ("kind", "solution") if entry.get(key)]
    for key, value in entry.items():
        usual = key in _USUAL and value == _USUAL[key]
        if key in ("kind", "solution") or value in (None, [], {}, "") or usual:
            continue
        unit = f" {_UNITS[key]}" if key in _UNITS and not isinstance(value, str) else ""
        said.append(f"{_NAMES.get(str(key), str(key)).replace('_', ' ')} {_words(value)}{unit}")
    return ", ".join(said)


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return f"({_line(value)})"
    if isinstance(value, list | tuple):
        shown = [_words(entry) for entry in value[:_SHOWN]]
        rest = [f"… {len(value)} in all"] if len(value) > _SHOWN else []
        return f"({', '.join(shown + rest)})"
    if isinstance(value, float):
        return f"{value:.5g}".replace("-", "−")
    return str(value)


_CUT, _HELD, _LOAD, _BODY = "#b3261e", "#0067a5", "#00785a", "#f1efe9"
_DEPTH = np.array([0.42, 0.3])  # of the third axis in a cabinet projection
# sides of a rectangle as corner numbers, and of a box as corner numbers of its faces
_SIDES = {"bottom": (0, 1), "right": (1, 2), "top": (2, 3), "left": (3, 0)}
_FACES = {"left": (0, 2, 6, 4), "right": (1, 3, 7, 5), "front": (0, 1, 5, 4), "back": (2, 3, 7, 6),
          "bottom": (0, 1, 3, 2), "top": (4, 5, 7, 6)}  # fmt: skip
_EDGES = ((0, 1), (1, 3), (3, 2), (2, 0), (4, 5), (5, 7), (7, 6), (6, 4), (0, 4), (1, 5), (2, 6),
          (3, 7))  # fmt: skip

Points = NDArray[np.float64]

_CUTS: TypeAdapter[Any] = TypeAdapter(Cut)


def sketch(scene: Mapping[str, Any]) -> Drawing | None:
    """Return the sketch of a rectangle, polygon or box with what it knows to draw, or None."""
    body = scene.get("geometry") or {}
    if body.get("kind") not in ("rectangle", "polygon", "box"):
        return None
    figure = Figure(figsize=(3.6, 2.9))
    FigureCanvasSVG(figure)
    axes = figure.add_axes((0.02, 0.06, 0.96, 0.88))
    axes.set_aspect("equal")
    axes.axis("off")
    corners, parts = _body(axes, body)
    size = float(np.ptp(corners, axis=0).max())
    for support in scene.get("supports") or []:
        for ends in _where(support.get("where"), parts):
            axes.plot(*_closed(ends).T, color=_HELD, linewidth=3.2, solid_capstyle="butt")
    for load in scene.get("loads") or []:
        _load(axes, load, parts, corners, size)
    for cut in scene.get("cuts") or []:
        for line in cut_lines(cut):
            axes.plot(*_flat(line).T, color=_CUT, linewidth=1.6)
    axes.margins(0.08)
    said = "Sketch: body grey, cuts red, supports blue, loads green."
    return drawing(figure, said, "sketch")


def _flat(points: Any) -> Points:
    """Return points of the plane as they are, points of space in a cabinet projection."""
    places = np.asarray(points, dtype=float)
    if places.shape[1] == 2:
        return places
    result: Points = places[:, [0, 2]] + places[:, [1]] * _DEPTH
    return result


def _closed(points: Points) -> Points:
    return points if len(points) == 2 else np.vstack([points, points[:1]])


def _body(axes: Axes, body: Mapping[str, Any]) -> tuple[Points, dict[str, list[Points]]]:
    """Draw the body; return its corners and the parts of its boundary by name."""
    if body["kind"] == "box":
        (x0, y0, z0), (x1, y1, z1) = body["lower"], body["upper"]
        solid = _flat([(x, y, z) for z in (z0, z1) for y in (y0, y1) for x in (x0, x1)])
        for face in ("front", "right", "top"):
            axes.fill(*solid[list(_FACES[face])].T, color=_BODY, linewidth=0)
        for a, b in _EDGES:
            hidden = 2 in (a, b)
            axes.plot(*solid[[a, b]].T, color="#555555", linewidth=0.6 if hidden else 1.0,
                      linestyle=":" if hidden else "-")  # fmt: skip
        _label(axes, solid, f"{x1 - x0:.4g} × {y1 - y0:.4g} × {z1 - z0:.4g} m")
        return solid, {name: [solid[list(face)]] for name, face in _FACES.items()}
    corners = plane_corners(body)
    assert corners is not None
    if body["kind"] == "rectangle":
        parts = {name: [corners[list(ends)]] for name, ends in _SIDES.items()}
    else:
        sides = [np.array(pair) for pair in pairwise(_closed(corners))]
        parts = {}
        for name, side in zip(body.get("names") or [], sides, strict=False):
            parts.setdefault(name, []).append(side)
        parts["boundary"] = sides
    axes.fill(*corners.T, facecolor=_BODY, edgecolor="#555555", linewidth=1.0)
    lengths = np.ptp(corners, axis=0)
    _label(axes, corners, f"{lengths[0]:.4g} × {lengths[1]:.4g} m")
    return corners, parts


def plane_corners(body: Mapping[str, Any]) -> Points | None:
    """Return the corners (k, 2) of a rectangle or polygon, m; None of another body."""
    if body.get("kind") == "rectangle":
        (x0, y0), (x1, y1) = body["lower"], body["upper"]
        return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)
    return np.asarray(body["corners"], dtype=float) if body.get("kind") == "polygon" else None


def _label(axes: Axes, corners: Points, words: str) -> None:
    low, high = corners.min(axis=0), corners.max(axis=0)
    axes.annotate(words, ((low[0] + high[0]) / 2, low[1]), (0, -6), textcoords="offset points",
                  ha="center", va="top", fontsize=8)  # fmt: skip


def _where(where: Any, parts: Mapping[str, list[Points]]) -> list[Points]:
    if where == "boundary":
        return [side for own in parts.values() for side in own]
    return parts.get(str(where), [])


def _load(
    axes: Axes, load: Mapping[str, Any], parts: Mapping[str, list[Points]], corners: Points,
    size: float,
) -> None:  # fmt: skip
    """Draw an arrow per load whose direction is given in numbers."""
    vector = next((load[k] for k in ("acceleration", "force", "traction") if load.get(k)), None)
    if not isinstance(vector, Sequence) or not all(isinstance(v, int | float) for v in vector):
        return
    along = _flat([vector])[0]
    if not (length := float(np.linalg.norm(along))):
        return
    step = along / length * 0.16 * size
    places = [side.mean(axis=0) for side in _where(load.get("where"), parts)]
    for at in places or ([corners.mean(axis=0)] if "where" not in load else []):
        arrow = {"arrowstyle": "-|>", "color": _LOAD, "lw": 1.6}
        axes.annotate("", tuple(at + step), tuple(at), arrowprops=arrow, annotation_clip=False)
        axes.update_datalim([at + step])  # that a pull on the border lies inside


def cut_lines(cut: Mapping[str, Any]) -> list[Points]:
    """Return the lines of a cut: itself in the plane, its rim in space, with not-a-number gaps."""
    try:
        shape = _CUTS.validate_python(cut).whole()
    except (InputError, ValidationError):  # of a blade that sweeps no plane, or of another version
        return [np.asarray(cut["points"], dtype=float)] if cut.get("points") else []
    if shape.dimension == 2:
        return [shape.vertices()]
    rim = np.pad(rim_edges(shape.facets()), ((0, 0), (0, 1), (0, 0)), constant_values=np.nan)
    return [rim.reshape(-1, 3)] if len(rim) else []
