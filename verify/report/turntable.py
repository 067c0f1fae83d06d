"""Bodies in space that the reader can turn: their surface, packed into the page."""

import base64
import json
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from verify.report.bodies import Body, View

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
