"""Cost of a growing incision for each method."""

import numpy as np
import pytest

from verify.methods.counting import count_incisions, growing_incisions
from verify.xfem.cuts import Polyline
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import rectangle_mesh


def spiral(turns, vertices=300):
    angle = np.linspace(0, 2 * np.pi * turns, vertices)
    radius = np.linspace(0.06, 0.46, vertices)
    return Polyline(0.5 + radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def jittered(n):
    mesh = rectangle_mesh((n, n), diagonal="alternating")
    points = mesh.points.copy()
    inner = (np.abs(points - 0.5) < 0.5 - 1e-9).all(axis=1)
    points[inner] += np.random.default_rng(1).uniform(-0.2, 0.2, (inner.sum(), 2)) / n
    return SimplexMesh(points, mesh.cells)


MESHES = {"structured": rectangle_mesh((30, 30)), "irregular": jittered(30)}


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_a_cut_through_n_triangles_enriches_n_plus_2_nodes_less_2_for_each_end_inside(mesh):
    through = [Polyline([[-0.1, 0.313], [1.1, 0.552]])]
    (row,) = count_incisions(mesh, [through], ["xfem", "virtual_node"])
    assert row.nodes["xfem"] == row.cut_cells + 2
    assert row.nodes["virtual_node"] == row.cut_cells + 2
    mouth = [Polyline([[-0.1, 0.313], [0.6, 0.552]])]
    (row,) = count_incisions(mesh, [mouth], ["xfem"])
    assert row.nodes["xfem"] == row.cut_cells
    incisions = growing_incisions(mesh, spiral(3), [10, 50, 200])
    rows = count_incisions(mesh, [[cut] for cut in incisions], ["xfem"])
    # a curve may pass a corner of a cell between two crossings of one edge
    assert np.abs(np.array([row.cut_cells for row in rows]) - [10, 50, 200]).max() <= 1
    assert [row.nodes["xfem"] for row in rows] == [row.cut_cells - 2 for row in rows]


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_subdivision_adds_twice_as_many_nodes_as_xfem(mesh):
    n = np.array([10, 50, 200])
    incisions = growing_incisions(mesh, spiral(3), n)
    rows = count_incisions(mesh, [[cut] for cut in incisions], ["subdivision"])
    added = np.array([row.nodes["subdivision"] for row in rows])
    # two on each of n + 1 edges inside and one for each end; an end in the cell beyond the next
    # edge divides that too
    assert (np.abs(added - 2 * (n + 1)) <= 6).all()
    assert added[-1] / (n[-1] - 2) == pytest.approx(2.0, rel=0.06)


@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
def test_snapping_before_subdivision_saves_at_each_end_of_an_edge_its_threshold(mesh):
    (incision,) = growing_incisions(mesh, spiral(3), [200])
    counted = count_incisions(mesh, [[incision]], ["snapping_subdivision", "subdivision"])[0]
    # crossings are spread evenly over the edges: two fifths lie in their outer fifths, and
    # several of these share a node
    share = counted.nodes["snapping_subdivision"] / counted.nodes["subdivision"]
    assert 0.45 < share < 0.75


def test_an_incision_grows_along_its_path():
    path = spiral(3)
    first, second = growing_incisions(MESHES["structured"], path, [10, 40])
    assert np.array_equal(first.vertices[:-1], path.vertices[: len(first.vertices) - 1])
    assert np.array_equal(first.vertices[:-1], second.vertices[: len(first.vertices) - 1])


@pytest.mark.parametrize(
    "path, counts, said",
    [
        (Polyline([[0.2, 0.2], [0.8, 0.8], [0.2, 0.8]], closed=True), [3], "open path"),
        (Polyline([[0.2, 0.21], [0.8, 0.33]]), [500], "500 cut cells; the path cuts"),
        (Polyline([[0.2, 0.21], [0.8, 0.33]]), [0], "incisions of 0"),
    ],
)
def test_what_cannot_grow_is_said(path, counts, said):
    with pytest.raises(XfemError, match=said):
        growing_incisions(MESHES["structured"], path, counts)
