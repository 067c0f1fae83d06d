"""Rotational part of the exact tangent of tetrahedra, eight at a time.

As in `spin_stiffness_kernels`, [g_i]ₓᵀ H [g_j]ₓ times the volume. Σ_j g_j = 0, so that the six
blocks above the diagonal of a piece are enough here too.
"""

from numba import njit

from verify.xfem.corotation.lane_layout import (
    BLOCKS,
    GRADIENTS,
    IRREGULAR,
    MODULI,
    TURNED,
    matrix_at,
    rotation_at,
)
from verify.xfem.corotation.spin_stiffness_kernels import SINGULAR
from verify.xfem.lanes.vectors import LANES

__all__ = ["add_spin"]


@njit(cache=True, inline="always")
def _turned(R, x, y, z):
    return (
        R[0] * x + R[1] * y + R[2] * z,
        R[3] * x + R[4] * y + R[5] * z,
        R[6] * x + R[7] * y + R[8] * z,
    )


@njit(cache=True, inline="always")
def _resisted(H, g):
    """H [g]ₓ, H symmetric: its entries 00, 11, 22, 01, 02, 12."""
    x, y, z = g
    return (
        H[3] * z - H[4] * y, H[4] * x - H[0] * z, H[0] * y - H[3] * x,
        H[1] * z - H[5] * y, H[5] * x - H[3] * z, H[3] * y - H[1] * x,
        H[5] * z - H[2] * y, H[2] * x - H[4] * z, H[4] * y - H[5] * x,
    )  # fmt: skip


@njit(cache=True, inline="always")
def _add_block(v, pair, l, g, Y):
    """Add [g]ₓᵀ Y to the block of a pair of corners."""
    x, y, z = g
    at = (BLOCKS + 9 * pair) * LANES + l
    v[at] += z * Y[3] - y * Y[6]
    v[at + LANES] += z * Y[4] - y * Y[7]
    v[at + 2 * LANES] += z * Y[5] - y * Y[8]
    v[at + 3 * LANES] += x * Y[6] - z * Y[0]
    v[at + 4 * LANES] += x * Y[7] - z * Y[1]
    v[at + 5 * LANES] += x * Y[8] - z * Y[2]
    v[at + 6 * LANES] += y * Y[0] - x * Y[3]
    v[at + 7 * LANES] += y * Y[1] - x * Y[4]
    v[at + 8 * LANES] += y * Y[2] - x * Y[5]


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def add_spin(spin, v):
    """Add `spin` times the stiffness of turning; note in `IRREGULAR` which pieces have none."""
    for l in range(LANES):
        R, F = rotation_at(v, TURNED, l), matrix_at(v, 0, l)
        # stretch V = F Rᵀ
        v00 = F[0] * R[0] + F[1] * R[1] + F[2] * R[2]
        v11 = F[3] * R[3] + F[4] * R[4] + F[5] * R[5]
        v22 = F[6] * R[6] + F[7] * R[7] + F[8] * R[8]
        d = F[0] * R[3] + F[1] * R[4] + F[2] * R[5] + F[3] * R[0] + F[4] * R[1] + F[5] * R[2]
        e = F[0] * R[6] + F[1] * R[7] + F[2] * R[8] + F[6] * R[0] + F[7] * R[1] + F[8] * R[2]
        f = F[3] * R[6] + F[4] * R[7] + F[5] * R[8] + F[6] * R[3] + F[7] * R[4] + F[8] * R[5]
        d, e, f = -0.5 * d, -0.5 * e, -0.5 * f
        a, b, c, trace = v11 + v22, v00 + v22, v00 + v11, v00 + v11 + v22
        c00, c01, c02 = b * c - f * f, e * f - d * c, d * f - b * e
        determinant = a * c00 + d * c01 + e * c02
        regular = determinant > SINGULAR * abs(trace * trace * trace)
        v[IRREGULAR * LANES + l] = 0.0 if regular else 1.0
        wl, wm = v[MODULI * LANES + l], v[(MODULI + 1) * LANES + l]
        own = spin * wm if regular else 0.0
        scale = spin * (wl * (trace - 3.0) - 2.0 * wm) / determinant if regular else 0.0
        H = (
            own + scale * c00, own + scale * (a * c - e * e), own + scale * (a * b - d * d),
            scale * c01, scale * c02, scale * (d * e - a * f),
        )  # fmt: skip
        B = matrix_at(v, GRADIENTS, l)
        g1, g2 = _turned(R, B[0], B[1], B[2]), _turned(R, B[3], B[4], B[5])
        g3 = _turned(R, B[6], B[7], B[8])
        g0 = (-g1[0] - g2[0] - g3[0], -g1[1] - g2[1] - g3[1], -g1[2] - g2[2] - g3[2])
        Y = _resisted(H, g1)
        _add_block(v, 0, l, g0, Y)
        Y = _resisted(H, g2)
        _add_block(v, 1, l, g0, Y)
        _add_block(v, 3, l, g1, Y)
        Y = _resisted(H, g3)
        _add_block(v, 2, l, g0, Y)
        _add_block(v, 4, l, g1, Y)
        _add_block(v, 5, l, g2, Y)
