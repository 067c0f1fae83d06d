"""Cuts that end in one point inside an element part the body together, as none does alone."""

from itertools import permutations

import numpy as np
import pytest
from test_sliver_policies import shaken
from xfem_bodies import zero_modes

from verify.xfem.cuts import PolygonPatch, Polyline
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.subdivision import subdivide
from verify.xfem.virtual import cut_mesh


def sectors(rng, count, least=0.35):
    """Ascending angles of rays, no two nearer than `least`."""
    while True:
        angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, count))
        if np.diff(angles, append=angles[0] + 2.0 * np.pi).min() > least:
            return angles


def fork(point, angles, reach=2.0):
    """Cuts that leave a point, those at even places coming towards it."""
    ends = point + reach * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    lines = [[point, end] if k % 2 else [end, point] for k, end in enumerate(ends)]
    return [Polyline(line) for line in lines]


def areas(virtual):
    return np.sort(np.bincount(virtual.bodies[virtual.cells[:, 0]], virtual.volumes))


def sector_areas(point, angles):
    """Areas of the sectors of the unit square: by the border, walked in small steps."""
    way = np.linspace(0.0, 1.0, 4001)[:-1]
    border = np.concatenate(
        [np.stack(x, 1) for x in ((way, 0 * way), (1 + 0 * way, way), (1 - way, 1 + 0 * way))]
        + [np.stack((0 * way, 1 - way), 1)]
    )
    spokes, following = border - point, np.roll(border, -1, axis=0) - point
    area = 0.5 * (spokes[:, 0] * following[:, 1] - spokes[:, 1] * following[:, 0])
    middle = 0.5 * (spokes + following)
    turn = np.arctan2(middle[:, 1], middle[:, 0]) % (2.0 * np.pi)
    return np.sort(np.bincount(np.searchsorted(angles, turn) % len(angles), area))


@pytest.mark.parametrize("count", [2, 3, 4, 5])
@pytest.mark.parametrize("seed", range(6))
def test_cuts_that_end_in_one_point_of_an_element_leave_a_part_for_each_sector(count, seed):
    """Rigid modes are those of as many parts, each with the area of its sector."""
    rng = np.random.default_rng([count, seed])
    mesh = shaken(rectangle_mesh((3, 3)), seed)
    point, angles = rng.uniform(0.3, 0.7, 2), sectors(rng, count)
    cuts = fork(point, angles)
    for order in list(permutations(range(count)))[:: max(1, count - 2)][:6]:
        virtual = cut_mesh(mesh, [cuts[k] for k in order])
        assert virtual.bodies.max() + 1 == count
        modes, following = zero_modes(virtual)
        assert modes == 3 * count
        assert following > 1e-9
        # straight cuts are realised exactly; the border is sampled in steps of 1/4000
        np.testing.assert_allclose(areas(virtual), sector_areas(point, angles), atol=5e-4)
