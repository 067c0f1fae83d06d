"""Rotation, force and stiffness of corotational tetrahedra in one sweep, eight at a time.

With b_i the material gradients of a piece (i = 1, 2, 3; b_0 = −Σ b_i), R its rotation and
g_i = R b_i, the force is f_i = τ g_i, τ = w (2μ ε + λ tr(ε) I), ε the symmetric part of
F Rᵀ − I; the stiffness with frozen rotations is K_ij = w (λ g_i g_jᵀ + μ g_j g_iᵀ + μ g_i·g_j I).
As Σ_j K_ij = 0 (a translation is free of force), only the six blocks above the diagonal are formed
per piece; `symmetric_rows` finds the diagonal from them.

The corners of each piece are sorted by node, so that a block above the diagonal of the piece is
one above the diagonal of the matrix. All that a batch computes with is in one array: loops that
write one array and read another are not turned into vector instructions.
"""

import numpy as np
from numba import njit

from verify.xfem.corotation.averaged_stress_lanes import average, average_lane
from verify.xfem.corotation.lane_layout import (
    BLOCKS,
    CORNERS,
    FIRST,
    FORCE,
    GRADIENTS,
    IRREGULAR,
    MODULI,
    MOVED,
    TURNED,
    matrix_at,
    rotation_at,
)
from verify.xfem.corotation.polar_kernels import mend_lane, rotation_matrix, turn_lanes
from verify.xfem.corotation.spin_lanes import add_spin
from verify.xfem.corotation.symmetric_rows import RECORD, add_blocks, add_forces, finish_row
from verify.xfem.lanes.shuffles import address, gather_records
from verify.xfem.lanes.vectors import LANES, fetch, load, store

__all__ = ["linearise", "unpack_rotations"]

_AHEAD = 2  # batches by which constants are brought to the cache before they are read


@njit(cache=True)
def _pack(displacement, velocity, implicit, motion):
    """Write displacement and displacement + implicit velocity of each node beside each other."""
    for node in range(len(displacement)):
        for k in range(3):
            u = displacement[node, k]
            motion[node, k] = u
            motion[node, 3 + k] = u + implicit * velocity[node, k]


@njit(cache=True)
def _gather(corners, start, motion, v):
    for corner in range(4):
        first, at = 4 * start + corner, (CORNERS + 6 * corner) * LANES
        gather_records(motion, corners, first, 4, v, at, 6)


@njit(cache=True)
def _fetch_ahead(batch, batches, corners, slots, constants, quaternions, motion, waiting):
    """Have what comes next brought to the first cache while this batch is computed."""
    start = batch * LANES
    for entry in range(6 * LANES):
        fetch(waiting, RECORD * np.int64(slots[6 * start + entry]))
    if batch + 1 < batches:
        for entry in range(4 * LANES):
            fetch(motion, RECORD * np.int64(corners[4 * (start + LANES) + entry]))
    # beyond the end nothing comes of it
    for entry in range(11):
        fetch(constants, (11 * (batch + _AHEAD) + entry) * LANES)
    for entry in range(4):
        fetch(quaternions, (4 * (batch + _AHEAD) + entry) * LANES)
    # places are read here already, a batch before the rest
    for line in range(0, 6 * LANES, 2 * LANES):
        fetch(slots, 6 * (start + 2 * _AHEAD * LANES) + line)
    for line in range(0, 4 * LANES, 2 * LANES):
        fetch(corners, 4 * (start + 2 * _AHEAD * LANES) + line)


@njit(cache=True, inline="always")
def _gradient_row(v, l, component, into, x, y, z):
    """Write one row of a gradient, from a component at the corners and rows of b_1, b_2, b_3."""
    at = (CORNERS + component) * LANES + l
    first = v[at]
    p, q, r = v[at + 6 * LANES] - first, v[at + 12 * LANES] - first, v[at + 18 * LANES] - first
    v[into * LANES + l] = x[0] * p + y[0] * q + z[0] * r
    v[(into + 1) * LANES + l] = x[1] * p + y[1] * q + z[1] * r
    v[(into + 2) * LANES + l] = x[2] * p + y[2] * q + z[2] * r


