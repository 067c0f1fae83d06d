"""Flat triangles of a mesh generator: three nodes on one line, inside of a body."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
# area over the square of the longest edge, at most, of a flat triangle: an angle that no mesh
# generator aims at, and at which splitting its edges would leave none that is not flat
_FLAT = 1e-6
_ROUNDS = 8  # flat triangles that lie on flat ones are flipped from the outside in


def flip_flat_cells(points: Array, cells: Cells, facets: Cells) -> Cells:
    """Flip the longest edge of each flat triangle into the other diagonal with its neighbour.

    Between nodes on a straight cut, gmsh may leave a triangle whose corners are three of them: the
    middle one lies on the longest edge. The neighbour across that edge is divided at this node.

    Parameters
    ----------
    points : (n, 2) array
    cells : (m, 3) array
        Positively oriented, but for the flat ones.
    facets : (f, 2) array
        Marked facets; they stay.

    Returns
    -------
    (m, 3) array
        A flat triangle whose longest edge is marked or on the boundary stays.
    """
    cells = cells.copy()
    marked = {frozenset(pair) for pair in facets.tolist()}
    for _ in range(_ROUNDS):
        shape = _shape(points[cells])
        flat = np.flatnonzero(shape <= _FLAT)
        before = cells.copy()
        for cell in flat:
            edges = points[np.roll(cells[cell], -1)] - points[np.roll(cells[cell], 1)]
            middle, a, c = np.roll(cells[cell], -int(np.argmax(np.square(edges).sum(axis=1))))
            around = np.flatnonzero((cells == a).any(axis=1) & (cells == c).any(axis=1))
            around = around[around != cell]
            if len(around) != 1 or frozenset((int(a), int(c))) in marked:
                continue
            other = int(around[0])
            both = np.array([cell, other])
            far = cells[other].sum() - a - c
            x, y, _ = np.roll(cells[other], -1 - int(np.argmax(cells[other] == far)))
            flipped = np.array([[x, middle, far], [middle, y, far]])
            if _shape(points[flipped]).min() > _shape(points[cells[both]]).min():
                cells[both] = flipped
        if np.array_equal(cells, before):
            break
    return cells


def _shape(corners: Array) -> Array:
    """Signed area (m,) of triangles (m, 3, 2) over the square of their longest edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    double = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return 0.5 * double / np.square(edges).sum(axis=2).max(axis=1)
