"""Small conforming meshes of cut bodies, made by hand, and scenes that go with them."""

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
import scenes
from numpy.typing import NDArray

from verify.scene import Scene
from verify.solution import Solution

Array = NDArray[np.float64]
Map = Callable[[Array], Array]

STRAIGHT = {"kind": "polyline", "points": [[-0.1, 0.3], [1.1, 0.7]]}


def scene(cuts: Sequence[dict[str, Any]], **more: Any) -> Scene:
    """A unit square under plane strain with the given cuts."""
    return scenes.scene(cuts, **{"mesh": {"cells": [[8, 8], [16, 16], [32, 32]]}, **more})


def grid(nx: int, ny: int) -> tuple[Array, NDArray[np.int64]]:
    """Points of the unit square and its triangles."""
    s, t = np.meshgrid(np.linspace(0, 1, nx + 1), np.linspace(0, 1, ny + 1), indexing="ij")
    first = (np.arange(nx)[:, None] * (ny + 1) + np.arange(ny)).ravel()
    right = first + ny + 1
    cells = np.vstack(
        [np.column_stack([first, right, right + 1]), np.column_stack([first, right + 1, first + 1])]
    )
    return np.column_stack([s.ravel(), t.ravel()]), cells


def layered(n: int, lines: Sequence[Map]) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Points, cells and layer per point of a unit square cut along heights y = line(x).

    Each layer has its own nodes, so that all cuts are open.
    """
    heights: list[Map] = [np.zeros_like, *lines, np.ones_like]
    points, cells, layer, first = [], [], [], 0
    for k, (low, high) in enumerate(pairwise(heights)):
        p, c = grid(n, max(1, n // (len(heights) - 1)))
        x, t = p.T
        points.append(np.column_stack([x, (1 - t) * low(x) + t * high(x)]))
        cells.append(c + first)
        layer.append(np.full(len(p), k))
        first += len(p)
    return np.vstack(points), np.vstack(cells), np.concatenate(layer)


def quadratic(points: Array, cells: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Add mid-edge nodes to a mesh of triangles or tetrahedra (each cell its own)."""
    d = points.shape[1]
    ends = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)][: 3 if d == 2 else 6]
    middles = [0.5 * (points[cells[:, a]] + points[cells[:, b]]) for a, b in ends]
    m = len(cells)
    extra = [len(points) + k * m + np.arange(m) for k in range(len(ends))]
    return np.vstack([points, *middles]), np.column_stack([cells, *extra])


def cube() -> tuple[Array, NDArray[np.int64]]:
    """Unit cube of six tetrahedra (Kuhn)."""
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], dtype=float)
    paths = [[1, 3], [1, 5], [2, 3], [2, 6], [4, 5], [4, 6]]
    return corners, np.array([[0, *path, 7] for path in paths])


def solution(points: Array, cells: NDArray[np.int64], u: Array, **more: Any) -> Solution:
    """A static solution with nodal displacement `u`."""
    return Solution(points=points, cells=cells.astype(np.int64), displacement=u[None], **more)
