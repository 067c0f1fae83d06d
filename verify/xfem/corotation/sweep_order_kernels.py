"""The order in which a sweep takes tetrahedra, and where it puts their blocks: no sorting of rows.

Pieces are few around a node, so they are sorted into places by their first node and then by
insertion; this is done anew at every cut.
"""

import numpy as np
from numba import njit

__all__ = ["assign_slots", "fill_lanes", "order_pieces"]


@njit(cache=True)
def order_pieces(cells, node_count):
    """Sort the corners of each piece by node, and pieces by these rows of nodes.

    Parameters
    ----------
    cells : (p, 4) int array
        Unknown nodes of each piece.
    node_count : int

    Returns
    -------
    pieces : (p,) int array
        Piece at each place.
    corner : (p, 4) int array
        Its corners, by ascending node.
    nodes : (p, 4) int32 array
    """
    count, corners = cells.shape
    order = np.empty((count, corners), dtype=np.int64)
    start = np.zeros(node_count + 1, dtype=np.int64)
    for p in range(count):
        for k in range(corners):
            at = k
            while at > 0 and cells[p, order[p, at - 1]] > cells[p, k]:
                order[p, at] = order[p, at - 1]
                at -= 1
            order[p, at] = k
        start[cells[p, order[p, 0]] + 1] += 1
    for node in range(node_count):
        start[node + 1] += start[node]
    pieces = np.empty(count, dtype=np.int64)
    end = start[:-1].copy()
    for p in range(count):
        first = cells[p, order[p, 0]]
        at = end[first]
        while at > start[first] and _is_before(p, pieces[at - 1], cells, order):
            pieces[at] = pieces[at - 1]
            at -= 1
        pieces[at] = p
        end[first] += 1
    corner = np.empty((count, corners), dtype=np.int64)
    nodes = np.empty((count, corners), dtype=np.int32)
    for place in range(count):
        p = pieces[place]
        for k in range(corners):
            corner[place, k] = order[p, k]
            nodes[place, k] = cells[p, order[p, k]]
    return pieces, corner, nodes


@njit(cache=True)
def _is_before(p, q, cells, order):
    for k in range(1, cells.shape[1]):
        mine, other = cells[p, order[p, k]], cells[q, order[q, k]]
        if mine != other:
            return mine < other
    return False


@njit(cache=True)
def fill_lanes(pieces, corner, parent, gradients, volumes, lam, mu, lanes, constants):
    """Write gradients of three corners, and Lamé parameters times volume, lane by lane.

    Parameters
    ----------
    pieces, corner : (p,), (p, 4) int arrays
        As from `order_pieces`.
    parent : (p,) int array
        Cell of each piece.
    gradients : (m, 4, 3) float array
    volumes : (p,) float array
    lam, mu : (m,) float array
    lanes : int
    constants : (batches, 11 · lanes) float array
        Overwritten; what is beyond the last piece stays.
    """
    for place in range(len(pieces)):
        p = pieces[place]
        cell, batch, lane = parent[p], place // lanes, place % lanes
        for k in range(1, 4):
            for i in range(3):
                entry = 3 * (k - 1) + i
                constants[batch, entry * lanes + lane] = gradients[cell, corner[place, k], i]
        constants[batch, 9 * lanes + lane] = volumes[p] * lam[cell]
        constants[batch, 10 * lanes + lane] = volumes[p] * mu[cell]


@njit(cache=True)
def assign_slots(pieces, corner, nodes, targets, starts, diagonal, window):
    """Give each block above the diagonal a slot from its first piece until its row is finished.

    Rows are finished when the window is done that has the last piece that begins with their node;
    their slots are then free again, so that there are as many as a front of the mesh has blocks.
    The first slot stays empty: it is that of blocks to which no piece adds.

    Parameters
    ----------
    pieces, corner, nodes : (p,), (p, 4), (p, 4) int arrays
        As from `order_pieces`, or in another order within each window.
    targets : (p, 4, 4) int array
        Block of each pair of corners.
    starts, diagonal : int arrays
        Pattern.
    window : int
        Pieces in a window.

    Returns
    -------
    slots : (p, 6) uint32 array
        Of the blocks of the pairs (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3).
    slot_of : (B,) uint32 array
        Of the blocks above the diagonal.
    ends : (N,) int array
        Pieces that begin with the node of the row or one before.
    count : int
        How many slots there are.
    """
    rows = len(diagonal)
    ends = np.zeros(rows, dtype=np.int64)
    for place in range(len(pieces)):
        ends[nodes[place, 0]] += 1
    for row in range(1, rows):
        ends[row] += ends[row - 1]
    slots = np.empty((len(pieces), 6), dtype=np.uint32)
    slot_of = np.zeros(starts[rows], dtype=np.uint32)
    free, waiting, count, row = np.empty(starts[rows], dtype=np.uint32), 0, 1, 0
    for place in range(len(pieces)):
        pair = 0
        for a in range(3):
            for b in range(a + 1, 4):
                block = targets[pieces[place], corner[place, a], corner[place, b]]
                if slot_of[block] == 0:
                    if waiting > 0:
                        waiting -= 1
                        slot_of[block] = free[waiting]
                    else:
                        slot_of[block] = count
                        count += 1
                slots[place, pair] = slot_of[block]
                pair += 1
        if (place + 1) % window == 0:
            while row < rows and ends[row] <= place + 1:
                for block in range(diagonal[row] + 1, starts[row + 1]):
                    if slot_of[block] != 0:
                        free[waiting] = slot_of[block]
                        waiting += 1
                row += 1
    return slots, slot_of, ends, count
