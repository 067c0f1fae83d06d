"""Virtual nodes: copies of cells, one for each part that has a node, or for each part."""

import numpy as np
import pytest
from method_bodies import hang

from verify.methods import cut_by
from verify.xfem.cuts import Plane, Polyline
from verify.xfem.mesh import SimplexMesh, box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

TRIANGLE = SimplexMesh([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
CROSS = [Plane([0.3, 0.3], [1.0, 0.1]), Plane([0.3, 0.3], [0.1, 1.0])]


def test_a_triangle_can_be_in_three_copies_but_not_in_four():
    # two lines that cross inside make four parts; the one without a node stays with a sibling
    assert cut_by("virtual_node_arbitrary", TRIANGLE, CROSS).counts.elements == 4
    body = cut_by("virtual_node", TRIANGLE, CROSS)
    assert body.counts.elements == 3
    merged = next(c for c in body.changes if c.kind.startswith("part without a node"))
    smallest = cut_mesh(TRIANGLE, CROSS)
    assert merged.count == 1
    assert merged.size in smallest.fraction
    assert body.phantom.volumes.sum() == pytest.approx(0.5, rel=1e-14)


def test_one_cut_makes_both_algorithms_the_same_as_xfem():
    mesh, cuts = box_mesh((3, 3, 3)), [Plane([0.5, 0.5, 0.47], [0.1, 0.2, 1.0])]

    def ends(points):
        return (points[:, 2] < 1e-9) | (points[:, 2] > 1 - 1e-9)

    energies = [
        hang(method, mesh, cuts, ends)[1].strain_energy
        for method in ("virtual_node", "virtual_node_arbitrary")
    ]
    assert energies[0] == energies[1]
    phantom = cut_mesh(mesh, cuts)
    body = cut_by("virtual_node", mesh, cuts)
    assert np.array_equal(body.phantom.cells, phantom.cells)
    assert np.array_equal(body.phantom.fraction, phantom.fraction)


def test_copies_that_resist_as_whole_cells_add_the_volume_of_the_cut_cells():
    mesh, cut = rectangle_mesh((6, 6)), Polyline([[-1.0, 0.31], [2.0, 0.55]])
    body = cut_by("virtual_node", mesh, [cut], weights="whole")
    touched = np.bincount(body.phantom.parent, minlength=len(mesh.cells)) > 1
    added = body.resisting.volumes.sum() - body.phantom.volumes.sum()
    assert added == pytest.approx(mesh.measures[touched].sum(), rel=1e-12)
    said = next(c for c in body.changes if "material added" in c.kind)
    assert said.size == pytest.approx(added, rel=1e-12)

    def ends(points):
        return (points[:, 1] < 1e-9) | (points[:, 1] > 1 - 1e-9)

    # more material resists, the load is the same: less energy
    whole = hang("virtual_node", mesh, [cut], ends, weights="whole")[1].strain_energy
    assert whole < hang("virtual_node", mesh, [cut], ends)[1].strain_energy


def test_raised_copies_weigh_a_thousandth_of_their_cell_at_least_and_the_body_stays():
    mesh, cut = rectangle_mesh((6, 6)), Polyline([[-1.0, 0.5 + 1e-7], [2.0, 0.5 + 1e-7]])
    body = cut_by("virtual_node_arbitrary", mesh, [cut], weights="raised")
    plain = cut_by("virtual_node_arbitrary", mesh, [cut])
    small = plain.phantom.fraction < 1e-3
    assert small.any()
    np.testing.assert_allclose(body.phantom.fraction[small], 1e-3, rtol=1e-12)
    assert np.array_equal(body.phantom.fraction[~small], plain.phantom.fraction[~small])
    assert body.resisting is body.phantom
    corners = body.conforming.points[body.conforming.cells]
    areas = 0.5 * np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert areas.sum() == pytest.approx(1.0, rel=1e-12)
    # a sliver that weighs more lies where it lay
    np.testing.assert_allclose(
        body.phantom.piece_centroids, plain.phantom.piece_centroids, atol=1e-12
    )
