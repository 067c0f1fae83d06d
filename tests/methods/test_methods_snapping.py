"""Snapping: nodes go onto the cut, and no cell turns inside out for it."""

import numpy as np
import pytest
from cut_bodies import shaken
from hypothesis import given, settings
from hypothesis import strategies as st

from verify.methods import cut_by
from verify.methods.snapping import snap_nodes, take_near_nodes
from verify.xfem.cuts import ImplicitCut, Plane, Polyline
from verify.xfem.mesh import box_mesh, rectangle_mesh

number = st.floats(-1.0, 1.0)
FEW = settings(max_examples=12, deadline=None, derandomize=True)


def random_mesh(dim):
    return shaken(rectangle_mesh((4, 4)) if dim == 2 else box_mesh((3, 3, 3)), dim)


@FEW
@given(
    dim=st.sampled_from([2, 3]),
    direction=st.tuples(number, number, number),
    other=st.tuples(number, number, number),
    offset=st.floats(-0.3, 0.3),
    threshold=st.sampled_from([0.1, 0.3, 0.5]),
    move=st.sampled_from(["partly", "wholly"]),
)
def test_snapping_to_any_two_planes_never_inverts_a_cell_and_never_changes_the_body(
    dim, direction, other, offset, threshold, move
):
    mesh = random_mesh(dim)
    normals = [np.array(n)[:dim] + 1e-3 for n in (direction, other)]
    cuts = [Plane(np.full(dim, 0.5 + k * offset), n) for k, n in enumerate(normals)]
    snapped = snap_nodes(mesh, cuts, threshold, 0.2, move)

    def signed(points):
        corners = points[mesh.cells]
        return np.linalg.det(corners[:, 1:] - corners[:, :1])

    ratio = signed(snapped.mesh.points) / signed(mesh.points)
    assert ratio.min() >= 0.2 * (1 - 1e-9)
    assert snapped.mesh.measures.sum() == pytest.approx(1.0, rel=1e-12)
    outside = np.maximum(-snapped.mesh.points, snapped.mesh.points - 1.0).max()
    assert outside < 1e-14


@FEW
@given(dim=st.sampled_from([2, 3]), direction=st.tuples(number, number, number))
def test_snapping_leaves_no_cell_split_and_both_sides_apart(dim, direction):
    mesh = random_mesh(dim)
    body = cut_by("snapping", mesh, [Plane(np.full(dim, 0.52), np.array(direction)[:dim] + 1e-3)])
    assert body.counts.elements == body.counts.elements_before
    assert not body.phantom.split.any()
    assert (body.phantom.fraction == 1.0).all()
    assert body.phantom.bodies.max() == 1


def test_nodes_on_the_boundary_slide_along_it_and_corners_stay():
    mesh = rectangle_mesh((8, 8))
    cuts = [Polyline([[-1.0, 0.1], [2.0, 0.67]]), Polyline([[0.11, -1.0], [0.71, 2.0]])]
    snapped = snap_nodes(mesh, cuts)
    moved = np.linalg.norm(snapped.mesh.points - mesh.points, axis=1)
    corners = [0, 8, 72, 80]
    assert (moved[corners] == 0.0).all()
    for axis in (0, 1):
        for side in (0.0, 1.0):
            on_side = mesh.points[:, axis] == side
            assert (snapped.mesh.points[on_side, axis] == side).all()
            assert moved[on_side].max() > 0.0


def test_a_node_that_is_reported_as_moved_lies_on_the_cut():
    circle = ImplicitCut(lambda p: 0.31 - np.linalg.norm(p - 0.5, axis=1))
    mesh = rectangle_mesh((9, 9))
    snapped = take_near_nodes(snap_nodes(mesh, [circle]), 0.5)
    moved = np.linalg.norm(snapped.mesh.points - mesh.points, axis=1) > 0
    on = snapped.cuts[0].values == 0.0
    off = np.abs(circle.level_set(snapped.mesh.points[on]))
    count = {change.kind: change for change in snapped.changes}
    assert moved.sum() == count["node moved onto the cut"].count
    taken = count["node off the cut taken as on it"]
    assert (off > 1e-9).sum() == taken.count
    assert off.max() == pytest.approx(taken.size)
    assert taken.count < 0.2 * on.sum()
