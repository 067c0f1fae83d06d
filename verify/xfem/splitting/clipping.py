"""Clipping of simplices by a linear level set into sub-simplices with exact volume shares.

The part of a simplex on one side of a plane is a staircase of simplices: the plus vertices p and
the minus vertices m span a product, every lattice path through which gives one sub-simplex. The
vertices are corners or points z_pm = s p + r m of the zero set, with r = φ_p/(φ_p − φ_m) and
s = −φ_m/(φ_p − φ_m). Along a path each vertex brings in one new corner, so the determinant is
triangular and the volume share is a *product* of positive r and s: no cancellation however thin
the sliver. Paths follow the order of the corners; with corners ordered by their global number the
sub-simplices of neighbours match on shared faces.
"""

from functools import cache
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Staircase", "staircase"]

_Path = list[tuple[int, int]]


class Staircase(NamedTuple):
    """Sub-simplices of a clipped simplex, for every pattern of signs.

    The pattern of a simplex is Σ 2^k over the corners k on the plus side. Its sub-simplices are
    the entries ``start[pattern]`` to ``start[pattern + 1]`` of the other arrays.

    Attributes
    ----------
    start : (2^corners + 1,) int array
        First entry of each pattern; patterns without a sign change have none.
    plus, minus : (entries, corners) int array
        Sub-simplex vertex k is z_ab with a = plus, b = minus; a corner if a = b.
    factors : (entries, corners, 3) int array
        (0 for r or 1 for s, a, b): the volume share is the product over these.
    side : (entries,) int8 array
        +1 or −1.
    sign : (entries,) int8 array
        Orientation relative to the simplex: +1 or −1, the same wherever the zero points are.
    """

    start: NDArray[np.int64]
    plus: NDArray[np.int64]
    minus: NDArray[np.int64]
    factors: NDArray[np.int64]
    side: NDArray[np.int8]
    sign: NDArray[np.int8]


@cache
def staircase(corners: int) -> Staircase:
    """Make the staircase of a simplex with that many corners."""
    start, plus, minus, factors, side = [0], [], [], [], []
    for pattern in range(2**corners):
        above = [k for k in range(corners) if pattern >> k & 1]
        below = [k for k in range(corners) if not pattern >> k & 1]
        pieces = _pieces(above, below) if above and below else []
        for sign, vertices, steps in pieces:
            plus.append([a for a, _ in vertices])
            minus.append([b for _, b in vertices])
            factors.append(steps + [(1, 0, 0)] * (corners - len(steps)))
            side.append(sign)
        start.append(len(side))
    ends = np.eye(corners)[np.array([plus, minus])]
    return Staircase(
        np.array(start),
        np.array(plus),
        np.array(minus),
        np.array(factors),
        np.array(side, dtype=np.int8),
        # with all zero points in the middle of their edges
        np.sign(np.linalg.det(0.5 * (ends[0] + ends[1]))).astype(np.int8),
    )


def _pieces(
    above: list[int], below: list[int]
) -> list[tuple[int, _Path, list[tuple[int, int, int]]]]:
    """(side, vertices, factors) of all sub-simplices; indices into paths count from zero."""
    rows, columns = len(above), len(below)
    found = []
    for first in range(rows):
        for path in _lattice_paths((first, 0), (rows - 1, columns - 1)):
            corner = [(above[i], above[i]) for i in range(first + 1)]
            start = (0, above[first], below[0])
            found.append(
                (1, corner + _points(path, above, below), _steps(path, above, below, start))
            )
    for first in range(columns):
        for path in _lattice_paths((0, first), (rows - 1, columns - 1)):
            corner = [(below[j], below[j]) for j in range(first + 1)]
            start = (1, above[0], below[first])
            found.append(
                (-1, corner + _points(path, above, below), _steps(path, above, below, start))
            )
    return found


def _lattice_paths(start: tuple[int, int], end: tuple[int, int]) -> list[_Path]:
    """Monotone paths from start to end, one step in one direction at a time."""
    down, right = end[0] - start[0], end[1] - start[1]
    paths = []
    for turns in combinations(range(down + right), down):
        i, j = start
        path = [start]
        for step in range(down + right):
            i, j = (i + 1, j) if step in turns else (i, j + 1)
            path.append((i, j))
        paths.append(path)
    return paths


def _points(path: _Path, above: list[int], below: list[int]) -> _Path:
    return [(above[i], below[j]) for i, j in path]


def _steps(
    path: _Path, above: list[int], below: list[int], start: tuple[int, int, int]
) -> list[tuple[int, int, int]]:
    """Coefficient with which each vertex of the path brings in its new corner."""
    steps = [start]
    for (i, _), (k, l) in pairwise(path):
        steps.append((1 if k > i else 0, above[k], below[l]))
    return steps
