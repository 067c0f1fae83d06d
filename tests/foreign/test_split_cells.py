"""Cells divided along a linear level set: no volume is lost, no side is wrong."""

import sys
from math import factorial

import numpy as np
import pytest

from verify.foreign.installing import PROGRAMS


@pytest.fixture
def split_cells(monkeypatch):
    monkeypatch.syspath_prepend(str(PROGRAMS))
    import split_cells

    yield split_cells
    sys.modules.pop("split_cells")


@pytest.mark.parametrize("d", [1, 2, 3])
@pytest.mark.parametrize("zeros", [0, 1])
def test_the_parts_fill_the_cell_each_on_its_own_side(d, zeros, split_cells):
    rng = np.random.default_rng(d)
    for _ in range(50):
        points, phi = rng.standard_normal((d + 1, d)), rng.standard_normal(d + 1)
        phi[:zeros] = 0.0
        if phi.min() >= 0 or phi.max() <= 0:
            continue
        cell = rng.permutation(d + 1)[None]
        ends, _, side = split_cells.split_cells(cell, phi)
        corners = split_cells.place(ends, points, phi)
        volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / factorial(d)
        whole = abs(np.linalg.det(points[1:] - points[0])) / factorial(d)
        assert volumes.sum() == pytest.approx(whole, rel=1e-12)
        gradient = np.linalg.solve(points[1:] - points[0], phi[1:] - phi[0])
        level = phi[0] + (corners.mean(axis=1) - points[0]) @ gradient
        assert np.array_equal(level > 0, side == 1)


def test_faces_that_two_cells_share_are_divided_alike(split_cells):
    rng = np.random.default_rng(5)
    for _ in range(50):
        phi = rng.standard_normal(5)
        cells = np.array([[0, 1, 2, 3], [4, 2, 1, 3]])
        mixed = [k for k in (0, 1) if phi[cells[k]].min() < 0 < phi[cells[k]].max()]
        if len(mixed) < 2:
            continue
        ends, number, side = split_cells.split_cells(cells, phi)
        found = []
        for k in (0, 1):
            within = np.isin(ends, [1, 2, 3]).all(axis=2)
            faces = set()
            for row in np.flatnonzero((number == k) & (within.sum(axis=1) == 3)):
                corners = frozenset(map(tuple, ends[row][within[row]]))
                faces.add((corners, int(side[row])))
            found.append({f for f in faces if len({c for e in f[0] for c in e}) == 3})
        assert found[0] == found[1]
