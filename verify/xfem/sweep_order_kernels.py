"""The order in which a sweep takes tetrahedra, and where it puts their blocks: no sorting of rows.

Pieces are few around a node, so they are sorted into places by their first node and then by
insertion; this is done anew at every cut.
"""

import numpy as np
from numba import njit

__all__ = ["fill_lanes", "number_upper_blocks", "order_pieces"]


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
def fill_lanes(pieces, corner, parent, gradients, volumes, lam, mu, lanes, slopes, moduli):
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
    slopes : (batches, 9 · lanes) float array
        Overwritten; what is beyond the last piece stays.
    moduli : (batches, 2 · lanes) float array
        Likewise.
    """
    for place in range(len(pieces)):
        p = pieces[place]
        cell, batch, lane = parent[p], place // lanes, place % lanes
        for k in range(1, 4):
            for i in range(3):
                entry = 3 * (k - 1) + i
                slopes[batch, entry * lanes + lane] = gradients[cell, corner[place, k], i]
        moduli[batch, lane] = volumes[p] * lam[cell]
        moduli[batch, lanes + lane] = volumes[p] * mu[cell]


@njit(cache=True)
def number_upper_blocks(pieces, corner, targets, mirror):
    """Give numbers to the blocks above the diagonal in the order in which pieces meet them.

    Parameters
    ----------
    pieces, corner : (p,), (p, 4) int arrays
        As from `order_pieces`.
    targets : (p, 4, 4) int array
        Block of each pair of corners.
    mirror : (B,) int array
        Place of the transposed of each block.

    Returns
    -------
    ranks : (p, 6) int32 array
        Numbers of the blocks of the pairs (0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3).
    source : (B,) int32 array
        Number of each block or of its transposed; of the diagonal how many there are.
    met : int
        How many there are.
    """
    rank = np.full(len(mirror), -1, dtype=np.int32)
    ranks = np.empty((len(pieces), 6), dtype=np.int32)
    met = 0
    for place in range(len(pieces)):
        pair = 0
        for a in range(3):
            for b in range(a + 1, 4):
                block = targets[pieces[place], corner[place, a], corner[place, b]]
                if rank[block] < 0:
                    rank[block] = rank[mirror[block]] = met
                    met += 1
                ranks[place, pair] = rank[block]
                pair += 1
    for block in range(len(rank)):
        if rank[block] < 0:
            rank[block] = met
    return ranks, rank, met
