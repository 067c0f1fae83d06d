"""Geometry of cuts: level sets, sweeps of a tool, nearest facets, areas of thin triangles."""

from fractions import Fraction
from math import isqrt

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from surface_measures import sphere

from verify.geometry.simplices import measures
from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.simulator.surfaces import SurfaceCollider
from verify.xfem.arrays import XfemError
from verify.xfem.cuts import PolygonPatch, Polyline, ToolPath, TriangulatedSurface
from verify.xfem.faceted_cuts import nearest_on_facet
from verify.xfem.mesh import SimplexMesh, box_mesh


def test_the_left_side_is_positive_at_a_sharp_kink_too():
    kink = Polyline([[-1.0, 0.0], [0.0, 0.0], [-1.0, 0.3]])  # turns back to the left
    at = np.array([[-0.9, 0.1], [-0.9, -0.1], [0.5, 0.0], [0.1, 0.4], [-0.5, 0.3]])
    assert np.sign(kink.level_set(at)).tolist() == [1, -1, -1, -1, -1]
    assert kink.level_set(np.array([[0.5, 0.0]])) == pytest.approx([-0.5])


@pytest.mark.parametrize(
    ("points", "pair"),
    [
        ([[0, 0], [4, 0], [4, 3], [2, -1]], (0, 2)),  # crosses
        ([[0, 0], [4, 0], [4, 3], [2, 0]], (0, 2)),  # ends on a segment
        ([[0, 0], [4, 0], [4, 3], [1, 3], [0, 0]], (0, 3)),  # ends in its begin
        ([[9, 9], [0, 0], [4, 0], [4, 3], [3, 0], [3, -1]], (1, 3)),
        ([[0, 0], [4, 0], [4, 3], [2, 1]], None),
    ],
)
def test_a_polyline_that_meets_itself_is_refused_with_its_first_pair_of_segments(points, pair):
    if pair is None:
        assert np.isfinite(Polyline(points).level_set(np.array([[9.0, 9.0]]))).all()
    else:
        with pytest.raises(XfemError, match="segments {} and {} ".format(*pair)):
            Polyline(points)


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


def test_a_closed_surface_is_the_distance_to_the_sphere_up_to_its_facets():
    ball = TriangulatedSurface(*sphere(3))
    points = np.random.default_rng(1).uniform(-1.5, 1.5, (300, 3))
    exact = np.linalg.norm(points, axis=1) - 1.0
    # a facet of circumradius R = h/√3 lies up to R²/2 below the sphere
    corners = ball.points[ball.triangles]
    h = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    assert np.abs(ball.level_set(points) - exact).max() < 1.05 * h**2 / 6.0
    assert np.isinf(ball.depth(points)).all()


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


