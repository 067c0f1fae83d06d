"""Rotation, force and stiffness of corotational tetrahedra in one sweep, eight at a time.

With b_i the material gradients of a piece (i = 1, 2, 3; b_0 = −Σ b_i), R its rotation and
g_i = R b_i, the force is f_i = τ g_i, τ = w (2μ ε + λ tr(ε) I), ε the symmetric part of
F Rᵀ − I; the stiffness with frozen rotations is K_ij = w (λ g_i g_jᵀ + μ g_j g_iᵀ + μ g_i·g_j I).
As Σ_j K_ij = 0 (a translation is free of force), only the six blocks above the diagonal are formed
per piece; `complete` finds the diagonal from them, row by row.

The corners of each piece are sorted by node, so that a block above the diagonal of the piece is
one above the diagonal of the matrix.
"""

import numpy as np
from numba import njit

from verify.xfem.polar_kernels import (
    LANES,
    mend_lane,
    new_lanes,
    rotation_matrix,
    turn_lanes,
)

__all__ = ["complete", "linearise", "unpack_rotations"]

# places in the memory of the lanes, in entries of `LANES` numbers; 0 to 14 are of the rotations
_SLOPE = 15  # u_i − u_0, then moved_i − moved_0
_MOVED = 33  # deformation gradient of what is moved
_FORCE = 42
_BLOCKS = 54
_ENTRIES = 108


@njit(cache=True)
def _gather(cells, start, count, displacement, moved, v):
    for l in range(count):
        a, b, c, d = (
            cells[start + l, 0],
            cells[start + l, 1],
            cells[start + l, 2],
            cells[start + l, 3],
        )
        for k in range(3):
            first, other = displacement[a, k], moved[a, k]
            v[(_SLOPE + k) * LANES + l] = displacement[b, k] - first
            v[(_SLOPE + 3 + k) * LANES + l] = displacement[c, k] - first
            v[(_SLOPE + 6 + k) * LANES + l] = displacement[d, k] - first
            v[(_SLOPE + 9 + k) * LANES + l] = moved[b, k] - other
            v[(_SLOPE + 12 + k) * LANES + l] = moved[c, k] - other
            v[(_SLOPE + 15 + k) * LANES + l] = moved[d, k] - other


@njit(cache=True, fastmath={"contract"})
def _deform(b, v):
    """Write both deformation gradients, from gradients b (9 · LANES)."""
    for row in range(3):
        one = _SLOPE + row
        for l in range(LANES):
            p, q, r = v[one * LANES + l], v[(one + 3) * LANES + l], v[(one + 6) * LANES + l]
            s, t, u = v[(one + 9) * LANES + l], v[(one + 12) * LANES + l], v[(one + 15) * LANES + l]
            x, y, z = b[l], b[3 * LANES + l], b[6 * LANES + l]
            v[3 * row * LANES + l] = p * x + q * y + r * z
            v[(_MOVED + 3 * row) * LANES + l] = s * x + t * y + u * z
            x, y, z = b[LANES + l], b[4 * LANES + l], b[7 * LANES + l]
            v[(3 * row + 1) * LANES + l] = p * x + q * y + r * z
            v[(_MOVED + 3 * row + 1) * LANES + l] = s * x + t * y + u * z
            x, y, z = b[2 * LANES + l], b[5 * LANES + l], b[8 * LANES + l]
            v[(3 * row + 2) * LANES + l] = p * x + q * y + r * z
            v[(_MOVED + 3 * row + 2) * LANES + l] = s * x + t * y + u * z
    for row in range(3):
        for l in range(LANES):
            v[4 * row * LANES + l] += 1.0
            v[(_MOVED + 4 * row) * LANES + l] += 1.0


@njit(cache=True, inline="always")
def _block(v, at, l, x, y, z, p, q, r, wl, wm, sum_):
    """Write one block, K = w (λ a bᵀ + μ b aᵀ + μ a·b I), a = (x, y, z), b = (p, q, r)."""
    dot = wm * (x * p + y * q + z * r)
    v[at * LANES + l] = sum_ * x * p + dot
    v[(at + 1) * LANES + l] = wl * x * q + wm * y * p
    v[(at + 2) * LANES + l] = wl * x * r + wm * z * p
    v[(at + 3) * LANES + l] = wl * y * p + wm * x * q
    v[(at + 4) * LANES + l] = sum_ * y * q + dot
    v[(at + 5) * LANES + l] = wl * y * r + wm * z * q
    v[(at + 6) * LANES + l] = wl * z * p + wm * x * r
    v[(at + 7) * LANES + l] = wl * z * q + wm * y * r
    v[(at + 8) * LANES + l] = sum_ * z * r + dot


