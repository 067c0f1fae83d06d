"""Small conforming tetrahedral meshes of cut cubes, made by hand, and scenes that go with them."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise, permutations
from typing import Any

import numpy as np
import scenes
from numpy.typing import NDArray

from verify.compare.simplex_bodies import SolidBody, solid_of
from verify.scene import Scene
from verify.scene.cuts import PolygonCut

Array = NDArray[np.float64]
Height = Callable[[Array], Array]


def height(points: Array) -> Array:
    """Height of the inclined plane over points (n, 2 or 3)."""
    return 0.5 + (points[:, 0] - 0.5) / 3 - (points[:, 1] - 0.5) / 5


def inclined(lift: float = 0.0, name: str = "cut") -> dict[str, Any]:
    """A polygon through the cube, in the plane z = height + lift, normal upwards."""
    corners = np.array([[-0.1, -0.1], [1.1, -0.1], [1.1, 1.1], [-0.1, 1.1]])
    points = np.column_stack([corners, height(corners) + lift])
    return {"kind": "polygon", "name": name, "points": points.tolist()}


def solid_scene(cuts: Sequence[dict[str, Any]], **more: Any) -> Scene:
    """A unit cube with the given cuts."""
    cells = [[4, 4, 4], [8, 8, 8], [16, 16, 16]]
    return scenes.scene(cuts, 3, **{"mesh": {"cells": cells}, **more})


def sliver_body(gap: float) -> SolidBody:
    """The cube with the inclined cut twice, `gap` apart in height: nearer than scenes allow."""
    body = solid_of(solid_scene([inclined()]))
    other = PolygonCut.model_validate(inclined(gap, "b"))
    return replace(body, cuts={**body.cuts, "b": other.pieces()})


def cube_grid(nx: int, ny: int, nz: int, flip: bool = False) -> tuple[Array, NDArray[np.int64]]:
    """Points of the unit cube and its tetrahedra; `flip` mirrors the diagonals in x."""
    axes = [np.linspace(0, 1, n + 1) for n in (nx, ny, nz)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    first = np.stack(np.meshgrid(*(np.arange(n) for n in (nx, ny, nz)), indexing="ij"), axis=-1)
    first = first.reshape(-1, 3)
    cells = []
    for path in permutations(range(3)):
        corner, row = first.copy(), [first]
        for axis in path:
            corner = corner + np.eye(3, dtype=int)[axis]
            row.append(corner)
        cells.append(
            np.stack([((c[:, 0] * (ny + 1)) + c[:, 1]) * (nz + 1) + c[:, 2] for c in row], 1)
        )
    if flip:
        points[:, 0] = 1 - points[:, 0]
    return points, np.vstack(cells)


def stacked(
    n: int, heights: Sequence[Height], flip: bool = False
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Points, cells and layer per point of a unit cube cut along z = height(x, y).

    Each layer has its own nodes, so that all cuts are open.
    """
    bounds: list[Height] = [lambda p: np.zeros(len(p)), *heights, lambda p: np.ones(len(p))]
    points, cells, layer, start = [], [], [], 0
    for k, (low, high) in enumerate(pairwise(bounds)):
        p, c = cube_grid(n, n + 1, max(1, n // (len(bounds) - 1)), flip)
        t = p[:, 2]
        points.append(np.column_stack([p[:, :2], (1 - t) * low(p) + t * high(p)]))
        cells.append(c + start)
        layer.append(np.full(len(p), k))
        start += len(p)
    return np.vstack(points), np.vstack(cells), np.concatenate(layer)
