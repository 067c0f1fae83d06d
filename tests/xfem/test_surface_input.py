"""Surfaces and tools: what does not fit is refused, what is degenerate is found."""

import numpy as np
import pytest

from verify.simulator.collision.surface_collider import SurfaceCollider
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
from verify.simulator.mapping.pull_back import pull_back
from verify.xfem.errors import XfemError
from verify.xfem.nearest_points import nearest_on_facet
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.tool_path import ToolPath


def _model(dim):
    cutter = SemiProgressiveCutter(rectangle_mesh((3, 3)) if dim == 2 else box_mesh((2, 2, 2)))
    body = BodySurface(cutter.body)
    tips = [[-0.1, 0.47, -0.2][:dim], [1.1, 0.53, -0.2][:dim]]
    cutter.begin(ToolPath.of_tip(tips, [0.0, 1.0], [0.0, 0.1, 1.4] if dim == 3 else None))
    body.update(cutter.advance(1.0))
    return cutter, body.surface


@pytest.mark.parametrize("dim", [2, 3])
def test_arrays_and_contacts_that_are_none_are_refused_by_a_surface(dim):
    """The kernels check no bounds, and -1, which a contact has that is none, is the last facet."""
    cutter, surface = _model(dim)
    nodal = np.zeros((cutter.body.node_count, dim))
    forces, thirds = np.ones(surface.material.rows.shape), np.full(dim, 1.0 / dim)
    facet = int(surface.used[0])
    for call, message in (
        (lambda: surface.positions(nodal, forces[:2].copy()), "positions of shape"),
        (lambda: surface.positions(nodal.tolist()), "nodal"),
        (lambda: surface.nodal_forces(forces[:2], nodal), "forces of shape"),
        (lambda: surface.nodal_forces(forces[0], nodal), "forces of shape"),
        (lambda: surface.nodal_forces(forces, nodal.astype(int)), "nodal"),
        (lambda: surface.facet_force(-1, thirds, thirds, nodal), "facet"),
        (lambda: surface.facet_force(10**6, thirds, thirds, nodal), "facet 1000000"),
        (lambda: surface.facet_force(facet, thirds[:1], thirds, nodal), "at a place of shape"),
        (lambda: surface.facet_force(facet, thirds, np.ones(dim + 1), nodal), "force of shape"),
    ):
        with pytest.raises(XfemError, match=message):
            call()
    assert not nodal.any()


@pytest.mark.parametrize("dim", [2, 3])
def test_a_collider_refuses_places_and_limits_that_are_none(dim):
    _, surface = _model(dim)
    collider, point = SurfaceCollider(surface), [[0.1] * dim]
    none = np.zeros(1, dtype=np.int64)
    for call, message in (
        (lambda: collider.nearest(point, limit=-1.0), "limit -1"),
        (lambda: collider.nearest(point, limit=np.nan), "limit nan"),
        (lambda: collider.nearest(point, piece_body=none, body=0), "bodies"),
        (lambda: collider.follow(surface.material.rows * np.nan), "not finite"),
    ):
        with pytest.raises(XfemError, match=message):
            call()
    assert len(collider.nearest(np.empty((0, dim))).facet) == 0


def test_degenerate_tools_touch_what_a_search_of_all_facets_touches():
    """A point, one on a corner, along an edge, in a face, through the body in one step, inside."""
    _, surface = _model(3)
    collider = SurfaceCollider(surface)
    rows = surface.used
    corners = surface.material.rows[surface.facets.rows[rows]]
    weights = np.empty(3)
    tools = [
        ([0.5] * 3, [0.5] * 3, 0.0),
        ([0.5] * 3, [0.5] * 3, 0.3),
        ([0.0] * 3, [0.0] * 3, 0.0),
        ([-0.1] * 3, [0.0] * 3, 0.0),
        ([-0.1, 0.0, 0.0], [1.1, 0.0, 0.0], 0.0),
        ([0.0, -0.5, -0.5], [0.0, 1.5, 1.5], 0.0),
        ([-1.0, 0.3, 0.3], [2.0, 0.3, 0.3], 0.05),
        ([5.0] * 3, [6.0] * 3, 1e3),
        ([5.0] * 3, [6.0] * 3, 0.0),
        ([0.5] * 3, [0.5 + 1e-300] * 3, 0.01),
    ]
    for start, end, radius in tools:
        axis = np.linspace(start, end, 301)
        gap = np.full(len(rows), np.inf)
        for k, facet in enumerate(corners):
            for x in axis:
                nearest_on_facet(x, facet, weights)
                gap[k] = min(gap[k], np.linalg.norm(weights @ facet - x))
        found = collider.touched(start, end, radius)
        step = np.linalg.norm(np.subtract(end, start)) / 300
        # touching is exact up to round-off; sampling the axis is an upper bound, good to a step
        assert set(rows[gap <= radius]) <= set(found.facet)
        assert set(found.facet) <= set(rows[gap <= radius + step + 1e-13])
        assert np.isfinite(found.at).all()
        assert np.isfinite(found.distance).all()
        assert ((found.share >= 0.0) & (found.share <= 1.0)).all()


@pytest.mark.parametrize("dim", [2, 3])
def test_the_way_back_from_crushed_and_inverted_material_is_a_way_there_or_none(dim):
    """What is found maps to where the tool is; numbers that overflow are found in no piece."""
    cutter, _ = _model(dim)
    mesh, body = cutter.mesh, cutter.body
    X = mesh.points[body.node_parent.rows]
    rng = np.random.default_rng(2)
    places = rng.uniform(-0.5, 1.5, (60, dim))
    start = np.zeros(len(places), dtype=np.int64)
    reflected = -2.0 * (X - 0.5) * np.eye(dim)[0]
    counts = []
    for moved in (reflected, rng.normal(size=X.shape), 0.5 * reflected, 0.5 - X, 1e200 * X):
        material, piece = pull_back(cutter, moved, places, start)
        assert np.isfinite(material).all()
        at = np.flatnonzero(piece >= 0)
        corners = mesh.points[mesh.cells[body.piece_parent.rows[piece[at]]]]
        lifted = np.concatenate(
            [corners.transpose(0, 2, 1), np.ones((len(at), 1, dim + 1))], axis=1
        )
        wanted = np.concatenate([material[at], np.ones((len(at), 1))], axis=1)[:, :, None]
        weights = np.linalg.solve(lifted, wanted)[:, :, 0]
        there = corners + moved[body.piece_cells.rows[piece[at]]]
        np.testing.assert_allclose(np.einsum("qa,qas->qs", weights, there), places[at], atol=1e-9)
        counts.append(len(at))
    assert counts[1] > 3
    assert counts[2:] == [0, 0, 0]  # crushed to a plane, to a point, beyond all numbers
    # turned inside out the body is where it was: what is in it is found, from one side of the cut
    # or from both, since a walk also asks what lies in the same element
    sides = [int(np.flatnonzero(body.piece_label.rows[:, 0] == side)[0]) for side in (-1, 1)]
    found = [pull_back(cutter, reflected, places, start + side)[1] >= 0 for side in sides]
    inside = ((places > 0.0) & (places < 1.0)).all(axis=1)
    np.testing.assert_array_equal(found[0] | found[1], inside)
    for wrong in (places * np.nan, places * np.inf):
        with pytest.raises(XfemError, match="points"):
            pull_back(cutter, moved, wrong, start)
    with pytest.raises(XfemError, match="displacement"):
        pull_back(cutter, moved * np.nan, places, start)
