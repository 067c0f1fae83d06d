"""The surface of cut material: inner faces from the cut, watertight with the split outer ones."""

import numpy as np
import pytest
from surface_measures import enclosed_by_body, loose_edges, pinched_edges, volume_by_body

from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.simulator.mapping.body_surface import BodySurface
from verify.xfem.cuts import ToolPath
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh

THROUGH = [
    ToolPath.of_tip([[-0.1, -0.2, 0.48], [1.1, -0.2, 0.55]], [0.0, 1.0], [0.0, 1.4, 0.05]),
    ToolPath.of_tip([[-0.1, 0.37, -0.2], [1.1, 0.62, -0.2]], [2.0, 3.0], [0.0, 0.1, 1.4]),
    ToolPath.of_tip([[0.41, -0.1, -0.2], [0.55, 1.1, -0.2]], [4.0, 5.0], [0.1, 0.0, 1.4]),
]


def _areas(surface, rows):
    corners = surface.material.rows[surface.facets.rows[rows]]
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def test_three_cuts_through_leave_eight_closed_surfaces_of_the_right_volume() -> None:
    cutter = SemiProgressiveCutter(box_mesh((4, 4, 4)))
    body = BodySurface(cutter.body)
    for k, path in enumerate(THROUGH):
        cutter.begin(path)
        for time in path.times[0] + np.linspace(0.0, 1.0, 5):
            body.update(cutter.advance(time))
        phantom = cutter.phantom_mesh()
        facets = body.surface.facets.rows[body.surface.used]
        # nothing is closed any more: every edge has exactly two triangles, in opposite directions
        assert loose_edges(facets) == 0
        assert pinched_edges(facets) == 0
        volumes = volume_by_body(phantom)
        assert len(volumes) == 2 ** (k + 1)
        np.testing.assert_allclose(enclosed_by_body(body.surface, phantom), volumes, rtol=1e-12)


def test_the_two_sides_of_an_open_cut_face_each_other_and_have_its_area() -> None:
    cutter = SemiProgressiveCutter(box_mesh((4, 3, 5)))
    body = BodySurface(cutter.body)
    cutter.begin(THROUGH[0])
    body.update(cutter.advance(1.0))
    used = body.surface.used
    inner = _areas(body.surface, used[body.surface.inner.rows[used]])
    np.testing.assert_allclose(inner.sum(axis=0), 0.0, atol=1e-14)
    # a plane z = a + b x + c y over the unit square, twice
    slope = np.array([0.07 / 1.2, 0.05 / 1.4])
    assert np.linalg.norm(inner, axis=1).sum() == pytest.approx(
        2.0 * np.sqrt(1.0 + slope @ slope), rel=1e-12
    )
    outer = _areas(body.surface, used[~body.surface.inner.rows[used]])
    assert np.linalg.norm(outer, axis=1).sum() == pytest.approx(6.0, rel=1e-12)


@pytest.mark.parametrize("offset", [1e-2, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-9])
def test_a_sliver_is_as_closed_as_any_piece(offset) -> None:
    # the plane passes all nodes of the middle layer at that distance
    cutter = SemiProgressiveCutter(box_mesh((3, 3, 4)))
    body = BodySurface(cutter.body)
    height = 0.5 + offset
    cutter.begin(
        ToolPath.of_tip([[-0.1, -0.2, height], [1.1, -0.2, height]], [0.0, 1.0], [0.0, 1.4, 0.0])
    )
    body.update(cutter.advance(1.0))
    phantom = cutter.phantom_mesh()
    facets = body.surface.facets.rows[body.surface.used]
    assert loose_edges(facets) == 0
    assert pinched_edges(facets) == 0
    np.testing.assert_allclose(
        np.sort(enclosed_by_body(body.surface, phantom)),
        np.sort([height, 1.0 - height]),
        rtol=1e-12,
    )


def test_in_the_plane_the_outline_of_each_part_is_closed() -> None:
    cutter = SemiProgressiveCutter(rectangle_mesh((7, 5), diagonal="crossed"))
    body = BodySurface(cutter.body)
    for path in (
        ToolPath.of_tip([[-0.1, 0.4], [0.5, 0.55], [1.1, 0.3]], [0.0, 1.0, 2.0]),
        ToolPath.of_tip([[0.4, -0.1], [0.45, 1.1]], [3.0, 4.0]),
    ):
        cutter.begin(path)
        for time in np.linspace(path.times[0], path.times[-1], 6):
            body.update(cutter.advance(time))
            facets = body.surface.facets.rows[body.surface.used]
            assert loose_edges(facets) == 0
    phantom = cutter.phantom_mesh()
    assert len(volume_by_body(phantom)) == 4
    np.testing.assert_allclose(
        enclosed_by_body(body.surface, phantom), volume_by_body(phantom), rtol=1e-12
    )


def test_a_surface_begun_after_a_cut_is_the_one_that_has_followed_it() -> None:
    cutter = SemiProgressiveCutter(box_mesh((3, 4, 3)))
    followed = BodySurface(cutter.body)
    for path in THROUGH[:2]:
        cutter.begin(path)
        for time in path.times[0] + np.array([0.3, 0.6, 1.0]):
            followed.update(cutter.advance(time))
    fresh = BodySurface(cutter.body)
    rng = np.random.default_rng(5)
    displacement = rng.normal(size=(cutter.body.node_count, 3))
    shapes = []
    for body in (followed, fresh):
        x = body.surface.positions(displacement)
        corners = np.sort(x[body.surface.facets.rows[body.surface.used]].reshape(-1, 9), axis=1)
        shapes.append(corners[np.lexsort(corners.T)])
    np.testing.assert_allclose(shapes[0], shapes[1], atol=1e-13)
