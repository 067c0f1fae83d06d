"""Simplices divided for quadrature: at planes, towards places, in any dimension.

A quadrature needs no conforming mesh, so that every simplex may be divided for itself: an edge
is split, and each half of the simplex keeps one of its ends. Volumes add up to round-off.
"""

from collections.abc import Callable
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A corner whose level is below this share of the largest is on the surface: round-off.
_ON = 1e-14
_ROUNDS = 64  # of bisection: every edge could be halved 20 times


def measures(corners: Array) -> Array:
    """Lengths, areas or volumes (m,) of simplices (m, k + 1, d), k ≤ d."""
    edges = corners[:, 1:] - corners[:, :1]
    if edges.shape[1] == edges.shape[2]:
        size: Array = np.abs(np.linalg.det(edges))
    elif edges.shape[1:] == (2, 3):  # Gram's determinant is a square: it loses thin triangles
        opposite = np.linalg.norm(corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]], axis=2)
        apex, rows = np.argmax(opposite, axis=1), np.arange(len(corners))
        at, after, before = (corners[rows, (apex + k) % 3] for k in range(3))
        size = np.linalg.norm(np.cross(after - at, before - at), axis=1)  # of the shorter edges
    else:
        size = np.linalg.norm(edges[:, 0], axis=1)
    return size / factorial(edges.shape[1])


def heights(corners: Array) -> Array:
    """Smallest heights (m,) of simplices (m, k + 1, d), k ≤ d: 0 of a flat one."""
    count = corners.shape[1]
    largest = np.max([measures(np.delete(corners, k, axis=1)) for k in range(count)], axis=0)
    volume = (count - 1) * measures(corners)
    return np.asarray(np.divide(volume, largest, out=np.zeros(len(corners)), where=largest > 0.0))


def split_at_level(corners: Array, level: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Divide simplices where the linear interpolant of a level function is zero.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    level : callable
        Values (n,) at points (n, d); exact for planes, linear in each simplex for the others.

    Returns
    -------
    corners : (n, k + 1, d) array
        Each on one side.
    sign : (n,) array
        Its side: +1 or −1.
    """
    m, count, d = corners.shape
    value = np.asarray(level(corners.reshape(-1, d)), dtype=float).reshape(m, count)
    size = np.abs(value).max(axis=1, keepdims=True, initial=0.0)
    value[np.abs(value) <= _ON * size] = 0.0
    done, signs = [corners[:0]], [np.zeros(0)]
    ends = np.array(list(combinations(range(count), 2)))
    while len(corners):
        crossing = value[:, ends[:, 0]] * value[:, ends[:, 1]] < 0.0
        open_ = crossing.any(axis=1)
        done.append(corners[~open_])
        signs.append(np.where(value[~open_].sum(axis=1) < 0.0, -1.0, 1.0))
        corners, value = corners[open_], value[open_]
        i, j = ends[np.argmax(crossing[open_], axis=1)].T
        rows = np.arange(len(corners))
        a, b = value[rows, i], value[rows, j]
        share = (a / (a - b))[:, None]
        middle = (1.0 - share) * corners[rows, i] + share * corners[rows, j]
        corners, value = _halves(corners, i, j, middle), np.vstack([value, value])
        value[np.concatenate([rows, len(rows) + rows]), np.concatenate([i, j])] = 0.0
    return np.concatenate(done), np.concatenate(signs)


def bisect(corners: Array, target: Callable[[Array], Array]) -> Array:
    """Halve the longest edges until none exceeds the `target` size.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    target : callable
        Wanted size (m,) of simplices (m, k + 1, d), m.
    """
    return divide(corners, lambda cells, longest: longest > target(cells))


def divide(corners: Array, wanted: Callable[[Array, Array], NDArray[np.bool_]]) -> Array:
    """Halve the longest edge of simplices as long as that is `wanted`.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    wanted : callable
        Whether (m,) to halve simplices (m, k + 1, d) whose longest edges are (m,).
    """
    done = []
    ends = np.array(list(combinations(range(corners.shape[1]), 2)))
    for _ in range(_ROUNDS):
        if not len(corners):
            break
        edge = corners[:, ends[:, 1]] - corners[:, ends[:, 0]]
        lengths = np.einsum("mea,mea->me", edge, edge)
        longest = np.argmax(lengths, axis=1)
        rows = np.arange(len(corners))
        open_ = wanted(corners, np.sqrt(lengths[rows, longest]))
        done.append(corners[~open_])
        corners = corners[open_]
        i, j = ends[longest[open_]].T
        rows = np.arange(len(corners))
        corners = _halves(corners, i, j, 0.5 * (corners[rows, i] + corners[rows, j]))
    return np.concatenate([*done, corners])


def _halves(corners: Array, i: NDArray[np.int64], j: NDArray[np.int64], middle: Array) -> Array:
    """Both parts of each simplex: `middle` replaces corner i in the first, j in the second."""
    rows = np.arange(len(corners))
    first, second = corners.copy(), corners.copy()
    first[rows, i], second[rows, j] = middle, middle
    return np.concatenate([first, second])
