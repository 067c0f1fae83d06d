"""The error field of the pictures: zero where two solutions agree, on both lips of a cut."""

import numpy as np

from verify.compare.locate import SolutionField
from verify.runner.error_field import nodal_error
from verify.solution import Solution


def opened_square(columns: int, height: float) -> Solution:
    """Two layers on each side of the cut y = 0, the inner ones of this height, opened by 1."""
    x = np.linspace(0.0, 1.0, columns + 1)
    points, cells, displacement = [], [], []
    for sign in (1.0, -1.0):
        start = len(points)
        for y in (0.0, sign * height, sign * 0.5):
            points += [(a, y) for a in x]
            displacement += [(0.0, 0.5 * sign)] * len(x)
        for row in range(2):
            for i in range(columns):
                a = start + row * (columns + 1) + i
                b, c, d = a + 1, a + columns + 1, a + columns + 2
                cells += [(a, b, d), (a, d, c)]
    return Solution(np.array(points), np.array(cells), np.array(displacement)[None])


def test_lips_are_compared_with_their_own_side_however_slender_the_cells() -> None:
    # the cells at the cut are up to 1e5 times longer than high, and the meshes do not match
    for height in (1e-1, 1e-3, 1e-6):
        own, other = opened_square(10, height), opened_square(7, 0.3)
        assert nodal_error(own, SolutionField(other)).max() <= 1e-12
