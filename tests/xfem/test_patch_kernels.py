"""Kernels that prepare what a cut touches, against the same said in numpy."""

import numpy as np

from verify.simulator.cutting.renumber_kernels import simplices_of
from verify.simulator.mapping.near_facet_kernels import concerned_facets, levels_at
from verify.xfem.structured_meshes import box_mesh


def test_simplices_of_cells_are_those_with_a_volume_in_their_order() -> None:
    rng = np.random.default_rng(2)
    whole, parent = np.sort(rng.choice(90, 20, replace=False)), rng.integers(0, 20, 30)
    piece, fraction = rng.integers(0, 30, 70), rng.random(70) * rng.integers(0, 2, 70)
    cells = np.sort(np.concatenate([whole[rng.choice(20, 8, replace=False)], [95]]))
    place = np.where(rng.random(30) < 0.2, -1, np.arange(30))  # -1: a piece that is left out
    rows, bounds = simplices_of(cells, whole, parent, piece, place, fraction)
    cell = whole[parent[piece]]
    assert (fraction == 0.0).any()
    assert (place[piece] < 0).any()
    for wanted, (begin, end) in zip(cells, bounds, strict=True):
        expected = np.flatnonzero((cell == wanted) & (fraction > 0.0) & (place[piece] >= 0))
        np.testing.assert_array_equal(rows[begin:end], expected)
    assert len(rows) == bounds[-1, 1]


def test_facets_are_concerned_that_a_cut_meets_or_whose_cells_have_moved() -> None:
    mesh, rng = box_mesh((3, 3, 2)), np.random.default_rng(3)
    nodal = mesh.points[:, :2] - (0.45, 0.55)
    facets = np.arange(240).reshape(80, 3)
    cell = rng.integers(0, len(mesh.cells), 80)  # in which the three corners of each lie
    vertex_cell, vertex_at = np.repeat(cell, 3), rng.dirichlet(np.ones(4), 240)
    corner_cell = np.repeat(cell[:, None], 3, axis=1)
    near = np.sort(rng.choice(80, 50, replace=False))
    nodes = np.unique(facets[near])
    found = [
        levels_at(nodes, vertex_cell, vertex_at, mesh.cells, nodal[:, k].copy(), 0.02)
        for k in range(2)
    ]
    values = np.stack([column for column, _ in found], axis=1)
    exact = np.einsum("qa,qak->qk", vertex_at[nodes], nodal[mesh.cells[vertex_cell[nodes]]])
    exact[np.abs(exact) <= 0.02] = 0.0
    np.testing.assert_allclose(values, exact, atol=1e-15)
    assert all(crossed for _, crossed in found)
    _, one_side = levels_at(nodes, vertex_cell, vertex_at, mesh.cells, nodal[:, 0] + 9.0, 0.02)
    assert not one_side
    moved = rng.choice(len(mesh.cells), 4, replace=False)
    is_moved, place = np.zeros(len(mesh.cells), dtype=bool), np.full(240, -1)
    chosen = concerned_facets(near, facets, nodes, values, moved, corner_cell, is_moved, place)
    levels = values[np.searchsorted(nodes, facets[near])]
    whole = ((levels > 0.0).all(axis=1) | (levels < 0.0).all(axis=1)).all(axis=1)
    expected = near[~whole | np.isin(corner_cell[near], moved).any(axis=1)]
    np.testing.assert_array_equal(chosen, expected)
    assert 0 < len(chosen) < len(near)
    # what is lent is given back as it was
    assert not is_moved.any()
    assert (place == -1).all()
