"""Cuts through nodes and along diagonals of a regular mesh: bodies, and modes without energy.

`test_topologies` has all kinds of cuts in general position.
"""

import numpy as np
import pytest
from xfem_bodies import zero_modes

from verify.xfem.cuts import Plane, Polyline
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

SQUARE = rectangle_mesh((4, 4))
CUBE = box_mesh((2, 2, 2))


def line(x0, y0, x1, y1):
    return Polyline([[x0, y0], [x1, y1]])


PLANAR = {
    "none": ([], 1),
    "crossing in a node": ([line(-1.0, 0.5, 2.0, 0.5), line(0.5, -1.0, 0.5, 2.0)], 4),
    "crossing obliquely in a node": ([line(0.0, 0.0, 1.0, 1.0), line(0.1, 0.7, 0.9, 0.3)], 2),
    "branch from a node": ([line(-1.0, 0.5, 2.0, 0.5), line(0.5, 0.5, 0.6, 2.0)], 3),
    "the same cut in both directions": (
        [line(-1.0, 0.52, 2.0, 0.52), line(2.0, 0.52, -1.0, 0.52)],
        2,
    ),
}
SPATIAL = {
    "three through nodes": ([Plane([0.5, 0.5, 0.5], n) for n in np.eye(3)], 8),
    "along diagonals": ([Plane([0.0, 0.0, 0.0], [1.0, -1.0, 0.0])], 2),
}


@pytest.mark.parametrize("name", [*PLANAR, *SPATIAL])
def test_every_free_piece_has_its_rigid_motions_as_modes_without_energy_and_no_other(name):
    cuts, pieces = PLANAR.get(name) or SPATIAL[name]
    phantom = cut_mesh(SQUARE if name in PLANAR else CUBE, cuts)
    assert phantom.bodies.max() + 1 == pieces
    modes, next_value = zero_modes(phantom)
    assert modes == (3 if name in PLANAR else 6) * pieces
    assert next_value > 1e-6  # nothing between a zero mode and an elastic one
