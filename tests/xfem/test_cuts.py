"""Cuts know on which side a point lies, how far away, and whether they reach it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.xfem.cuts import PolygonPatch, Polyline, TriangulatedSurface

COORDINATE = st.floats(-3.0, 3.0)


@given(COORDINATE, COORDINATE)
@settings(deadline=None)  # the first example compiles
def test_a_straight_polyline_is_the_signed_distance_to_its_line(x, y):
    line = Polyline([[0.0, 0.0], [1.0, 0.0], [2.5, 0.0]])
    assert line.level_set(np.array([[x, y]])) == pytest.approx([y], abs=1e-15)
    assert line.depth(np.array([[x, 0.0]])) == pytest.approx([min(x, 2.5 - x)], abs=1e-14)


def test_the_left_side_is_positive_at_a_sharp_kink_too():
    kink = Polyline([[-1.0, 0.0], [0.0, 0.0], [-1.0, 0.3]])  # turns back to the left
    at = np.array([[-0.9, 0.1], [-0.9, -0.1], [0.5, 0.0], [0.1, 0.4], [-0.5, 0.3]])
    assert np.sign(kink.level_set(at)).tolist() == [1, -1, -1, -1, -1]
    assert kink.level_set(np.array([[0.5, 0.0]])) == pytest.approx([-0.5])


def test_a_circle_of_segments_is_the_distance_to_the_circle_up_to_its_sagitta():
    angle = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    circle = Polyline(np.stack([np.cos(angle), np.sin(angle)], 1), closed=True)
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (500, 2))
    exact = 1.0 - np.linalg.norm(points, axis=1)  # anticlockwise: the inside is on the left
    assert np.abs(circle.level_set(points) - exact).max() < 2.0 * (np.pi / 200) ** 2
    assert np.isinf(circle.depth(points)).all()


def test_a_polygon_patch_ends_at_its_outline():
    corners = [[0, 0, 0.5], [2, 0, 0.5], [2, 2, 0.5], [1, 1, 0.5], [0, 2, 0.5]]
    cut = PolygonPatch(corners)
    inside, notch = np.array([[0.5, 0.5, 0.5]]), np.array([[1.0, 1.5, 0.5]])
    assert cut.level_set(np.array([[9.0, 9.0, 0.7]])) == pytest.approx([0.2])
    assert cut.depth(inside) == pytest.approx([0.5])
    assert cut.depth(notch) == pytest.approx([-np.sqrt(0.125)])


def icosphere(levels=3):
    """Unit sphere: an octahedron, divided and projected."""
    points = [np.array(p, float) for p in np.concatenate([np.eye(3), -np.eye(3)])]
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    for _ in range(levels):
        middle, divided = {}, []
        for a, b, c in faces:
            new = []
            for p, q in ((a, b), (b, c), (c, a)):
                key = (min(p, q), max(p, q))
                if key not in middle:
                    middle[key] = len(points)
                    m = points[p] + points[q]
                    points.append(m / np.linalg.norm(m))
                new.append(middle[key])
            ab, bc, ca = new
            divided += [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        faces = divided
    return TriangulatedSurface(np.array(points), np.array(faces))


def test_a_closed_surface_is_the_distance_to_the_sphere_up_to_its_facets():
    sphere = icosphere()
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3))
    exact = np.linalg.norm(points, axis=1) - 1.0
    # a facet of circumradius R = h/√3 lies up to R²/2 below the sphere
    corners = sphere.points[sphere.triangles]
    h = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    assert np.abs(sphere.level_set(points) - exact).max() < 1.05 * h**2 / 6.0
    assert np.isinf(sphere.depth(points)).all()


def test_a_flat_triangulated_patch_is_its_plane_and_ends_at_its_rim():
    grid = np.array([[x, y, 0.0] for y in (0, 1, 2) for x in (0, 1, 2)], float)
    cells = [(a, a + 1, a + 4) for a in (0, 1, 3, 4)] + [(a, a + 4, a + 3) for a in (0, 1, 3, 4)]
    surface = TriangulatedSurface(grid, cells)
    points = np.random.default_rng(2).uniform(-2.0, 4.0, (400, 3))
    assert surface.level_set(points) == pytest.approx(points[:, 2], abs=1e-14)
    flat = points * [1, 1, 0]
    outside = np.maximum(np.maximum(-flat[:, :2], flat[:, :2] - 2.0), 0.0)
    past = np.linalg.norm(outside, axis=1)
    to_rim = np.minimum(flat[:, :2], 2.0 - flat[:, :2]).min(axis=1)
    want = np.where(past > 0.0, -past, to_rim)
    assert surface.depth(flat) == pytest.approx(want, abs=1e-14)
