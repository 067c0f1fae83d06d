"""Edges of a body, where its boundary turns, and strips of the boundary beside them."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from verify.geometry.nearest import feet

Array = NDArray[np.float64]

_STRIP = 1e-5  # of the body: a narrower strip beside an edge belongs to what is next to it
_STRAIGHT = 1e-6  # of 1 − cos of an angle: a boundary that turns less has no edge


def off_ridges(simplices: Array, boundary: Array, size: float) -> Array:
    """Return the centroids (r, d) of simplices, moved out of the strips beside edges.

    Parameters
    ----------
    simplices : (r, k, d) array
        Segments (k = 2) or triangles (k = 3) in facets of the boundary, m.
    boundary : (b, k, d) array
        All facets of the boundary, m.
    size : float
        Size of the body, m.
    """
    points = simplices.mean(axis=1)
    corners = simplices.shape[1]
    pairs = combinations(range(corners), 2)
    lengths = [np.linalg.norm(simplices[:, i] - simplices[:, j], axis=1) for i, j in pairs]
    width = lengths[0] if corners == 2 else _double_areas(simplices) / np.max(lengths, axis=0)
    narrow = np.flatnonzero(width <= _STRIP * size)
    if not len(narrow):
        return points
    edges = _ridges(boundary)
    for row in narrow:
        own = simplices[row][:, None]
        away = own - feet(own, edges[:, 0], edges[:, -1])
        beside = (np.linalg.norm(away, axis=2) <= _STRIP * size).all(axis=0)
        if not beside.any():
            continue
        ways = away[:, beside].mean(axis=0)
        lengths_of = np.linalg.norm(ways, axis=1)
        ways = ways[lengths_of > 0.0] / lengths_of[lengths_of > 0.0, None]
        distinct = np.unique(np.round(ways, 6), axis=0)
        points[row] += 2.0 * _STRIP * size * distinct.sum(axis=0)
    return points


def _double_areas(triangles: Array) -> Array:
    one, other = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    gram = np.sum(one**2, axis=1) * np.sum(other**2, axis=1) - np.sum(one * other, axis=1) ** 2
    return np.sqrt(np.maximum(gram, 0.0))


def _ridges(boundary: Array) -> Array:
    """Where facets (b, k, d) of different directions meet: points (e, 1, d), segments (e, 2, d)."""
    count, k, d = boundary.shape
    if k == 2:
        directions = boundary[:, 1] - boundary[:, 0]
        ends = boundary[:, :, None]
    else:
        directions = np.cross(boundary[:, 1] - boundary[:, 0], boundary[:, 2] - boundary[:, 0])
        ends = boundary[:, [[0, 1], [0, 2], [1, 2]]]
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    ends = ends.reshape(-1, k - 1, d)
    _, node = np.unique(ends.reshape(-1, d), axis=0, return_inverse=True)
    keys = np.sort(node.reshape(-1, k - 1), axis=1)
    _, first, place = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    facet = np.repeat(np.arange(count), k)
    turn = 1.0 - np.abs(np.sum(directions[facet] * directions[facet[first[place.ravel()]]], axis=1))
    edges: Array = ends[first[np.unique(place.ravel()[turn > _STRAIGHT])]]
    return edges