@njit(cache=True, fastmath={"contract"})
def _resist(b, moduli, factor, v):
    """Write the forces on the corners and the blocks above the diagonal."""
    for l in range(LANES):
        w, x, y, z = v[9 * LANES + l], v[10 * LANES + l], v[11 * LANES + l], v[12 * LANES + l]
        r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
        r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
        r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        m = _MOVED * LANES + l
        f00, f01, f02 = v[m], v[m + LANES], v[m + 2 * LANES]
        f10, f11, f12 = v[m + 3 * LANES], v[m + 4 * LANES], v[m + 5 * LANES]
        f20, f21, f22 = v[m + 6 * LANES], v[m + 7 * LANES], v[m + 8 * LANES]
        wl, wm = moduli[l], moduli[LANES + l]
        e00 = f00 * r00 + f01 * r01 + f02 * r02 - 1.0
        e11 = f10 * r10 + f11 * r11 + f12 * r12 - 1.0
        e22 = f20 * r20 + f21 * r21 + f22 * r22 - 1.0
        s01 = wm * (f00 * r10 + f01 * r11 + f02 * r12 + f10 * r00 + f11 * r01 + f12 * r02)
        s02 = wm * (f00 * r20 + f01 * r21 + f02 * r22 + f20 * r00 + f21 * r01 + f22 * r02)
        s12 = wm * (f10 * r20 + f11 * r21 + f12 * r22 + f20 * r10 + f21 * r11 + f22 * r12)
        pressure = wl * (e00 + e11 + e22)
        s00, s11, s22 = (
            2.0 * wm * e00 + pressure,
            2.0 * wm * e11 + pressure,
            2.0 * wm * e22 + pressure,
        )
        p, q, r = b[l], b[LANES + l], b[2 * LANES + l]
        b0, b1, b2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        p, q, r = b[3 * LANES + l], b[4 * LANES + l], b[5 * LANES + l]
        c0, c1, c2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        p, q, r = b[6 * LANES + l], b[7 * LANES + l], b[8 * LANES + l]
        d0, d1, d2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        a0, a1, a2 = -b0 - c0 - d0, -b1 - c1 - d1, -b2 - c2 - d2
        at = _FORCE * LANES + l
        v[at] = s00 * a0 + s01 * a1 + s02 * a2
        v[at + LANES] = s01 * a0 + s11 * a1 + s12 * a2
        v[at + 2 * LANES] = s02 * a0 + s12 * a1 + s22 * a2
        v[at + 3 * LANES] = s00 * b0 + s01 * b1 + s02 * b2
        v[at + 4 * LANES] = s01 * b0 + s11 * b1 + s12 * b2
        v[at + 5 * LANES] = s02 * b0 + s12 * b1 + s22 * b2
        v[at + 6 * LANES] = s00 * c0 + s01 * c1 + s02 * c2
        v[at + 7 * LANES] = s01 * c0 + s11 * c1 + s12 * c2
        v[at + 8 * LANES] = s02 * c0 + s12 * c1 + s22 * c2
        v[at + 9 * LANES] = s00 * d0 + s01 * d1 + s02 * d2
        v[at + 10 * LANES] = s01 * d0 + s11 * d1 + s12 * d2
        v[at + 11 * LANES] = s02 * d0 + s12 * d1 + s22 * d2
        wl, wm = factor * wl, factor * wm
        both = wl + wm
        _block(v, _BLOCKS, l, a0, a1, a2, b0, b1, b2, wl, wm, both)
        _block(v, _BLOCKS + 9, l, a0, a1, a2, c0, c1, c2, wl, wm, both)
        _block(v, _BLOCKS + 18, l, a0, a1, a2, d0, d1, d2, wl, wm, both)
        _block(v, _BLOCKS + 27, l, b0, b1, b2, c0, c1, c2, wl, wm, both)
        _block(v, _BLOCKS + 36, l, b0, b1, b2, d0, d1, d2, wl, wm, both)
        _block(v, _BLOCKS + 45, l, c0, c1, c2, d0, d1, d2, wl, wm, both)


@njit(cache=True)
def _scatter(cells, targets, start, count, v, force, blocks):
    for l in range(count):
        for corner in range(4):
            node = cells[start + l, corner]
            at = (_FORCE + 3 * corner) * LANES + l
            force[node, 0] += v[at]
            force[node, 1] += v[at + LANES]
            force[node, 2] += v[at + 2 * LANES]
        for pair in range(6):
            block = targets[start + l, pair]
            at = (_BLOCKS + 9 * pair) * LANES + l
            blocks[block, 0, 0] += v[at]
            blocks[block, 0, 1] += v[at + LANES]
            blocks[block, 0, 2] += v[at + 2 * LANES]
            blocks[block, 1, 0] += v[at + 3 * LANES]
            blocks[block, 1, 1] += v[at + 4 * LANES]
            blocks[block, 1, 2] += v[at + 5 * LANES]
            blocks[block, 2, 0] += v[at + 6 * LANES]
            blocks[block, 2, 1] += v[at + 7 * LANES]
            blocks[block, 2, 2] += v[at + 8 * LANES]


