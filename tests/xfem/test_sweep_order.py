"""Set-up at every cut equals what plain numpy makes of it."""

import numpy as np
import pytest
from numba import njit

from verify.xfem.block_pattern import block_pattern
from verify.xfem.corotation.sweep_order_kernels import assign_slots, fill_lanes, order_pieces
from verify.xfem.dynamics.real_time import _held_entries
from verify.xfem.lanes.shuffles import add_to_records, address, gather_records
from verify.xfem.lanes.vectors import LANES, load, mean, minus, no_lanes, store, transposed
from verify.xfem.structured_meshes import box_mesh

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


def test_a_slot_is_of_one_block_from_its_first_piece_until_its_row_is_finished(body) -> None:
    _, cells, nodes = body
    pattern = block_pattern(cells, nodes)
    pieces, corner, ordered = order_pieces(cells, nodes)
    slots, slot_of, ends, count = assign_slots(
        pieces, corner, ordered, pattern.targets, pattern.starts, pattern.diagonal, LANES
    )
    each = np.arange(len(pieces))[:, None]
    blocks = pattern.targets[pieces][each, corner[:, FIRST], corner[:, SECOND]]
    np.testing.assert_array_equal(slots, slot_of[blocks])
    np.testing.assert_array_equal(ends, (ordered[:, :1] <= np.arange(nodes)).sum(axis=0))
    rows = np.repeat(np.arange(nodes), np.diff(pattern.starts))
    assert not slot_of[pattern.columns <= rows].any()
    assert slots.min() == 1
    assert slots.max() == count - 1
    batch_of = {}
    for place, met in enumerate(blocks):
        for block in met:
            batch_of.setdefault(block, place // LANES)
    taken = {}  # slot: batch in which it is last used
    for block in sorted(batch_of, key=batch_of.get):
        assert batch_of[block] > taken.get(slot_of[block], -1)
        taken[slot_of[block]] = (ends[rows[block]] - 1) // LANES
    assert count <= len(batch_of) + 1


def test_slots_are_as_many_as_a_front_of_the_mesh_has_blocks() -> None:
    cells = box_mesh((30, 3, 3)).cells
    pattern = block_pattern(cells, cells.max() + 1)
    order = order_pieces(cells, cells.max() + 1)
    *_, count = assign_slots(*order, pattern.targets, pattern.starts, pattern.diagonal, LANES)
    assert count < 0.3 * (len(pattern.columns) - pattern.node_count) / 2


def test_numbers_of_records_become_rows_of_lanes_and_rows_are_added_to_records() -> None:
    """Also where several lanes have the same record."""
    rng = np.random.default_rng(5)
    records, rows = rng.random((20, LANES)), rng.random(3 + 5 * LANES)
    places = np.full((LANES, 3), 7, dtype=np.uint32)
    places[:, 1] = at = rng.integers(0, 4, LANES)
    wanted = records.copy()
    np.add.at(wanted[:, :5], at, rows[3:].reshape(5, LANES).T)
    after, found = records.copy(), rows.copy()
    _shuffle(after, places, found)
    np.testing.assert_allclose(after, wanted, rtol=1e-15)
    np.testing.assert_array_equal(after[:, 5:], records[:, 5:])
    np.testing.assert_array_equal(found[:3], rows[:3])
    np.testing.assert_array_equal(found[3:].reshape(5, LANES), after[at, :5].T)


@njit
def _shuffle(records, places, rows):
    add_to_records(address(records), address(places), 1, 3, address(rows), 3, 5)
    gather_records(address(records), address(places), 1, 3, address(rows), 3, 5)


def test_a_block_is_transposed_as_its_first_eight_entries() -> None:
    block, out = np.random.default_rng(6).random((3, 3)), np.full(4 * LANES, np.nan)
    _transpose(block, out)
    turned, difference, middle, nothing = out.reshape(4, LANES)
    np.testing.assert_array_equal(turned, block.T.ravel()[:LANES])
    np.testing.assert_array_equal(difference, (block - block.T).ravel()[:LANES])
    np.testing.assert_array_equal(middle, (0.5 * (block + block.T)).ravel()[:LANES])
    assert not nothing.any()


@njit
def _transpose(block, out):
    into, entries = address(out), load(address(block), 0)
    other = transposed(entries)
    store(into, 0, other)
    store(into, LANES, minus(entries, other))
    store(into, 2 * LANES, mean(entries, other))
    store(into, 3 * LANES, no_lanes())


def test_lanes_hold_gradients_and_moduli_of_their_pieces(body) -> None:
    rng, cells, nodes = body
    pieces, corner, _ = order_pieces(cells, nodes)
    count, parents = len(cells), 40
    parent = rng.integers(0, parents, count)
    gradients, volumes = rng.random((parents, 4, 3)), rng.random(count)
    lam, mu = rng.random((2, parents))
    batches = -(-count // LANES)
    constants = np.zeros((batches, 11 * LANES))
    fill_lanes(pieces, corner, parent, gradients, volumes, lam, mu, LANES, constants)
    of_piece = constants.reshape(batches, 11, LANES).transpose(0, 2, 1).reshape(-1, 11)
    cell = parent[pieces]
    wanted = np.take_along_axis(gradients[cell], corner[:, :, None], axis=1)[:, 1:].reshape(-1, 9)
    np.testing.assert_array_equal(of_piece[:count, :9], wanted)
    assert not of_piece[count:].any()
    weighed = volumes[pieces, None] * np.stack([lam[cell], mu[cell]], axis=1)
    np.testing.assert_array_equal(of_piece[:count, 9:], weighed)


def test_entries_beside_fixed_components_are_those_of_a_mask(body) -> None:
    rng, cells, nodes = body
    pattern, fixed = block_pattern(cells, nodes), rng.random((nodes, 3)) < 0.2
    rows = np.repeat(np.arange(nodes), np.diff(pattern.starts))
    held = fixed[rows][:, :, None] | fixed[pattern.columns][:, None, :]
    held[pattern.diagonal[:, None], np.arange(3), np.arange(3)] = False
    found = _held_entries(pattern.starts, pattern.columns, pattern.diagonal, fixed)
    np.testing.assert_array_equal(found, np.flatnonzero(held))
