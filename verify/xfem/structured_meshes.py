"""Structured simplicial meshes of a rectangle and of a box."""

from collections.abc import Sequence
from itertools import permutations
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from verify.xfem.arrays import Floats, Ints, check_choice
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh

Diagonal = Literal["right", "left", "alternating", "crossed"]


def rectangle_mesh(
    divisions: Sequence[int],
    lower: ArrayLike = (0.0, 0.0),
    upper: ArrayLike = (1.0, 1.0),
    diagonal: Diagonal = "right",
) -> SimplexMesh:
    """Triangles of a rectangle divided into equal rectangles.

    Parameters
    ----------
    divisions : (2,) sequence of int
        Rectangles along x and y.
    lower, upper : (2,) array_like
        Opposite corners, in metres.
    diagonal : {"right", "left", "alternating", "crossed"}
        ``right`` splits from the lower left to the upper right, ``alternating`` right and left
        like a chessboard; ``crossed`` puts a node in the middle of every rectangle.

    Raises
    ------
    XfemError
        If a number of divisions or a side is not positive, or the diagonal is unknown.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> len(xfem.rectangle_mesh((4, 2)).cells)
    16
    """
    nodes, points = _grid(divisions, lower, upper)
    a, b = nodes[:-1, :-1], nodes[1:, :-1]
    c, d = nodes[1:, 1:], nodes[:-1, 1:]
    right = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2)
    left = np.stack([np.stack([a, b, d], -1), np.stack([b, c, d], -1)], 2)
    check_choice(diagonal, Diagonal, "diagonal")
    if diagonal != "crossed":
        odd = (np.indices(a.shape).sum(axis=0) % 2 == 1)[:, :, None, None]
        turned = {"right": False, "left": True, "alternating": odd}[diagonal]
        return SimplexMesh(points, np.where(turned, left, right).reshape(-1, 3))
    centre = len(points) + np.arange(a.size).reshape(a.shape)
    centres = points[np.stack([a, b, c, d], -1)].mean(axis=2).reshape(-1, 2)
    sides = [(a, b), (b, c), (c, d), (d, a)]
    fans = np.stack([np.stack([p, q, centre], -1) for p, q in sides], 2)
    return SimplexMesh(np.concatenate([points, centres]), fans.reshape(-1, 3))


def box_mesh(
    divisions: Sequence[int],
    lower: ArrayLike = (0.0, 0.0, 0.0),
    upper: ArrayLike = (1.0, 1.0, 1.0),
) -> SimplexMesh:
    """Tetrahedra of a box divided into equal boxes, six to a box (Kuhn's triangulation).

    All six share the diagonal from the lower to the upper corner of their box, so the mesh is
    conforming and translation invariant.

    Parameters
    ----------
    divisions : (3,) sequence of int
        Boxes along x, y and z.
    lower, upper : (3,) array_like
        Opposite corners, in metres.

    Raises
    ------
    XfemError
        If a number of divisions or a side is not positive.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> len(xfem.box_mesh((2, 2, 2)).cells)
    48
    """
    nodes, points = _grid(divisions, lower, upper)
    counts = [k - 1 for k in nodes.shape]
    cells = []
    # a tetrahedron for each way along three edges from the lower to the upper corner
    for order in permutations(range(3)):
        offset = np.zeros(3, dtype=int)
        path = []
        for axis in (None, *order):
            if axis is not None:
                offset[axis] = 1
            window = tuple(slice(o, o + k) for o, k in zip(offset, counts, strict=True))
            path.append(nodes[window])
        cells.append(np.stack(path, -1))
    return SimplexMesh(points, np.stack(cells, 3).reshape(-1, 4))


def _grid(divisions: Sequence[int], lower: ArrayLike, upper: ArrayLike) -> tuple[Ints, Floats]:
    """Node numbers, indexed by the place in the grid (x, y, z), and coordinates (n, d)."""
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    counts = np.asarray(divisions)
    if counts.shape != low.shape or (counts < 1).any() or counts.dtype.kind != "i":
        raise XfemError(f"divisions {divisions!r}; expected {len(low)} positive integers")
    if low.shape != high.shape or not (high > low).all():
        raise XfemError(f"box from {low.tolist()} to {high.tolist()}; expected lower < upper")
    # numbers run along x first, as in a picture read line by line
    nodes = np.arange(np.prod(counts + 1)).reshape(tuple(counts[::-1] + 1)).T
    axes = [np.linspace(a, b, k + 1) for a, b, k in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    points = np.empty((nodes.size, len(low)))
    points[nodes.ravel()] = grid.reshape(-1, len(low))
    return nodes, points
