"""Small conforming meshes of cut surfaces in space, made by hand, and the bodies they belong to."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from cut_meshes import Map, grid, layered
from numpy.typing import NDArray

from verify.compare.simplex_bodies import MembraneBody, cut_membrane
from verify.scene.cuts import PolygonCut
from verify.solution import Solution

Array = NDArray[np.float64]
Shape = Callable[[Array, Array], Array]

# A plane in no special position: two directions and the normal, as rows.
TILTED = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [-0.3, 1.0, 2.0], [1.0, 0.2, -0.7]]))[0]


def flat(x: Array, y: Array) -> Array:
    """Plane in space."""
    return np.column_stack([x, y]) @ TILTED[:2] + [0.3, -0.2, 0.1]


def roof(x: Array, y: Array) -> Array:
    """Two planes that meet in a ridge at x = 1/2, a line of every mesh of even n."""
    return np.column_stack([x, y, 0.8 * np.minimum(x, 1 - x)])


def bowl(x: Array, y: Array) -> Array:
    """A paraboloid: its triangulations differ."""
    return np.column_stack([x, y, 0.2 * (x - 0.5) ** 2 + 0.3 * (y - 0.4) ** 2])


UP = {flat: TILTED[2], roof: np.array([0.0, 0.0, 1.0]), bowl: np.array([0.0, 0.0, 1.0])}


def line(x: Array) -> Array:
    """Cut in the plan, y over x."""
    return 0.3 + 0.4 * x


def upright(shape: Shape, a: Sequence[float], b: Sequence[float], name: str = "cut") -> PolygonCut:
    """A polygon across the surface over the segment ab of the plan; its normal is left of it."""
    flatten = flat if shape is flat else lambda x, y: np.column_stack([x, y, 0 * x])
    ends = flatten(*np.array([a, b], dtype=float).T)
    low, high = ends - 2 * UP[shape], ends + 2 * UP[shape]
    points = [low[0], high[0], high[1], low[1]]
    return PolygonCut(kind="polygon", name=name, points=[tuple(p.tolist()) for p in points])


def halved(shape: Shape, n: int = 4, gaps: Sequence[float] = ()) -> MembraneBody:
    """A surface of n × n squares that is cut along the line, and again `gaps` above it."""
    points, cells = grid(n, n)
    cuts = [
        upright(shape, (-0.5, line(-0.5) + gap), (1.5, line(1.5) + gap), f"cut{k}")
        for k, gap in enumerate([0.0, *gaps])
    ]
    return cut_membrane(shape(*points.T), cells, cuts)


def layers(
    shape: Shape, n: int, lines: Sequence[Map] = (line,), flip: bool = False
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Points, cells and layer per point of a surface whose layers have their own nodes."""
    points, cells, layer = layered(n, lines)
    if flip:  # other diagonals: the plan is mirrored in x before the lines bend it
        mirrored = layered(n, [lambda x, f=f: f(1 - x) for f in lines])[0]
        points = np.column_stack([1 - mirrored[:, 0], mirrored[:, 1]])
    return shape(*points.T), cells.astype(np.int64), layer


def membrane(points: Array, cells: NDArray[np.int64], u: Array, **more: Any) -> Solution:
    """A static solution with nodal displacement `u`."""
    return Solution(points=points, cells=cells, displacement=u[None], **more)
