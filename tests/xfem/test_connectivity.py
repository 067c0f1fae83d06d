"""Pieces are joined by contact, not by sign vectors: bodies, zero-energy modes, tips."""

import numpy as np
import pytest
from xfem_bodies import zero_modes

from verify.xfem.cuts import Plane, PolygonPatch, Polyline
from verify.xfem.mesh import box_mesh, rectangle_mesh
from verify.xfem.phantom import cut_mesh

SQUARE = rectangle_mesh((4, 4))
CUBE = box_mesh((2, 2, 2))


def line(x0, y0, x1, y1):
    return Polyline([[x0, y0], [x1, y1]])


def patch(*corners):
    return PolygonPatch(corners)


STEM = line(-1.0, 0.52, 2.0, 0.52)
PLANAR = {
    "none": ([], 1),
    "two parallel in one row of elements": ([STEM, line(2.0, 0.6, -1.0, 0.6)], 3),
    "crossing inside an element": ([STEM, line(0.47, -1.0, 0.47, 2.0)], 4),
    "crossing in a node": ([line(-1.0, 0.5, 2.0, 0.5), line(0.5, -1.0, 0.5, 2.0)], 4),
    "crossing obliquely in a node": ([line(0.0, 0.0, 1.0, 1.0), line(0.1, 0.7, 0.9, 0.3)], 2),
    "branch before its stem": ([line(0.47, 0.52, 0.47, 2.0), STEM], 3),
    "branch from a node": ([line(-1.0, 0.5, 2.0, 0.5), line(0.5, 0.5, 0.6, 2.0)], 3),
    "crossing, then a branch": ([STEM, line(0.47, -1.0, 0.47, 2.0), line(0.47, 0.8, -1.0, 0.9)], 5),
    "three through one point": (
        [line(-1.0, 0.53, 2.0, 0.53), line(0.53, -1.0, 0.53, 2.0), line(-1.0, -1.0, 2.0, 2.0)],
        6,
    ),
    "the same cut in both directions": ([STEM, line(2.0, 0.52, -1.0, 0.52)], 2),
    "a hole": ([Polyline([[0.3, 0.3], [0.7, 0.35], [0.6, 0.72]], closed=True)], 2),
    "edge crack": ([line(-1.0, 0.52, 0.5, 0.52)], 1),
    "inner crack": ([line(0.25, 0.52, 0.75, 0.52)], 1),
    "kink": ([Polyline([[-1.0, 0.4], [0.5, 0.55], [2.0, 0.3]])], 2),
}


CENTRE = [0.5, 0.5, 0.5]
SPATIAL = {
    "one oblique": ([Plane(CENTRE, [-1.0, -2.0, 3.0])], 2),
    "two crossing": ([Plane(CENTRE, [1.0, 0.2, 0.3]), Plane([0.4, 0.5, 0.6], [0.1, 1.0, 0.3])], 4),
    "three through nodes": ([Plane(CENTRE, n) for n in np.eye(3)], 8),
    "two crossing and a branch": (
        [
            Plane([0.47, 0.5, 0.5], [1.0, 0.0, 0.0]),
            Plane([0.5, 0.53, 0.5], [0.0, 1.0, 0.0]),
            patch([0.47, -1.0, 0.4], [0.47, 0.53, 0.4], [-1.0, 0.53, 0.4], [-1.0, -1.0, 0.4]),
        ],
        5,
    ),
    "half-way": ([patch([-1, -1, 0.52], [0.5, -1, 0.52], [0.5, 2, 0.52], [-1, 2, 0.52])], 1),
    "along faces": ([Plane(CENTRE, [0.0, 0.0, 1.0])], 2),
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
