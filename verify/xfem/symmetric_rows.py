"""Adding up the blocks of a symmetric matrix that is free of force in translation, row by row.

Pieces come by their first node, so a row is complete above the diagonal when the last piece that
begins with its node has been added. Its blocks, which until then waited in a few slots that stay
in the cache, are written to their place and, transposed, to below the diagonal; what the diagonal
needs, as Σ_j K_ij = 0, is known when its row's turn comes.
"""

import numpy as np
from numba import njit

from verify.xfem.lane_shuffles import add_vector, address, transpose_square
from verify.xfem.polar_kernels import LANES

__all__ = ["add_blocks", "add_forces", "finish_row"]

# unsigned: an index that may be negative costs a comparison each time
_1, _2, _3, _4 = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
_5, _6, _7, _8 = np.uint64(5), np.uint64(6), np.uint64(7), np.uint64(8)
_9 = np.uint64(9)


@njit(cache=True)
def add_forces(corners, start, v, at, force):
    """Add forces on the corners of `LANES` pieces.

    Parameters
    ----------
    corners : (p, 4) uint32 array
        Place in `force` of the first component of each corner.
    start : uint64
        First piece.
    v : float array
        Force k of lane l is at (at + k) `LANES` + l.
    at : int
    force : (3 N,) float array
    """
    for l in range(LANES):
        for corner in range(4):
            f = np.uint64(corners[start + np.uint64(l), corner])
            e = (at + 3 * corner) * LANES + l
            x, y, z = (
                force[f] + v[e],
                force[f + _1] + v[e + LANES],
                force[f + _2] + v[e + 2 * LANES],
            )
            force[f], force[f + _1], force[f + _2] = x, y, z


@njit(cache=True)
def add_blocks(slots, start, v, at, waiting):
    """Add the blocks above the diagonal of `LANES` pieces; scrambles what `v` has of them.

    Parameters
    ----------
    slots : (p, 6) uint32 array
        Place in `waiting` of the first entry of each pair's block.
    start : uint64
        First piece.
    v : float array
        Entry k of block b of lane l is at (at + 9 b + k) `LANES` + l.
    at : int
    waiting : float array
    """
    entries, sums = address(v), address(waiting)
    for pair in range(6):
        transpose_square(entries, (at + 9 * pair) * LANES)
    for l in range(LANES):
        for pair in range(6):
            slot = np.uint64(slots[start + np.uint64(l), pair])
            e = (at + 9 * pair) * LANES
            add_vector(sums, slot, entries, e + LANES * l)
            waiting[slot + _8] += v[e + 8 * LANES + l]


@njit(cache=True)
def finish_row(row, starts, columns, diagonal, mirror, whole, slot_of, waiting, beside, blocks):
    """Write a row from the diagonal on, and its mirror's blocks if wanted; empty its slots.

    Parameters
    ----------
    row : int
    starts, columns, diagonal, mirror : int arrays
        Pattern.
    whole : bool
        Whether what is below the diagonal is wanted.
    slot_of : (B,) uint32 array
        Of each block above the diagonal, the place of its first entry in `waiting`.
    waiting : float array
    beside : (N, 6) float array
        Minus the symmetric part of the blocks beside each diagonal block: 00, 01, 02, 11, 12, 22.
        That of this row is zero afterwards.
    blocks : (9 B,) float array
    """
    d = beside[row]
    d00, d01, d02, d11, d12, d22 = d[0], d[1], d[2], d[3], d[4], d[5]
    d[0] = d[1] = d[2] = d[3] = d[4] = d[5] = 0.0
    for place in range(np.uint64(diagonal[row] + 1), np.uint64(starts[row + 1])):
        w, b = np.uint64(slot_of[place]), _9 * place
        b00, b01, b02 = waiting[w], waiting[w + _1], waiting[w + _2]
        b10, b11, b12 = waiting[w + _3], waiting[w + _4], waiting[w + _5]
        b20, b21, b22 = waiting[w + _6], waiting[w + _7], waiting[w + _8]
        waiting[w] = waiting[w + _1] = waiting[w + _2] = 0.0
        waiting[w + _3] = waiting[w + _4] = waiting[w + _5] = 0.0
        waiting[w + _6] = waiting[w + _7] = waiting[w + _8] = 0.0
        blocks[b], blocks[b + _1], blocks[b + _2] = b00, b01, b02
        blocks[b + _3], blocks[b + _4], blocks[b + _5] = b10, b11, b12
        blocks[b + _6], blocks[b + _7], blocks[b + _8] = b20, b21, b22
        if whole:
            m = _9 * np.uint64(mirror[place])
            blocks[m], blocks[m + _1], blocks[m + _2] = b00, b10, b20
            blocks[m + _3], blocks[m + _4], blocks[m + _5] = b01, b11, b21
            blocks[m + _6], blocks[m + _7], blocks[m + _8] = b02, b12, b22
        # a sum of blocks that are not symmetric is so but for round-off
        s01, s02, s12 = 0.5 * (b01 + b10), 0.5 * (b02 + b20), 0.5 * (b12 + b21)
        other = beside[np.uint64(columns[place])]
        other[0] -= b00
        other[1] -= s01
        other[2] -= s02
        other[3] -= b11
        other[4] -= s12
        other[5] -= b22
        d00, d01, d02 = d00 - b00, d01 - s01, d02 - s02
        d11, d12, d22 = d11 - b11, d12 - s12, d22 - b22
    b = _9 * np.uint64(diagonal[row])
    blocks[b], blocks[b + _1], blocks[b + _2] = d00, d01, d02
    blocks[b + _3], blocks[b + _4], blocks[b + _5] = d01, d11, d12
    blocks[b + _6], blocks[b + _7], blocks[b + _8] = d02, d12, d22
