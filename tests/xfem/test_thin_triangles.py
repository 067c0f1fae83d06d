"""Areas and gradients of thin triangles in space, against exact rational arithmetic."""

from fractions import Fraction
from math import isqrt

import numpy as np
import pytest

from verify.compare.splitting import measures
from verify.xfem.mesh import SimplexMesh

_EPS = np.finfo(float).eps
_DIGITS = 10**60


def _minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _exact_area(corners):
    """Area of the triangle whose corners are these floating-point numbers, to 30 digits."""
    a, b, c = ([Fraction(float(x)) for x in corner] for corner in corners)
    square = sum(x * x for x in _cross(_minus(b, a), _minus(c, a))) / 4
    scaled = square * _DIGITS**2
    return float(Fraction(isqrt(scaled.numerator * 10**8 // scaled.denominator), _DIGITS * 10**4))


def _thin_triangles(count):
    """Needles and caps in any direction, heights over bases from 1e-1 to 1e-9."""
    rng = np.random.default_rng(4)
    for _ in range(count):
        thin = 10.0 ** rng.uniform(-9, -1)
        apex = rng.choice([0.0, thin, rng.uniform(-0.5, 1.5)])
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        flat = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [apex, thin, 0.0]])
        yield 10.0 ** rng.uniform(-3, 3) * (flat @ turn.T)


def _allowed(corners):
    """Round-off of the product of the two shorter edges over the area: a few last places."""
    lengths = np.sort(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1))
    return 8 * _EPS * max(1.0, lengths[0] * lengths[1] / (2 * _exact_area(corners)))


@pytest.mark.parametrize("order", [[0, 1, 2], [1, 2, 0], [2, 0, 1], [1, 0, 2]])
def test_the_area_of_a_thin_triangle_in_space_is_exact_in_any_order_of_its_corners(order):
    for corners in _thin_triangles(300):
        area = SimplexMesh(corners, [order]).measures[0]
        exact = _exact_area(corners)
        assert abs(area / exact - 1.0) <= _allowed(corners)
        compared = measures(corners[None, order])[0]
        assert abs(compared / exact - 1.0) <= _allowed(corners)


def test_gradients_on_a_thin_triangle_in_space_are_those_of_a_linear_field():
    for corners in _thin_triangles(300):
        gradients = SimplexMesh(corners, [[0, 1, 2]]).gradients[0]
        # the gradient of a shape function takes it from 0 to 1 along the edges
        edges = corners[1:] - corners[0]
        rise = edges @ gradients.T
        expected = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        lengths = np.linalg.norm(edges, axis=1)
        size = np.abs(gradients).max() * lengths.max()
        assert np.abs(rise - expected).max() <= 8 * _EPS * max(1.0, size)
