"""A cut as a solver realised it, as geometry: polylines in the plane, triangles in space."""

from collections import defaultdict

import numpy as np
from numpy.typing import NDArray

from verify.compare.cut_deviation import welded

Array = NDArray[np.float64]

_SAME = 1e-10  # of the size of the cut: corners of segments this close are one
_CLOSE = 1e-6  # the same of triangles, and the least height of one over its longest edge
_STRAIGHT = 1e-9


def polylines_of(facets: Array) -> list[Array]:
    """Join segments (f, 2, 2) to polylines, split where more than two of them meet.

    Corners on a straight line are left out. A closed line begins and ends in the same corner.
    """
    corners, number = _welded(facets, _SAME)
    ends = [(int(a), int(b)) for a, b in number]
    beside: dict[int, set[int]] = defaultdict(set)
    for a, b in ends:
        if a != b:
            beside[a].add(b)
            beside[b].add(a)
    unused = {frozenset((a, b)) for a, b in ends if a != b}
    starts = [node for node in beside if len(beside[node]) != 2] + list(beside)
    lines = []
    for start in starts:
        for step in sorted(beside[start]):
            if frozenset((start, step)) not in unused:
                continue
            line = [start, step]
            unused.discard(frozenset(line))
            while len(beside[line[-1]]) == 2 and line[-1] != start:
                onwards = next(iter(beside[line[-1]] - {line[-2]}))
                edge = frozenset((line[-1], onwards))
                if edge not in unused:
                    break
                unused.discard(edge)
                line.append(onwards)
            lines.append(_without_straight(corners[line]))
    return lines


def triangles_of(facets: Array) -> Array:
    """Return those of the triangles (f, 3, 3) that have an area, corners side by side made one.

    A cut that passes within 1e-6 of its size of a node leaves slivers there, of which a scene
    makes no polygons; a conforming mesh has a node on such a cut anyway.
    """
    corners, number = _welded(facets, _CLOSE)
    triangles = corners[number]
    edges = triangles[:, 1:] - triangles[:, :1]
    doubled = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).max(axis=1)
    return np.asarray(triangles[doubled > _CLOSE * longest**2])


def _welded(facets: Array, tolerance: float) -> tuple[Array, NDArray[np.int64]]:
    """Corners (c, d), those within `tolerance` of the cut's size made one, and (f, k) numbers."""
    points = facets.reshape(-1, facets.shape[-1])
    return welded(facets, tolerance * float(np.ptp(points, axis=0).max()) if len(points) else 0.0)


def _without_straight(line: Array) -> Array:
    step = np.diff(line, axis=0)
    step /= np.linalg.norm(step, axis=1)[:, None]
    turn = np.abs(step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0])
    keep = np.concatenate([[True], turn > _STRAIGHT, [True]])
    return np.asarray(line[keep])
