"""What is set up at every cut equals what plain numpy makes of it."""

import numpy as np
import pytest

from verify.xfem.block_pattern import block_pattern
from verify.xfem.dynamics.real_time import _held_entries
from verify.xfem.sweep_order_kernels import fill_lanes, number_upper_blocks, order_pieces

LANES = 8
FIRST, SECOND = (0, 0, 0, 1, 1, 2), (1, 2, 3, 2, 3, 3)


@pytest.fixture(params=range(3))
def body(request):
    """Pieces with random corners, every node used; no geometry is needed."""
    rng = np.random.default_rng(request.param)
    nodes = 30 + 20 * request.param
    rows = [rng.permutation(nodes)[:4] for _ in range(5 * nodes)]
    rows += [[k, (k + 1) % nodes, (k + 2) % nodes, (k + 3) % nodes] for k in range(nodes)]
    cells = np.unique(np.array(rows), axis=0)
    cells = rng.permuted(cells[rng.permutation(len(cells))], axis=1)
    return rng, cells, nodes


def test_pieces_are_ordered_as_a_lexical_sort_of_sorted_rows_does(body) -> None:
    _, cells, nodes = body
    pieces, corner, ordered = order_pieces(cells, nodes)
    by_corner = np.argsort(cells, axis=1)
    rows = np.take_along_axis(cells, by_corner, axis=1)
    place = np.lexsort(rows.T[::-1])
    np.testing.assert_array_equal(rows[place], ordered)
    np.testing.assert_array_equal(np.take_along_axis(cells[pieces], corner, axis=1), ordered)
    np.testing.assert_array_equal(np.sort(pieces), np.arange(len(cells)))


def test_transposed_and_diagonal_blocks_are_where_a_sort_finds_them(body) -> None:
    _, cells, nodes = body
    pattern = block_pattern(cells, nodes)
    rows = np.repeat(np.arange(nodes), np.diff(pattern.starts))
    np.testing.assert_array_equal(pattern.mirror, np.lexsort((rows, pattern.columns)))
    np.testing.assert_array_equal(pattern.diagonal, np.flatnonzero(rows == pattern.columns))


def test_blocks_above_the_diagonal_are_numbered_as_pieces_meet_them(body) -> None:
    _, cells, nodes = body
    pattern = block_pattern(cells, nodes)
    pieces, corner, _ = order_pieces(cells, nodes)
    ranks, source, met = number_upper_blocks(pieces, corner, pattern.targets, pattern.mirror)
    each = np.arange(len(pieces))[:, None]
    targets = pattern.targets[pieces][each, corner[:, FIRST], corner[:, SECOND]]
    blocks, first, index = np.unique(targets, return_index=True, return_inverse=True)
    number = np.empty(len(blocks), dtype=int)
    number[np.argsort(first)] = np.arange(len(blocks))
    np.testing.assert_array_equal(ranks, number[index].reshape(targets.shape))
    expected = np.full(len(pattern.columns), len(blocks))
    expected[blocks] = expected[pattern.mirror[blocks]] = number
    np.testing.assert_array_equal(source, expected)
    assert met == len(blocks)


def test_lanes_hold_gradients_and_moduli_of_their_pieces(body) -> None:
    rng, cells, nodes = body
    pieces, corner, _ = order_pieces(cells, nodes)
    count, parents = len(cells), 40
    parent = rng.integers(0, parents, count)
    gradients, volumes = rng.random((parents, 4, 3)), rng.random(count)
    lam, mu = rng.random((2, parents))
    batches = -(-count // LANES)
    slopes, moduli = np.zeros((batches, 9 * LANES)), np.zeros((batches, 2 * LANES))
    fill_lanes(pieces, corner, parent, gradients, volumes, lam, mu, LANES, slopes, moduli)
    of_piece = slopes.reshape(batches, 9, LANES).transpose(0, 2, 1).reshape(-1, 9)
    cell = parent[pieces]
    wanted = np.take_along_axis(gradients[cell], corner[:, :, None], axis=1)[:, 1:].reshape(-1, 9)
    np.testing.assert_array_equal(of_piece[:count], wanted)
    assert not of_piece[count:].any()
    both = moduli.reshape(batches, 2, LANES).transpose(0, 2, 1).reshape(-1, 2)[:count]
    weighed = volumes[pieces, None] * np.stack([lam[cell], mu[cell]], axis=1)
    np.testing.assert_array_equal(both, weighed)


def test_entries_beside_fixed_components_are_those_of_a_mask(body) -> None:
    rng, cells, nodes = body
    pattern, fixed = block_pattern(cells, nodes), rng.random((nodes, 3)) < 0.2
    rows = np.repeat(np.arange(nodes), np.diff(pattern.starts))
    held = fixed[rows][:, :, None] | fixed[pattern.columns][:, None, :]
    held[pattern.diagonal[:, None], np.arange(3), np.arange(3)] = False
    found = _held_entries(pattern.starts, pattern.columns, pattern.diagonal, fixed)
    np.testing.assert_array_equal(found, np.flatnonzero(held))
