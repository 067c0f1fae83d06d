"""Ends of cuts beside other cuts, in any order: the sub-division is conforming, nothing hangs."""

from itertools import permutations
from math import factorial

import numpy as np
import pytest
from cut_bodies import shaken

from verify.xfem.cuts import PolygonPatch
from verify.xfem.mesh import box_mesh
from verify.xfem.phantom import cut_mesh
from verify.xfem.subdivision import subdivide


def facet_measures(corners):
    edges = corners[:, 1:] - corners[:, :1]
    gram = edges @ edges.transpose(0, 2, 1)
    size = np.sqrt(np.maximum(np.linalg.det(gram), 0.0))
    return size / (1.0 if corners.shape[1] == 2 else 2.0)


def exterior(divided):
    """Measure of all facets that belong to one cell only."""
    cells = divided.cells
    corners = cells.shape[1]
    keep = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    facets = np.sort(cells[:, keep].reshape(-1, corners - 1), axis=1)
    distinct, count = np.unique(facets, axis=0, return_counts=True)
    assert count.max() <= 2
    return facet_measures(divided.points[distinct[count == 1]]).sum()


def assert_conforming(mesh, cuts):
    """The body is filled; outside are its boundary and both faces of the cut, no other facet."""
    divided = subdivide(cut_mesh(mesh, cuts))
    corners = divided.points[divided.cells]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / factorial(mesh.dim)
    assert (volumes > 0.0).all()
    assert volumes.sum() == pytest.approx(1.0, rel=1e-13)
    torn = facet_measures(divided.cut_facets).sum()
    assert torn > 0.0
    assert exterior(divided) == pytest.approx(2.0 * mesh.dim + 2.0 * torn, abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_a_front_beside_other_cuts_leaves_no_hanging_nodes_in_space(seed):
    random = np.random.default_rng(seed)
    mesh = shaken(box_mesh((3, 3, 3)), seed)

    def patch(centre, reach):
        frame = np.linalg.qr(random.normal(size=(3, 3)))[0]
        corners = np.array([[-2.0, -2.0], [reach, -2.0], [reach, 2.0], [-2.0, 2.0]])
        return PolygonPatch(centre + corners @ frame[:2])

    slit = patch(random.uniform(0.4, 0.6, 3), 0.0)
    others = [patch(random.uniform(0.4, 0.6, 3), reach) for reach in (2.0, 0.1)]
    for cuts in permutations([slit, *others]):
        assert_conforming(mesh, cuts)