@njit(cache=True)
def linearise(
    cells, targets, gradients, moduli, quaternions, displacement, moved, turning, factor,
    force, half,
):  # fmt: skip
    """Add the force of a displacement to `force` and its stiffness above the diagonal to `half`.

    Parameters
    ----------
    cells : (p, 4) int array
        Nodes of each piece, ascending.
    targets : (p, 6) int array
        Blocks of the pairs of corners 01, 02, 03, 12, 13, 23.
    gradients : (batches, 9 · LANES) float array
        b_1, b_2, b_3 of the pieces of a batch, lane by lane.
    moduli : (batches, 2 · LANES) float array
        w λ and w μ.
    quaternions : (batches, 4 · LANES) float array
        Rotations: where to start from, and what they have become.
    displacement : (N, 3) float array
        From which the rotations are taken.
    moved : (N, 3) float array
        From which, with these rotations, the force is taken.
    turning : bool
        Without it rotations stay as they are.
    factor : float
        Of the stiffness.
    force : (N, 3) float array
    half : (U, 3, 3) float array
        Blocks above the diagonal, in the order in which they are met.
    """
    v = np.zeros(_ENTRIES * LANES)
    rest = new_lanes()
    for entry in range(len(rest)):
        v[entry] = rest[entry]
    for batch in range(len(gradients)):
        start = batch * LANES
        count = min(LANES, len(cells) - start)
        b = gradients[batch]
        _gather(cells, start, count, displacement, moved, v)
        _deform(b, v)
        turned = quaternions[batch]
        for entry in range(4 * LANES):
            v[9 * LANES + entry] = turned[entry]
        if turning:
            if not turn_lanes(v):
                for l in range(count):
                    mend_lane(v, l)
            for entry in range(4 * LANES):
                turned[entry] = v[9 * LANES + entry]
        _resist(b, moduli[batch], factor, v)
        _scatter(cells, targets, start, count, v, force, half)


@njit(cache=True)
def complete(starts, columns, source, half, blocks):
    """Write the whole of a matrix without force in translation, from its upper part.

    Parameters
    ----------
    starts, columns : int arrays
        Pattern, with the diagonal.
    source : (B,) int array
        Of each block off the diagonal, its place in `half`, or that of its transpose.
    half : (U + 1, 3, 3) float array
        The last for blocks to which no piece adds. Zero afterwards, ready for the next sum.
    blocks : (B, 3, 3) float array
        Overwritten.
    """
    for row in range(len(starts) - 1):
        d00 = d01 = d02 = d11 = d12 = d22 = 0.0
        diagonal = starts[row]
        for at in range(starts[row], starts[row + 1]):
            if columns[at] == row:
                diagonal = at
                continue
            h = source[at]
            b00, b01, b02 = half[h, 0, 0], half[h, 0, 1], half[h, 0, 2]
            b10, b11, b12 = half[h, 1, 0], half[h, 1, 1], half[h, 1, 2]
            b20, b21, b22 = half[h, 2, 0], half[h, 2, 1], half[h, 2, 2]
            if columns[at] < row:  # the second of the two rows that read it
                b01, b02, b12, b10, b20, b21 = b10, b20, b21, b01, b02, b12
                half[h, 0, 0] = half[h, 0, 1] = half[h, 0, 2] = 0.0
                half[h, 1, 0] = half[h, 1, 1] = half[h, 1, 2] = 0.0
                half[h, 2, 0] = half[h, 2, 1] = half[h, 2, 2] = 0.0
            blocks[at, 0, 0], blocks[at, 0, 1], blocks[at, 0, 2] = b00, b01, b02
            blocks[at, 1, 0], blocks[at, 1, 1], blocks[at, 1, 2] = b10, b11, b12
            blocks[at, 2, 0], blocks[at, 2, 1], blocks[at, 2, 2] = b20, b21, b22
            d00 -= b00
            d11 -= b11
            d22 -= b22
            d01 -= b01 + b10
            d02 -= b02 + b20
            d12 -= b12 + b21
        # a sum of blocks that are not symmetric is so but for round-off
        d01, d02, d12 = 0.5 * d01, 0.5 * d02, 0.5 * d12
        blocks[diagonal, 0, 0], blocks[diagonal, 0, 1], blocks[diagonal, 0, 2] = d00, d01, d02
        blocks[diagonal, 1, 0], blocks[diagonal, 1, 1], blocks[diagonal, 1, 2] = d01, d11, d12
        blocks[diagonal, 2, 0], blocks[diagonal, 2, 1], blocks[diagonal, 2, 2] = d02, d12, d22


@njit(cache=True)
def unpack_rotations(pieces, quaternions, rotations):
    """Write the rotation matrices (p, 3, 3) of `pieces` (p,) from quaternions packed in lanes."""
    q = np.empty(4)
    for at in range(len(pieces)):
        turned, lane = quaternions[at // LANES], at % LANES
        for k in range(4):
            q[k] = turned[k * LANES + lane]
        rotation_matrix(q, rotations[pieces[at]])
