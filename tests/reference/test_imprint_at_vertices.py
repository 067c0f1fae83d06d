"""A cut imprinted on a mesh runs along one chain of facets, however close it passes to vertices."""

import numpy as np
import pytest

from reference.meshing.imprint import imprint, structured_triangles
from reference.meshing.opening import open_cut
from verify.geometry.simplices import connected_cells, measures


@pytest.mark.parametrize("off", [*np.geomspace(1e-13, 1e-6, 29), 0.0])
@pytest.mark.parametrize("slope", [1 / 3, -1.0, 0.0])
def test_two_halves_meet_along_the_whole_cut_and_nothing_is_set_free(slope, off):
    """The cut passes `off` elements above vertices of a mesh of eight by eight squares."""
    points, cells = structured_triangles((0.0, 0.0), (1.0, 1.0), (8, 8))
    ends = [(x, 0.375 + slope * (x - 0.125) + off / 8) for x in (-0.5, 1.5)]
    points, cells, facets = imprint(points, cells, [np.array(ends)])
    where = points[facets]
    assert len(facets)
    low, high = where.reshape(-1, 2).min(axis=0), where.reshape(-1, 2).max(axis=0)
    lengths = np.linalg.norm(where[:, 1] - where[:, 0], axis=1)
    assert lengths.sum() == pytest.approx(np.linalg.norm(high - low), abs=1e-9)
    mesh = open_cut(points, cells, facets)
    number = connected_cells(mesh.cells)
    areas = np.bincount(number, measures(mesh.points[mesh.cells]))
    assert len(areas) == 2
    assert areas.sum() == pytest.approx(1.0, abs=1e-12)
