"""Plane predicates: where a cut lies in a body, checked against exact geometry."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from verify.scene.planar import (
    distance_to_outline,
    inner_parts,
    inside_polygon,
    overlap_length,
    point_along,
)

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
NOTCHED = np.array([[0.0, 0.0], [3.0, 0.0], [3.0, 2.0], [2.0, 2.0], [2.0, 1.0], [1.0, 1.0],
                    [1.0, 2.0], [0.0, 2.0]])  # fmt: skip


def length(parts):
    return sum(float(np.linalg.norm(b - a)) for a, b in parts)


@given(
    st.tuples(*[st.floats(-2, 3) for _ in range(4)]).filter(
        lambda v: np.hypot(v[2] - v[0], v[3] - v[1]) > 1e-3
    )
)
def test_the_inner_length_equals_that_of_clipping_against_half_planes(values):
    a, b = np.array(values[:2]), np.array(values[2:])
    low, high = 0.0, 1.0  # Liang–Barsky
    for c in range(2):
        for sign, bound in ((1, 1.0), (-1, 0.0)):
            p, q = sign * (b[c] - a[c]), sign * (bound - a[c])
            if p > 0:
                high = min(high, q / p)
            elif p < 0:
                low = max(low, q / p)
            elif q < 0:
                high = -1.0
    expected = max(high - low, 0.0) * np.linalg.norm(b - a)
    middle = a + 0.5 * (low + high) * (b - a)
    if distance_to_outline(middle[None], SQUARE)[0] > 1e-8:
        # a part that runs along the boundary (within 1e-9) is none
        assert length(inner_parts(np.array([a, b]), SQUARE)) == pytest.approx(expected, abs=1e-7)


def test_winding_decides_inside_for_both_orientations():
    points = np.array([[0.5, 0.5], [1.5, 1.5], [2.5, 1.5], [-0.1, 0.5]])
    assert inside_polygon(points, NOTCHED).tolist() == [True, False, True, False]
    assert inside_polygon(points, NOTCHED[::-1]).tolist() == [True, False, True, False]


def test_overlap_is_the_shared_length_and_a_crossing_has_none():
    level = np.array([[0.0, 0.0], [1.0, 0.0]])
    assert overlap_length(level, np.array([[0.75, 0.0], [2.0, 0.0]])) == pytest.approx(0.25)
    assert overlap_length(level, np.array([[2.0, 0.0], [-1.0, 0.0]])) == pytest.approx(1.0)
    assert overlap_length(level, np.array([[0.5, -1.0], [0.5, 1.0]])) == 0.0
    assert overlap_length(level, np.array([[1.0, 0.0], [2.0, 0.0]])) == 0.0


def test_a_fraction_of_the_length_is_found_across_kinks():
    kinked = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 3.0]])
    np.testing.assert_allclose(point_along(kinked, 0.5), [1.0, 1.0], atol=1e-15)
