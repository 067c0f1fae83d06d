"""Sides of the unknowns and pieces of a body that several planes cut, in any order of these."""

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.supports import Supports


def _coarse_mesh(dim, rng):
    """Few unstructured simplices, so that several planes go through each."""
    corners = np.stack(np.meshgrid(*[[0.0, 1.0]] * dim, indexing="ij"), axis=-1).reshape(-1, dim)
    points = np.vstack([corners, rng.random((6, dim))])
    return SimplexMesh(points, Delaunay(points).simplices.astype(np.int64))


def _signs(planes, points):
    return np.stack([np.sign((points - p.point) @ p.normal) for p in planes], axis=1)


def _random_planes(dim, rng):
    count = rng.integers(2, 5)
    normals = rng.standard_normal((count, dim))
    if rng.random() < 0.5:  # layers: each is split off what the one before it has left
        normals[:] = normals[0] + 0.05 * rng.standard_normal((count, dim))
    return [Plane(0.2 + 0.6 * rng.random(dim), n / np.linalg.norm(n)) for n in normals]


@pytest.mark.parametrize(("dim", "bodies"), [(2, 60), (3, 25)])
def test_every_unknown_lies_on_the_sides_of_its_pieces_in_any_order_of_the_cuts(dim, bodies):
    rng = np.random.default_rng(dim)
    places = 0
    for _ in range(bodies):
        mesh, planes = _coarse_mesh(dim, rng), _random_planes(dim, rng)
        orders = list(permutations(range(len(planes))))
        for order in [orders[k] for k in rng.choice(len(orders), 2, replace=False)]:
            cuts = [planes[k] for k in order]
            phantom = cut_mesh(mesh, cuts)
            # planes end nowhere, so that no piece lies on both sides of one
            truth = _signs(cuts, phantom.piece_centroids)
            np.testing.assert_array_equal(phantom.piece_side, truth)
            corners = phantom.cells.shape[1]
            np.testing.assert_array_equal(
                phantom.node_side[phantom.cells], np.repeat(truth[:, None], corners, axis=1)
            )
            places += truth.size * corners
    assert places >= 10_000


def test_parts_between_planes_that_move_rigidly_are_held_where_they_are():
    mesh = rectangle_mesh((3, 3))
    planes = [Plane([0.40, 0.0], [1.0, 0.2]), Plane([0.55, 0.0], [1.0, 0.1])]
    for order in ((0, 1), (1, 0)):
        phantom = cut_mesh(mesh, [planes[k] for k in order])
        supports = Supports.none(phantom).prescribe(
            phantom,
            np.arange(len(mesh.points)),
            lambda x, side: np.column_stack([0.1 * side.sum(axis=1), 0.0 * x[:, 0]]),
        )
        solved = solve_static(phantom, isotropic(1.0, 0.3, "plane strain"), supports)
        assert solved.strain_energy < 1e-28
