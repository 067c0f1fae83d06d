"""Stress of tetrahedra averaged over a step, eight at a time; see `averaged_stress_kernels`."""

import numpy as np
from numba import njit

from verify.xfem.corotation.averaged_stress_kernels import REGULAR, stress
from verify.xfem.corotation.lane_layout import (
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
from verify.xfem.lanes.vectors import LANES

__all__ = ["average", "average_lane"]


@njit(cache=True, inline="always")
def _write_forces(v, l, P):
    """Write the forces on the corners of a lane from the stress times the volume, by rows."""
    v[FORCE * LANES + l] = v[(FORCE + 1) * LANES + l] = v[(FORCE + 2) * LANES + l] = 0.0
    _write_force(v, l, P, 0)
    _write_force(v, l, P, 1)
    _write_force(v, l, P, 2)


@njit(cache=True, inline="always")
def _write_force(v, l, P, corner):
    """Write the force on one of the last three corners, and take it from the first."""
    first, at = FORCE * LANES + l, (GRADIENTS + 3 * corner) * LANES + l
    to = first + (3 * corner + 3) * LANES
    x, y, z = v[at], v[at + LANES], v[at + 2 * LANES]
    f, g, h = (
        P[0] * x + P[1] * y + P[2] * z,
        P[3] * x + P[4] * y + P[5] * z,
        P[6] * x + P[7] * y + P[8] * z,
    )
    v[to], v[to + LANES], v[to + 2 * LANES] = f, g, h
    v[first] -= f
    v[first + LANES] -= g
    v[first + 2 * LANES] -= h


@njit(cache=True, inline="always")
def _stretch(R, F):
    """Rᵀ F, symmetric: its entries 00, 11, 22, 01, 02, 12."""
    return (
        R[0] * F[0] + R[3] * F[3] + R[6] * F[6],
        R[1] * F[1] + R[4] * F[4] + R[7] * F[7],
        R[2] * F[2] + R[5] * F[5] + R[8] * F[8],
        0.5 * (R[0] * F[1] + R[3] * F[4] + R[6] * F[7] + R[1] * F[0] + R[4] * F[3] + R[7] * F[6]),
        0.5 * (R[0] * F[2] + R[3] * F[5] + R[6] * F[8] + R[2] * F[0] + R[5] * F[3] + R[8] * F[6]),
        0.5 * (R[1] * F[2] + R[4] * F[5] + R[7] * F[8] + R[2] * F[1] + R[5] * F[4] + R[8] * F[7]),
    )


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def average(v):
    """Write the forces on the corners; note in `IRREGULAR` where the mean stretch is not regular.

    Returns
    -------
    bool
        Whether it is anywhere.
    """
    for l in range(LANES):
        F0, F1 = matrix_at(v, MOVED, l), matrix_at(v, 0, l)
        U0, U1 = _stretch(rotation_at(v, FIRST, l), F0), _stretch(rotation_at(v, TURNED, l), F1)
        a, b, c = U0[0] + U1[0], U0[1] + U1[1], U0[2] + U1[2]
        d, e, f = U0[3] + U1[3], U0[4] + U1[4], U0[5] + U1[5]
        minor, c00, c01, c02 = a * b - d * d, b * c - f * f, e * f - d * c, d * f - b * e
        determinant, least = a * c00 + d * c01 + e * c02, REGULAR * (a + b + c)
        regular = (a > least) & (minor > least * a) & (determinant > least * minor)
        v[IRREGULAR * LANES + l] = 0.0 if regular else 1.0
        c11, c12 = a * c - e * e, d * e - a * f
        wl, wm = v[MODULI * LANES + l], v[(MODULI + 1) * LANES + l]
        factor = (wl * (0.5 * (a + b + c) - 3.0) - 2.0 * wm) / determinant
        m00, m11, m22 = wm + factor * c00, wm + factor * c11, wm + factor * minor
        m01, m02, m12 = factor * c01, factor * c02, factor * c12
        g00, g01, g02 = F0[0] + F1[0], F0[1] + F1[1], F0[2] + F1[2]
        g10, g11, g12 = F0[3] + F1[3], F0[4] + F1[4], F0[5] + F1[5]
        g20, g21, g22 = F0[6] + F1[6], F0[7] + F1[7], F0[8] + F1[8]
        P = (
            g00 * m00 + g01 * m01 + g02 * m02,
            g00 * m01 + g01 * m11 + g02 * m12,
            g00 * m02 + g01 * m12 + g02 * m22,
            g10 * m00 + g11 * m01 + g12 * m02,
            g10 * m01 + g11 * m11 + g12 * m12,
            g10 * m02 + g11 * m12 + g12 * m22,
            g20 * m00 + g21 * m01 + g22 * m02,
            g20 * m01 + g21 * m11 + g22 * m12,
            g20 * m02 + g21 * m12 + g22 * m22,
        )
        _write_forces(v, l, P)
    irregular = False
    for l in range(LANES):
        irregular |= v[IRREGULAR * LANES + l] > 0.0
    return irregular


@njit(cache=True)
def average_lane(v, l, substituted):
    """Write the forces of a piece that takes the substitute; whether it really does."""
    R0, R1, F0, F1 = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    P, work = np.empty((3, 3)), np.empty((3, 3, 3))
    one, other = rotation_at(v, FIRST, l), rotation_at(v, TURNED, l)
    before, after = matrix_at(v, MOVED, l), matrix_at(v, 0, l)
    for k in range(9):
        R0[k // 3, k % 3], R1[k // 3, k % 3] = one[k], other[k]
        F0[k // 3, k % 3], F1[k // 3, k % 3] = before[k], after[k]
    wl, wm = v[MODULI * LANES + l], v[(MODULI + 1) * LANES + l]
    taken = stress(F0, F1, R0, R1, wl, wm, 3, np.zeros(3), substituted, work, P)
    _write_forces(v, l, P.reshape(-1))
    return taken