@njit(cache=True, fastmath={"contract"})
def _deform(v):
    """Write both deformation gradients."""
    for l in range(LANES):
        at = GRADIENTS * LANES + l
        x = (v[at], v[at + LANES], v[at + 2 * LANES])
        y = (v[at + 3 * LANES], v[at + 4 * LANES], v[at + 5 * LANES])
        z = (v[at + 6 * LANES], v[at + 7 * LANES], v[at + 8 * LANES])
        _gradient_row(v, l, 0, 0, x, y, z)
        _gradient_row(v, l, 1, 3, x, y, z)
        _gradient_row(v, l, 2, 6, x, y, z)
        _gradient_row(v, l, 3, MOVED, x, y, z)
        _gradient_row(v, l, 4, MOVED + 3, x, y, z)
        _gradient_row(v, l, 5, MOVED + 6, x, y, z)
        for k in (0, 4, 8):
            v[k * LANES + l] += 1.0
            v[(MOVED + k) * LANES + l] += 1.0


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
def _resist(factor, v):
    """Write the forces on the corners and the blocks above the diagonal."""
    for l in range(LANES):
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = rotation_at(v, TURNED, l)
        f00, f01, f02, f10, f11, f12, f20, f21, f22 = matrix_at(v, MOVED, l)
        wl, wm = v[MODULI * LANES + l], v[(MODULI + 1) * LANES + l]
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
        at = GRADIENTS * LANES + l
        p, q, r = v[at], v[at + LANES], v[at + 2 * LANES]
        b0, b1, b2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        p, q, r = v[at + 3 * LANES], v[at + 4 * LANES], v[at + 5 * LANES]
        c0, c1, c2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        p, q, r = v[at + 6 * LANES], v[at + 7 * LANES], v[at + 8 * LANES]
        d0, d1, d2 = (
            r00 * p + r01 * q + r02 * r,
            r10 * p + r11 * q + r12 * r,
            r20 * p + r21 * q + r22 * r,
        )
        a0, a1, a2 = -b0 - c0 - d0, -b1 - c1 - d1, -b2 - c2 - d2
        at = FORCE * LANES + l
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
        _block(v, BLOCKS, l, a0, a1, a2, b0, b1, b2, wl, wm, both)
        _block(v, BLOCKS + 9, l, a0, a1, a2, c0, c1, c2, wl, wm, both)
        _block(v, BLOCKS + 18, l, a0, a1, a2, d0, d1, d2, wl, wm, both)
        _block(v, BLOCKS + 27, l, b0, b1, b2, c0, c1, c2, wl, wm, both)
        _block(v, BLOCKS + 36, l, b0, b1, b2, d0, d1, d2, wl, wm, both)
        _block(v, BLOCKS + 45, l, c0, c1, c2, d0, d1, d2, wl, wm, both)


