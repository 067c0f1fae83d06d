"""Tips of the cuts of a plane scene, where its errors are looked at closely."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from verify.report.figures.sketch import cut_lines

Points = NDArray[np.float64]

_ON = 1e-6  # of the body's size: an end that is closer to a line ends on it


def plane_tips(scene: Mapping[str, Any]) -> list[tuple[Points, float]]:
    """Return the ends of cuts inside a rectangle or polygon, each with the length of its cut, m.

    An end on the boundary or on another cut is no tip.
    """
    body = scene.get("geometry") or {}
    if body.get("kind") == "rectangle":
        (x0, y0), (x1, y1) = body["lower"], body["upper"]
        corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], dtype=float)
    elif body.get("kind") == "polygon":
        corners = np.asarray(body["corners"], dtype=float)
    else:
        return []
    outline = np.vstack([corners, corners[:1]])
    near = _ON * float(np.ptp(corners, axis=0).max())
    lines = [line for cut in scene.get("cuts") or [] for line in cut_lines(cut)]
    tips = []
    for line in lines:
        others = [outline, *(other for other in lines if other is not line)]
        length = float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
        for end in line[[0, -1]]:
            apart = min(_distance(end, other) for other in others) > near
            closed = np.allclose(line[0], line[-1], rtol=0.0, atol=near)
            if apart and not closed and Outline(outline).contains_point(end):
                tips.append((end, length))
    return tips


def _distance(point: Points, line: Points) -> float:
    """Return the distance of a point from a line of straight pieces."""
    start, along = line[:-1], np.diff(line, axis=0)
    square = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
    share = np.clip(np.einsum("ij,ij->i", point - start, along) / square, 0.0, 1.0)
    return float(np.linalg.norm(start + share[:, None] * along - point, axis=1).min())
