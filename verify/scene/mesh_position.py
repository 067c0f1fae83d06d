"""Positions of a structured mesh: nearly equal meshes that a cut passes in other places."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
Cells = NDArray[np.int64]

POSITIONS = 16
_MOVED = 0.2  # of an element
_SEED = 1811
_SHARE = 0.03  # of its size, by which a mesh without a structure is finer or coarser


class MeshPosition(NamedTuple):
    """What a position changes of the mesh that is asked.

    Attributes
    ----------
    more : int
        Elements along each axis more than asked: −1, 0, 1. The one element of a layer stays one.
    falling : bool
        Whether elements are mirrored in x: squares are split along the falling diagonal.
    way : int
        In which of three ways inner nodes are moved; 0: they stay.
    """

    more: int
    falling: bool
    way: int


def mesh_position(number: int) -> MeshPosition:
    """Return the position of a number, 0 to 15; 0 is the mesh as asked.

    Eight have n elements along each axis, four n − 1 and four n + 1. Half of each are falling, and
    few in a row are alike, so that fewer than 16 are a sample too.
    """
    more, late = (0, -1, 0, 1)[number % 4], number // 8
    return MeshPosition(more, number // 4 % 2 == 1, late + 2 * (number % 4 == 2))


def size_share(number: int) -> float:
    """Return by which factor the elements of a mesh that is made anew are larger at a position.

    Such a mesh has no diagonals and no nodes of the structured one: without this factor, all
    positions of equal counts would be one mesh. Position 0 has 1, no two have the same.
    """
    return 1.0 + _SHARE * ((7 * number + POSITIONS // 2) % POSITIONS / (POSITIONS // 2) - 1.0)


def moved_mesh(
    points: Points, cells: Cells, counts: Sequence[int], number: int
) -> tuple[Points, Cells]:
    """Mirror the elements of a structured mesh and move its inner nodes.

    A node moves by at most a fifth of an element, its sides the units of length. Every simplex has
    edges I along the axes that become I + E, with rows of E of at most 2/5. So ‖E‖ < 1 up to three
    dimensions, and measures stay positive. Across a layer of one element there are no inner nodes:
    its nodes move along the layer, whose faces stay where they are.

    Parameters
    ----------
    points : (n, d) array
        Nodes of a divided rectangle or box, in any order, m.
    cells : (m, d + 1) array
    counts : (d,) sequence of int
        Elements along each axis.
    number : int
        Of the position.

    Returns
    -------
    points : (n, d) array
        The boundary keeps its nodes, but for both faces of a layer of one element.
    cells : (m, d + 1) array
        Oriented as before.
    """
    position = mesh_position(number)
    low, divided = points.min(axis=0), np.array(counts)
    sides = np.ptp(points, axis=0) / divided
    index = np.rint((points - low) / sides).astype(np.int64)
    place = np.ravel_multi_index(tuple(index.T), tuple(divided + 1))
    if position.falling:
        index[:, 0] = divided[0] - index[:, 0]
        mirrored = np.ravel_multi_index(tuple(index.T), tuple(divided + 1))
        cells = np.argsort(place)[mirrored][cells]
        cells[:, -2:] = cells[:, :-3:-1]
    if position.way:
        layer = divided == 1
        inner = np.all((index > 0) & (index < divided) | layer, axis=1)
        moves = _moves(position.way, len(points), len(low))[place] * np.where(layer, 0.0, sides)
        points = points.copy()
        points[inner] += moves[inner]
    return points, cells


def _moves(way: int, count: int, d: int) -> Points:
    """Vectors (count, d), evenly distributed over the ball."""
    random = np.random.default_rng((_SEED, way))
    ahead = random.standard_normal((count, d))
    length = _MOVED * random.random((count, 1)) ** (1 / d)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True) * length
