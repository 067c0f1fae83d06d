"""Adding up the blocks of a symmetric matrix that is free of force in translation, row by row.

Pieces come by their first node, so a row is complete above the diagonal when the last piece that
begins with its node has been added. Its blocks, which until then waited in a few slots that stay
in the cache, are written to their place; those below the diagonal are read from the rows above
them, which were written not long ago, so that rows are written from one end to the other. What the
diagonal needs, as Σ_j K_ij = 0, is known when its row's turn comes.
"""

import numpy as np
from numba import njit

from verify.xfem.lanes.shuffles import add_to_records
from verify.xfem.lanes.vectors import LANES, load, mean, minus, no_lanes, store, transposed

__all__ = ["RECORD", "add_blocks", "add_forces", "finish_row"]

RECORD = LANES  #: numbers in the record of a node or a slot: a line of the cache


@njit(cache=True)
def add_forces(corners, start, v, at, nodes):
    """Add forces on the corners of `LANES` pieces.

    Parameters
    ----------
    corners : address of (p, 4) uint32
        Node of each corner.
    start : int
        First piece.
    v : address
        Force k of lane l is at (at + k) `LANES` + l.
    at : int
    nodes : address of (N, `RECORD`) float
        The first three of a record are the force.
    """
    for corner in range(4):
        add_to_records(nodes, corners, 4 * start + corner, 4, v, (at + 3 * corner) * LANES, 3)


@njit(cache=True)
def add_blocks(slots, start, v, at, waiting, ninths):
    """Add the blocks above the diagonal of `LANES` pieces.

    Parameters
    ----------
    slots : address of (p, 6) uint32
        Slot of each pair.
    start : int
        First piece.
    v : address
        Entry k of block b of lane l is at (at + 9 b + k) `LANES` + l.
    at : int
    waiting : address of (n, `RECORD`) float
        First eight entries of what is added up in each slot.
    ninths : address of (n,) float
        Ninth entries.
    """
    for pair in range(6):
        first, e = 6 * start + pair, (at + 9 * pair) * LANES
        add_to_records(waiting, slots, first, 6, v, e, 8)
        for l in range(LANES):
            ninths[slots[first + 6 * l]] += v[e + 8 * LANES + l]


@njit(cache=True)
def finish_row(
    row, starts, diagonal, mirror, whole, slot_of, waiting, ninths, nodes, force, blocks
):  # fmt: skip
    """Write a row, from the diagonal on or whole, and its force; empty its slots and its record.

    Parameters
    ----------
    row : int
        Those before it are finished.
    starts, diagonal, mirror : addresses of int
        Pattern.
    whole : bool
        Whether what is below the diagonal is wanted.
    slot_of : address of (B,) uint32
        Of each block above the diagonal, its slot.
    waiting, ninths : addresses
        As for `add_blocks`.
    nodes : address of (N, `RECORD`) float
        Force on each node.
    force : address of (N, 3) float
    blocks : address of (B, 3, 3) float
    """
    none, middle = no_lanes(), diagonal[row]
    for k in range(3):
        force[3 * row + k] = nodes[RECORD * row + k]
    store(nodes, RECORD * row, none)
    d, ninth = none, 0.0
    for place in range(starts[row], middle):
        above = 9 * mirror[place]
        block, last = load(blocks, above), blocks[above + 8]
        if whole:
            store(blocks, 9 * place, transposed(block))
            blocks[9 * place + 8] = last
        d, ninth = minus(d, block), ninth - last
    for place in range(middle + 1, starts[row + 1]):
        slot = np.int64(slot_of[place])
        block, last = load(waiting, RECORD * slot), ninths[slot]
        store(waiting, RECORD * slot, none)
        ninths[slot] = 0.0
        store(blocks, 9 * place, block)
        blocks[9 * place + 8] = last
        d, ninth = minus(d, block), ninth - last
    # a sum of blocks that are not symmetric is so but for round-off
    store(blocks, 9 * middle, mean(d, transposed(d)))
    blocks[9 * middle + 8] = ninth