@njit(cache=True)
def linearise(
    v, corners, slots, constants, quaternions, ends, starts, diagonal, mirror, slot_of,
    displacement, velocity, implicit, turning, whole, factor, spin, first, averaged, taken,
    motion, waiting, ninths, nodes, force, blocks,
):  # fmt: skip
    """Write the force of a displacement to `force` and its stiffness to `blocks`.

    Pieces beyond the last one fill a batch: they have no stiffness, and their slot is the first.

    Parameters
    ----------
    v : (`ENTRIES` · LANES,) float array
        Memory of the lanes, begun by `new_lanes`.
    corners : (batches · LANES · 4,) uint32 array
        Nodes of each piece, ascending.
    slots : (batches · LANES · 6,) uint32 array
        Where blocks of the pairs of corners 01, 02, 03, 12, 13, 23 are added up.
    constants : (batches, 11 · LANES) float array
        b_1, b_2, b_3, w λ and w μ of the pieces of a batch, lane by lane.
    quaternions : (batches, 4 · LANES) float array
        Rotations: where to start from, and what they have become.
    ends : (N,) int array
        Pieces whose first node is that of the row or one before.
    starts, diagonal, mirror : int arrays
        Pattern.
    slot_of : (B,) uint32 array
        As `slots`, of each block above the diagonal.
    displacement : (N, 3) float array
        From which the rotations are taken.
    velocity : (N, 3) float array
    implicit : float
        In seconds. With these rotations the force is that of displacement + `implicit` velocity.
    turning : bool
        Without it rotations stay as they are.
    whole : bool
        Without it blocks below the diagonal are not written.
    factor, spin : float
        Of the stiffness with frozen rotations, and of what the exact one has beyond it.
    first : (batches, 4 · LANES) float array
        Rotations at the start of a step; read if averaged.
    averaged : bool
        Whether the force is that averaged over a step, whose start is what is moved.
    taken : (batches · LANES,) bool array
        Pieces that have taken the substitute for the averaged stress; updated.
    motion : (N, RECORD) float array
        Room for what is read of each node.
    waiting, ninths, nodes : float arrays
        As for `finish_row`, flat. Zero; zero again afterwards.
    force : (N, 3) float array
        Overwritten.
    blocks : (B, 3, 3) float array
        Overwritten.

    Returns
    -------
    int
        Pieces whose rotation is not differentiable, and is frozen in the exact stiffness.
    """
    _pack(displacement, velocity, implicit, motion)
    entries, moving, known, turned = (
        address(v), address(motion), address(constants), address(quaternions),
    )  # fmt: skip
    corners_at, slots_at = address(corners), address(slots)
    starts_at, diagonal_at, mirror_at = address(starts), address(diagonal), address(mirror)
    slot_at, waiting_at, ninths_at = address(slot_of), address(waiting), address(ninths)
    nodes_at, f, K, before = address(nodes), address(force), address(blocks), address(first)
    row, rows, left_out = 0, len(ends), 0
    for batch in range(len(constants)):
        start = batch * LANES
        for entry in range(11):
            store(entries, (GRADIENTS + entry) * LANES, load(known, (11 * batch + entry) * LANES))
        _fetch_ahead(batch, len(constants), corners_at, slots_at, known, turned, moving, waiting_at)
        _gather(corners_at, start, moving, entries)
        _deform(v)
        for entry in range(4):
            store(entries, (TURNED + entry) * LANES, load(turned, (4 * batch + entry) * LANES))
        if turning:
            if not turn_lanes(v):
                for l in range(LANES):
                    mend_lane(v, l)
            for entry in range(4):
                store(turned, (4 * batch + entry) * LANES, load(entries, (TURNED + entry) * LANES))
        _resist(factor, v)
        if spin != 0.0:
            add_spin(spin, v)
            for l in range(LANES):
                left_out += v[IRREGULAR * LANES + l] > 0.0
        if averaged:
            for entry in range(4):
                store(entries, (FIRST + entry) * LANES, load(before, (4 * batch + entry) * LANES))
            _average(v, taken[start : start + LANES])
        add_forces(corners_at, start, entries, FORCE, nodes_at)
        add_blocks(slots_at, start, entries, BLOCKS, waiting_at, ninths_at)
        while row < rows and ends[row] <= start + LANES:
            finish_row(
                row, starts_at, diagonal_at, mirror_at, whole, slot_at, waiting_at, ninths_at,
                nodes_at, f, K,
            )  # fmt: skip
            row += 1
    return left_out


@njit(cache=True)
def _average(v, taken):
    """Write the averaged forces, of some pieces with the substitute."""
    irregular = average(v)
    for l in range(LANES):
        irregular |= taken[l]
    if irregular:
        for l in range(LANES):
            if taken[l] or v[IRREGULAR * LANES + l] > 0.0:
                taken[l] = average_lane(v, l, taken[l])


@njit(cache=True)
def unpack_rotations(pieces, quaternions, rotations):
    """Write the rotation matrices (p, 3, 3) of `pieces` (p,) from quaternions packed in lanes."""
    q = np.empty(4)
    for at in range(len(pieces)):
        turned, lane = quaternions[at // LANES], at % LANES
        for k in range(4):
            q[k] = turned[k * LANES + lane]
        rotation_matrix(q, rotations[pieces[at]])
