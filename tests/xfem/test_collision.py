"""Collision: a query answers as brute force does, before and after the surface has moved."""

import numpy as np
import pytest

from verify.simulator.collision.surface_collider import SurfaceCollider
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
from verify.xfem.cuts import ToolPath
from verify.xfem.faceted_cuts import nearest_on_facet
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh


def _model(dim, seed):
    """A cut body, its surface displaced at random, and the collider on it."""
    mesh = box_mesh((4, 4, 4)) if dim == 3 else rectangle_mesh((8, 8))
    cutter = SemiProgressiveCutter(mesh)
    body = BodySurface(cutter.body)
    collider = SurfaceCollider(body.surface)
    depth = [0.0, 0.1, 1.4] if dim == 3 else None
    tips = [[-0.1, 0.47, -0.2], [1.1, 0.53, -0.2]]
    cutter.begin(ToolPath.of_tip([tip[:dim] for tip in tips], [0.0, 1.0], depth))
    rng = np.random.default_rng(seed)
    for time in (0.4, 1.0):
        body.update(cutter.advance(time))
        displacement = 0.05 * rng.normal(size=(cutter.body.node_count, dim))
        collider.refit(displacement)
    collider.refit(displacement)  # once without a change of the surface
    rows = body.surface.used
    corners = body.surface.positions(displacement)[body.surface.facets.rows[rows]]
    return cutter, body, collider, rows, corners, rng


@pytest.mark.parametrize("dim", [2, 3])
def test_the_nearest_facet_is_that_of_all(dim) -> None:
    _, body, collider, rows, corners, rng = _model(dim, 1)
    points = rng.uniform(-0.3, 1.3, (60, dim))
    contacts = collider.nearest(points)
    weights = np.empty(dim)
    for q, x in enumerate(points):
        best = np.inf
        for facet in corners:
            nearest_on_facet(x, facet, weights)
            best = min(best, np.linalg.norm(weights @ facet - x))
        assert contacts.distance[q] == pytest.approx(best, rel=1e-12)
        foot = contacts.at[q] @ corners[np.searchsorted(rows, contacts.facet[q])]
        assert np.linalg.norm(foot - x) == pytest.approx(best, rel=1e-12)
    np.testing.assert_array_equal(contacts.piece, body.surface.facet_piece.rows[contacts.facet])
    # a limit hides what is farther, and nothing else
    limited = collider.nearest(points, limit=0.05)
    np.testing.assert_array_equal(limited.facet >= 0, contacts.distance < 0.05)
    assert np.isinf(limited.distance[limited.facet < 0]).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_a_segment_pierces_what_a_linear_solve_says(dim) -> None:
    _, _, collider, rows, corners, rng = _model(dim, 3)
    hits = 0
    for _ in range(40):
        start, end = rng.uniform(-0.3, 1.3, (2, dim))
        contacts = collider.pierced(start, end)
        expected = {}
        for facet, corner in zip(rows, corners, strict=True):
            matrix = np.column_stack([start - end, *(corner[1:] - corner[0])])
            share, *rest = np.linalg.solve(matrix, start - corner[0])
            if 0 <= share <= 1 and min([*rest, 1 - sum(rest)]) >= 0:
                expected[int(facet)] = share
        assert sorted(contacts.facet.tolist()) == sorted(expected)
        assert (np.diff(contacts.share) >= 0.0).all()
        for k, facet in enumerate(contacts.facet):
            assert contacts.share[k] == pytest.approx(expected[int(facet)], abs=1e-10)
            foot = contacts.at[k] @ corners[np.searchsorted(rows, facet)]
            np.testing.assert_allclose(foot, start + contacts.share[k] * (end - start), atol=1e-12)
        hits += len(expected)
    assert hits > 40