def test_a_sweep_in_space_has_the_level_set_of_its_triangulation() -> None:
    # a bent blade of three points on a bent path
    x, y = np.meshgrid(np.linspace(0.0, 1.0, 6), np.linspace(0.0, 1.0, 3), indexing="ij")
    blades = np.stack([x, y, 0.3 * np.sin(2.0 * x) + 0.2 * y**2], axis=2)
    number = np.arange(18).reshape(6, 3)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    triangles = np.concatenate(
        [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
    )
    surface = TriangulatedSurface(blades.reshape(-1, 3), triangles)
    points = np.random.default_rng(2).uniform(-0.3, 1.3, (500, 3))
    sweep = ToolPath(blades, np.arange(6)).sweep
    np.testing.assert_allclose(sweep.level_set(points), surface.level_set(points), atol=1e-13)
    # both call a point past the rim the same, and by the same distance
    past = surface.depth(points) < -1e-12
    np.testing.assert_allclose(sweep.depth(points)[past], surface.depth(points)[past], atol=1e-13)
    assert (sweep.depth(points)[~past] >= -1e-12).all()


def test_the_blade_passes_points_in_proportion_to_its_travel() -> None:
    # 0.6 m in 2 s, 3 s of rest, 0.4 m in 1 s
    path = ToolPath.of_tip([[0.0, 0.0], [0.6, 0.0], [0.6, 0.0], [1.0, 0.0]], [0.0, 2.0, 5.0, 6.0])
    x = np.array([0.0, 0.15, 0.6, 0.8, 1.0])
    travel = path.sweep.probed(np.stack([x, np.zeros(5)], axis=1))[:, 2]
    np.testing.assert_allclose(travel, x, atol=1e-15)
    np.testing.assert_allclose(path.time_at(travel), [0.0, 0.5, 2.0, 5.5, 6.0], atol=1e-14)
    assert path.travel_at(3.0) == pytest.approx(0.6)
    assert path.travel_at(-1.0) < 0.0
    np.testing.assert_array_equal(travel <= path.travel_at(5.5), [True, True, True, True, False])


@pytest.mark.parametrize(
    ("tips", "depth"),
    [
        ([[0.2, 0.3], [0.2, 0.3]], None),
        ([[0.2, 0.3, 0.1], [0.2, 0.3, 0.1]], [0.0, 0.0, 0.5]),
        ([[0.2, 0.3, 0.1], [0.2, 0.3, 0.9]], [0.0, 0.0, 0.5]),
        ([[0.2, 0.3, 0.1], [0.2, 0.3 + 1e-13, 0.9]], [0.0, 0.0, 0.5]),
    ],
    ids=["rests", "blade rests", "moves along itself", "nearly along itself"],
)
def test_a_blade_that_stays_on_its_line_sweeps_nothing(tips, depth) -> None:
    path = ToolPath.of_tip(tips, [0.0, 1.0], depth)
    points = np.random.default_rng(3).uniform(0.0, 1.0, (20, len(tips[0])))
    assert (path.sweep.depth(points) < 0.0).all()
    assert (path.sweep.level_set(points) > 0.0).all()


def test_a_tool_touches_the_facets_within_its_radius_and_no_others() -> None:
    # a cut body, displaced at random; the distance to a convex facet is convex along the tool
    cutter = SemiProgressiveCutter(box_mesh((3, 3, 3)))
    body = BodySurface(cutter.body)
    surface, collider = body.surface, SurfaceCollider(body.surface)
    cutter.begin(ToolPath.of_tip([[-0.1, 0.47, -0.2], [1.1, 0.53, -0.2]], [0, 1], [0.0, 0.1, 1.4]))
    rng, weights = np.random.default_rng(1), np.empty(3)
    for time, count in ((0.4, 2), (1.0, 4)):
        body.update(cutter.advance(time))
        x = surface.positions(0.05 * rng.normal(size=(cutter.body.node_count, 3)))
        collider.follow(x)
        hits = 0
        for _ in range(count):
            start, end = rng.uniform(-0.3, 1.3, (2, 3))
            contacts = collider.touched(start, end, 0.05)
            found = dict(zip(contacts.facet.tolist(), contacts.distance, strict=True))
            for row in surface.used:
                corners = x[surface.facets.rows[row]]

                def away(share, start=start, end=end, corners=corners):
                    place = start + share * (end - start)
                    nearest_on_facet(place, corners, weights)
                    return np.linalg.norm(weights @ corners - place)

                inside = minimize_scalar(away, bounds=(0, 1), options={"xatol": 1e-9}).fun
                exact = min(inside, away(0.0), away(1.0))
                assert abs(exact - 0.05) > 1e-6  # nothing undecided
                assert (row in found) == (exact < 0.05)
                # the search knows the place up to √ε, and so the distance where it has a kink
                assert found.get(row, exact) == pytest.approx(exact, abs=1e-7)
            foot = np.einsum("qk,qki->qi", contacts.at, x[surface.facets.rows[contacts.facet]])
            share = np.clip((foot - start) @ (end - start) / ((end - start) @ (end - start)), 0, 1)
            gap = np.linalg.norm(foot - start - share[:, None] * (end - start), axis=1)
            np.testing.assert_allclose(gap, contacts.distance, atol=1e-12)
            hits += len(found)
        assert hits > 5 * count


_EPS = np.finfo(float).eps
_DIGITS = 10**60


def _exact_area(corners):
    """Area of the triangle whose corners are these floating-point numbers, to 30 digits."""
    a, b, c = ([Fraction(float(x)) for x in corner] for corner in corners)
    u, v = ([x - y for x, y in zip(end, a, strict=True)] for end in (b, c))
    uu, uv, vv = (
        sum(x * y for x, y in zip(p, q, strict=True)) for p, q in ((u, u), (u, v), (v, v))
    )
    scaled = (uu * vv - uv * uv) / 4 * _DIGITS**2
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


def test_a_thin_triangle_in_space_has_the_exact_area_and_gradients_of_linear_fields():
    """In any order of its corners."""
    for corners in _thin_triangles(60):
        exact, allowed = _exact_area(corners), _allowed(corners)
        for order in ([0, 1, 2], [2, 0, 1], [1, 0, 2]):
            assert abs(SimplexMesh(corners, [order]).measures[0] / exact - 1.0) <= allowed
            assert abs(measures(corners[None, order])[0] / exact - 1.0) <= allowed
        gradients = SimplexMesh(corners, [[0, 1, 2]]).gradients[0]
        # the gradient of a shape function takes it from 0 to 1 along the edges
        edges = corners[1:] - corners[0]
        expected = np.array([[-1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        size = np.abs(gradients).max() * np.linalg.norm(edges, axis=1).max()
        assert np.abs(edges @ gradients.T - expected).max() <= 8 * _EPS * max(1.0, size)
