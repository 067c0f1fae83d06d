"""Surfaces of cut bodies: closed parts, facing sides, embedded surfaces that follow and bear."""

import numpy as np
import pytest
from surface_measures import enclosed_by_body, loose_edges, pinched_edges, sphere, volume_by_body

from verify.simulator.embedded_surface import EmbeddedSurface
from verify.simulator.moving_surface import BodySurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ToolPath
from verify.xfem.mesh import box_mesh, rectangle_mesh

THROUGH = [
    ToolPath.of_tip([[-0.1, -0.2, 0.48], [1.1, -0.2, 0.55]], [0.0, 1.0], [0.0, 1.4, 0.05]),
    ToolPath.of_tip([[-0.1, 0.37, -0.2], [1.1, 0.62, -0.2]], [2.0, 3.0], [0.0, 0.1, 1.4]),
    ToolPath.of_tip([[0.41, -0.1, -0.2], [0.55, 1.1, -0.2]], [4.0, 5.0], [0.1, 0.0, 1.4]),
]


PATHS = [
    THROUGH[0],
    ToolPath.of_tip([[0.3, 1.1, 1.1], [0.33, 0.1, 1.2]], [2.0, 3.0], [0.1, 0.0, -0.7]),
]


def _areas(surface, rows):
    corners = surface.material.rows[surface.facets.rows[rows]]
    return 0.5 * np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def test_three_cuts_through_leave_eight_closed_surfaces_of_the_right_volume() -> None:
    cutter = SemiProgressiveCutter(box_mesh((3, 3, 3)))
    body = BodySurface(cutter.body)
    for k, path in enumerate(THROUGH):
        cutter.begin(path)
        for time in path.times[0] + np.linspace(0.0, 1.0, 3):
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


def _own_boundary(mesh):
    outer = BodySurface(SemiProgressiveCutter(mesh).body).surface
    heaviest = np.abs(outer.weights.rows).argmax(axis=1)
    node = outer.nodes.rows[np.arange(len(heaviest)), heaviest]
    return node[outer.facets.rows]


def _cut(mesh, paths, surface_points=None, facets=None):
    cutter = SemiProgressiveCutter(mesh)
    body = BodySurface(cutter.body)
    if facets is None:
        surface_points, facets = mesh.points, _own_boundary(mesh)
    embedded = EmbeddedSurface(cutter, surface_points, facets)
    for path in paths:
        cutter.begin(path)
        for time in np.linspace(path.times[0], path.times[-1], 4):
            increment = cutter.advance(time)
            body.update(increment)
            embedded.update(increment)
    return cutter, body, embedded


@pytest.fixture(scope="module")
def embedded_sphere():
    points, facets = sphere(2)
    return _cut(box_mesh((4, 5, 3)), PATHS, 0.5 + 0.45 * points, facets)


def test_an_affine_motion_moves_every_vertex_as_it_moves_the_material(embedded_sphere) -> None:
    cutter, _, embedded = embedded_sphere
    gradient, shift = np.random.default_rng(6).normal(size=(3, 3)), np.array([1.0, -2.0, 3.0])
    nodes = cutter.mesh.points[cutter.body.node_parent.rows]
    moved = embedded.surface.positions(nodes @ gradient + shift)
    expected = embedded.surface.material.rows @ (np.eye(3) + gradient) + shift
    np.testing.assert_allclose(moved, expected, atol=1e-13)


@pytest.mark.parametrize(
    ("mesh", "paths"),
    [
        (box_mesh((4, 3, 5)), PATHS),
        (
            rectangle_mesh((6, 7)),
            [
                ToolPath.of_tip([[-0.1, 0.43], [0.4, 0.51], [0.8, 0.3]], [0.0, 1.0, 2.0]),
                ToolPath.of_tip([[0.3, 1.1], [0.33, 0.1]], [3.0, 4.0]),
            ],
        ),
    ],
)
def test_the_mesh_boundary_embedded_opens_exactly_as_the_material_does(mesh, paths) -> None:
    cutter, body, embedded = _cut(mesh, paths)
    displacement = np.random.default_rng(7).normal(size=(cutter.body.node_count, mesh.dim))
    used = body.surface.used
    outer = used[~body.surface.inner.rows[used]]
    sizes, vertices = [], []
    for surface, rows in ((body.surface, outer), (embedded.surface, embedded.surface.used)):
        x = surface.positions(displacement)
        facets = surface.facets.rows[rows]
        corners = x[facets]
        edges = corners[:, 1:] - corners[:, :1]
        sizes.append(np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))).sum())
        vertices.append(np.unique(x[np.unique(facets)].round(9), axis=0))
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-12)
    assert vertices[0].shape == vertices[1].shape
    np.testing.assert_allclose(vertices[0], vertices[1], atol=1e-9)


def test_virtual_work_is_the_same_on_the_surface_and_on_the_unknowns(embedded_sphere) -> None:
    cutter, body, embedded = embedded_sphere
    rng = np.random.default_rng(8)
    motion = rng.normal(size=(cutter.body.node_count, 3))
    for surface in (embedded.surface, body.surface):
        rows = surface.used
        at, force = rng.dirichlet(np.ones(3), len(rows)), rng.normal(size=(len(rows), 3))
        nodal = np.zeros_like(motion)
        surface.add_forces(rows, at, force, nodal)
        before, after = (
            np.einsum("qk,qks->qs", at, points[surface.facets.rows[rows]])
            for points in (surface.material.rows, surface.positions(motion))
        )
        work = (force * (after - before)).sum()
        assert (nodal * motion).sum() == pytest.approx(work, rel=1e-12)
        # forces in equilibrium stay so: resultant and moment
        np.testing.assert_allclose(nodal.sum(axis=0), force.sum(axis=0), atol=1e-11)
        x = cutter.mesh.points[cutter.body.node_parent.rows]
        moment = np.cross(before, force).sum(axis=0)
        np.testing.assert_allclose(np.cross(x, nodal).sum(axis=0), moment, atol=1e-10)
