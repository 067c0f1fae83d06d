"""Rotation, force and tangent of corotational tetrahedra, eight at a time.

Let b_i be the material gradients of a cell (i = 1, 2, 3; b_0 = −Σ b_i), R its rotation and g_i = R
b_i. The force is f_i = τ g_i with τ = w (2μ ε + λ tr(ε) I). Here ε is the symmetric part of F Rᵀ −
I. The rotation-fixed tangent is K_ij = w (λ g_i g_jᵀ + μ g_j g_iᵀ + μ g_i·g_j I). The consistent
one has [g_i]ₓᵀ H [g_j]ₓ besides. There H = w (μ I + (λ tr E − 2μ)(tr(V) I − V)⁻¹) with V = R Uᵀ Rᵀ.
As Σ_j K_ij = 0 (a translation is free of force), only the six blocks above the diagonal are formed.

Everything about a batch is in one flat array v: entry k of cell l is at k `BATCH` + l. The loops of
a kernel go over the cells, and the compiler makes vector instructions of them; it does not where a
loop writes one array and reads another.
"""

import numpy as np
from numba import njit

from verify.xfem.polar import largest_eigenvector

BATCH = 8  #: cells that are computed with at once

# entries: the deformation gradient by rows is at 0
QUATERNION = 9
IRREGULAR = 13  # not zero: the stress has no plain form
_LEAST = 14  # smallest admissible pivot of the Hessian
_MOVED = 15  # deformation gradient of the moved points, or of the start of a step
GRADIENTS = 24  # b_1, b_2, b_3, then w λ and w μ
_MODULI = 33
FORCE = 35
BLOCKS = 47  # of the pairs of corners 01, 02, 03, 12, 13, 23
CORNERS = 101  # displacement and moved points, of four corners
FIRST = 125  # quaternion at the start of a step
ENTRIES = 129

_FUSED = {"contract"}  # multiply and add in one, rounded once
_NEWTON_STEPS = 12
_PIVOT = 1e-4  # of the norm of F: a Hessian nearer to singular goes to the eigenvector
_SMALL_ANGLE = 1e-16  # square of the last rotation: Newton squares it once more, to round-off
_SINGULAR = 1e-8  # of the trace of the stretch: a rotation without a derivative
_REGULAR = 1e-6  # smallest pivot of U₀ + U₁ over its trace


@njit(cache=True, fastmath=_FUSED)
def _matrix(v, at):
    """Return nine numbers of a cell, by rows."""
    return (
        v[at], v[at + BATCH], v[at + 2 * BATCH],
        v[at + 3 * BATCH], v[at + 4 * BATCH], v[at + 5 * BATCH],
        v[at + 6 * BATCH], v[at + 7 * BATCH], v[at + 8 * BATCH],
    )  # fmt: skip


@njit(cache=True, fastmath=_FUSED)
def _rotation(v, at):
    """Make the matrix of a quaternion of a cell, by rows."""
    w, x, y, z = v[at], v[at + BATCH], v[at + 2 * BATCH], v[at + 3 * BATCH]
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@njit(cache=True, fastmath=_FUSED)
def _times(M, x, y, z):
    return (
        M[0] * x + M[1] * y + M[2] * z,
        M[3] * x + M[4] * y + M[5] * z,
        M[6] * x + M[7] * y + M[8] * z,
    )


@njit(cache=True, fastmath=_FUSED)
def _turned_gradients(v, R, l):
    """Compute g_0, g_1, g_2, g_3."""
    b = _matrix(v, GRADIENTS * BATCH + l)
    g1, g2, g3 = (
        _times(R, b[0], b[1], b[2]),
        _times(R, b[3], b[4], b[5]),
        _times(R, b[6], b[7], b[8]),
    )
    return (-g1[0] - g2[0] - g3[0], -g1[1] - g2[1] - g3[1], -g1[2] - g2[2] - g3[2]), g1, g2, g3


@njit(cache=True, fastmath=_FUSED)
def _write(v, at, x):
    v[at], v[at + BATCH], v[at + 2 * BATCH] = x[0], x[1], x[2]


@njit(cache=True, fastmath=_FUSED)
def _gradient_row(v, at, into, b):
    """Write one row of a gradient, from a component at the corners."""
    first = v[at]
    p, q, r = v[at + 6 * BATCH] - first, v[at + 12 * BATCH] - first, v[at + 18 * BATCH] - first
    row = (
        b[0] * p + b[3] * q + b[6] * r,
        b[1] * p + b[4] * q + b[7] * r,
        b[2] * p + b[5] * q + b[8] * r,
    )
    _write(v, into, row)


@njit(cache=True, fastmath=_FUSED)
def deform(v):
    """Write both deformation gradients."""
    for l in range(BATCH):
        b = _matrix(v, GRADIENTS * BATCH + l)
        _gradient_row(v, CORNERS * BATCH + l, l, b)
        _gradient_row(v, (CORNERS + 1) * BATCH + l, 3 * BATCH + l, b)
        _gradient_row(v, (CORNERS + 2) * BATCH + l, 6 * BATCH + l, b)
        _gradient_row(v, (CORNERS + 3) * BATCH + l, _MOVED * BATCH + l, b)
        _gradient_row(v, (CORNERS + 4) * BATCH + l, (_MOVED + 3) * BATCH + l, b)
        _gradient_row(v, (CORNERS + 5) * BATCH + l, (_MOVED + 6) * BATCH + l, b)
        for k in (0, 4, 8):
            v[k * BATCH + l] += 1.0
            v[(_MOVED + k) * BATCH + l] += 1.0


@njit(cache=True)
def rotate(v):
    """Write the nearest rotations, from where they were; see `verify.xfem.polar`."""
    for l in range(BATCH):
        square = 0.0
        for entry in range(9):
            square += v[entry * BATCH + l] ** 2
        v[_LEAST * BATCH + l] = _PIVOT * np.sqrt(square)
    going = True
    steps = 0
    while going and steps < _NEWTON_STEPS:
        _newton_step(v)
        going = False
        for l in range(BATCH):
            going |= _SMALL_ANGLE < v[IRREGULAR * BATCH + l] < np.inf
        steps += 1
    for l in range(BATCH):
        if not v[IRREGULAR * BATCH + l] <= _SMALL_ANGLE:
            _rotate_one(v, l)


@njit(cache=True)
def _rotate_one(v, l):
    """Take the eigenvector where Newton's method has failed; apart, to keep the loop short."""
    F, q = np.empty((3, 3)), np.empty(4)
    for k in range(9):
        F[k // 3, k % 3] = v[k * BATCH + l]
    largest_eigenvector(F, q)
    for k in range(4):
        v[(QUATERNION + k) * BATCH + l] = q[k]


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def _newton_step(v):
    """One step of all cells without a branch; the square of the rotation, or infinity, is left."""
    for l in range(BATCH):
        f00, f01, f02, f10, f11, f12, f20, f21, f22 = _matrix(v, l)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(v, QUATERNION * BATCH + l)
        at = QUATERNION * BATCH + l
        w, x, y, z = v[at], v[at + BATCH], v[at + 2 * BATCH], v[at + 3 * BATCH]
        least = v[_LEAST * BATCH + l]
        a00 = r00 * f00 + r10 * f10 + r20 * f20
        a01 = r00 * f01 + r10 * f11 + r20 * f21
        a02 = r00 * f02 + r10 * f12 + r20 * f22
        a10 = r01 * f00 + r11 * f10 + r21 * f20
        a11 = r01 * f01 + r11 * f11 + r21 * f21
        a12 = r01 * f02 + r11 * f12 + r21 * f22
        a20 = r02 * f00 + r12 * f10 + r22 * f20
        a21 = r02 * f01 + r12 * f11 + r22 * f21
        a22 = r02 * f02 + r12 * f12 + r22 * f22
        # inverse of the Hessian by cofactors: one division, where elimination waits for three
        h00, h11, h22 = a11 + a22, a00 + a22, a00 + a11
        h01, h02, h12 = -0.5 * (a01 + a10), -0.5 * (a02 + a20), -0.5 * (a12 + a21)
        c00, c01, c02 = h11 * h22 - h12 * h12, h02 * h12 - h01 * h22, h01 * h12 - h02 * h11
        c11, c12, c22 = h00 * h22 - h02 * h02, h01 * h02 - h00 * h12, h00 * h11 - h01 * h01
        determinant = h00 * c00 + h01 * c01 + h02 * c02
        s0, s1, s2 = a21 - a12, a02 - a20, a10 - a01
        inverse = 1.0 / determinant
        t0 = inverse * (c00 * s0 + c01 * s1 + c02 * s2)
        t1 = inverse * (c01 * s0 + c11 * s1 + c12 * s2)
        t2 = inverse * (c02 * s0 + c12 * s1 + c22 * s2)
        good = (h00 > least) & (c22 > least * h00) & (determinant > least * c22)
        turn = t0 * t0 + t1 * t1 + t2 * t2
        v[IRREGULAR * BATCH + l] = turn if good else np.inf
        t0, t1, t2 = 0.5 * t0, 0.5 * t1, 0.5 * t2
        nw = w - x * t0 - y * t1 - z * t2
        nx = x + w * t0 + y * t2 - z * t1
        ny = y + w * t1 + z * t0 - x * t2
        nz = z + w * t2 + x * t1 - y * t0
        # the new one is longer by the length of (1, t): known before it is, and so is its root
        scale = 1.0 / np.sqrt((w * w + x * x + y * y + z * z) * (1.0 + 0.25 * turn))
        v[at] = nw * scale if good else w
        v[at + BATCH] = nx * scale if good else x
        v[at + 2 * BATCH] = ny * scale if good else y
        v[at + 3 * BATCH] = nz * scale if good else z


@njit(cache=True, fastmath=_FUSED)
def _block(v, at, a, b, wl, wm):
    """Write the block w (λ a bᵀ + μ b aᵀ + μ a·b I) of a pair of corners."""
    dot, both = wm * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]), wl + wm
    v[at] = both * a[0] * b[0] + dot
    v[at + BATCH] = wl * a[0] * b[1] + wm * a[1] * b[0]
    v[at + 2 * BATCH] = wl * a[0] * b[2] + wm * a[2] * b[0]
    v[at + 3 * BATCH] = wl * a[1] * b[0] + wm * a[0] * b[1]
    v[at + 4 * BATCH] = both * a[1] * b[1] + dot
    v[at + 5 * BATCH] = wl * a[1] * b[2] + wm * a[2] * b[1]
    v[at + 6 * BATCH] = wl * a[2] * b[0] + wm * a[0] * b[2]
    v[at + 7 * BATCH] = wl * a[2] * b[1] + wm * a[1] * b[2]
    v[at + 8 * BATCH] = both * a[2] * b[2] + dot


@njit(cache=True, fastmath=_FUSED)
def resist(v, scale):
    """Write the forces of the moved points, and `scale` times the rotation-fixed tangent."""
    for l in range(BATCH):
        R, F = _rotation(v, QUATERNION * BATCH + l), _matrix(v, _MOVED * BATCH + l)
        wl, wm = v[_MODULI * BATCH + l], v[(_MODULI + 1) * BATCH + l]
        e00 = F[0] * R[0] + F[1] * R[1] + F[2] * R[2] - 1.0
        e11 = F[3] * R[3] + F[4] * R[4] + F[5] * R[5] - 1.0
        e22 = F[6] * R[6] + F[7] * R[7] + F[8] * R[8] - 1.0
        s01 = wm * (
            F[0] * R[3] + F[1] * R[4] + F[2] * R[5] + F[3] * R[0] + F[4] * R[1] + F[5] * R[2]
        )
        s02 = wm * (
            F[0] * R[6] + F[1] * R[7] + F[2] * R[8] + F[6] * R[0] + F[7] * R[1] + F[8] * R[2]
        )
        s12 = wm * (
            F[3] * R[6] + F[4] * R[7] + F[5] * R[8] + F[6] * R[3] + F[7] * R[4] + F[8] * R[5]
        )
        pressure = wl * (e00 + e11 + e22)
        stress = (
            2.0 * wm * e00 + pressure, s01, s02,
            s01, 2.0 * wm * e11 + pressure, s12,
            s02, s12, 2.0 * wm * e22 + pressure,
        )  # fmt: skip
        a, b, c, d = _turned_gradients(v, R, l)
        _write(v, FORCE * BATCH + l, _times(stress, a[0], a[1], a[2]))
        _write(v, (FORCE + 3) * BATCH + l, _times(stress, b[0], b[1], b[2]))
        _write(v, (FORCE + 6) * BATCH + l, _times(stress, c[0], c[1], c[2]))
        _write(v, (FORCE + 9) * BATCH + l, _times(stress, d[0], d[1], d[2]))
        wl, wm = scale * wl, scale * wm
        _block(v, BLOCKS * BATCH + l, a, b, wl, wm)
        _block(v, (BLOCKS + 9) * BATCH + l, a, c, wl, wm)
        _block(v, (BLOCKS + 18) * BATCH + l, a, d, wl, wm)
        _block(v, (BLOCKS + 27) * BATCH + l, b, c, wl, wm)
        _block(v, (BLOCKS + 36) * BATCH + l, b, d, wl, wm)
        _block(v, (BLOCKS + 45) * BATCH + l, c, d, wl, wm)


@njit(cache=True, fastmath=_FUSED)
def _resisted(H, g):
    """Compute H [g]ₓ, H symmetric: its entries 00, 11, 22, 01, 02, 12."""
    x, y, z = g
    return (
        H[3] * z - H[4] * y, H[4] * x - H[0] * z, H[0] * y - H[3] * x,
        H[1] * z - H[5] * y, H[5] * x - H[3] * z, H[3] * y - H[1] * x,
        H[5] * z - H[2] * y, H[2] * x - H[4] * z, H[4] * y - H[5] * x,
    )  # fmt: skip


@njit(cache=True, fastmath=_FUSED)
def _add_rotational(v, at, g, Y):
    """Add [g]ₓᵀ Y to the block of a pair of corners."""
    x, y, z = g
    v[at] += z * Y[3] - y * Y[6]
    v[at + BATCH] += z * Y[4] - y * Y[7]
    v[at + 2 * BATCH] += z * Y[5] - y * Y[8]
    v[at + 3 * BATCH] += x * Y[6] - z * Y[0]
    v[at + 4 * BATCH] += x * Y[7] - z * Y[1]
    v[at + 5 * BATCH] += x * Y[8] - z * Y[2]
    v[at + 6 * BATCH] += y * Y[0] - x * Y[3]
    v[at + 7 * BATCH] += y * Y[1] - x * Y[4]
    v[at + 8 * BATCH] += y * Y[2] - x * Y[5]


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def resist_rotation(v, scale):
    """Add `scale` times the rotational part of the tangent; note in `IRREGULAR` who has none."""
    for l in range(BATCH):
        R, F = _rotation(v, QUATERNION * BATCH + l), _matrix(v, l)
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
        regular = determinant > _SINGULAR * abs(trace * trace * trace)
        v[IRREGULAR * BATCH + l] = 0.0 if regular else 1.0
        wl, wm = v[_MODULI * BATCH + l], v[(_MODULI + 1) * BATCH + l]
        own = scale * wm if regular else 0.0
        factor = scale * (wl * (trace - 3.0) - 2.0 * wm) / determinant if regular else 0.0
        H = (
            own + factor * c00, own + factor * (a * c - e * e), own + factor * (a * b - d * d),
            factor * c01, factor * c02, factor * (d * e - a * f),
        )  # fmt: skip
        g0, g1, g2, g3 = _turned_gradients(v, R, l)
        Y = _resisted(H, g1)
        _add_rotational(v, BLOCKS * BATCH + l, g0, Y)
        Y = _resisted(H, g2)
        _add_rotational(v, (BLOCKS + 9) * BATCH + l, g0, Y)
        _add_rotational(v, (BLOCKS + 27) * BATCH + l, g1, Y)
        Y = _resisted(H, g3)
        _add_rotational(v, (BLOCKS + 18) * BATCH + l, g0, Y)
        _add_rotational(v, (BLOCKS + 36) * BATCH + l, g1, Y)
        _add_rotational(v, (BLOCKS + 45) * BATCH + l, g2, Y)


@njit(cache=True, fastmath=_FUSED)
def _stretch(R, F):
    """Compute Rᵀ F, symmetric: its entries 00, 11, 22, 01, 02, 12."""
    return (
        R[0] * F[0] + R[3] * F[3] + R[6] * F[6],
        R[1] * F[1] + R[4] * F[4] + R[7] * F[7],
        R[2] * F[2] + R[5] * F[5] + R[8] * F[8],
        0.5 * (R[0] * F[1] + R[3] * F[4] + R[6] * F[7] + R[1] * F[0] + R[4] * F[3] + R[7] * F[6]),
        0.5 * (R[0] * F[2] + R[3] * F[5] + R[6] * F[8] + R[2] * F[0] + R[5] * F[3] + R[8] * F[6]),
        0.5 * (R[1] * F[2] + R[4] * F[5] + R[7] * F[8] + R[2] * F[1] + R[5] * F[4] + R[8] * F[7]),
    )


@njit(cache=True, error_model="numpy", fastmath=_FUSED)
def average(v):
    """Overwrite the forces by the stress averaged over a step, in its plain form.

    `verify.xfem.energy_momentum` has the equations. The start of the step is moved. Where there is
    no plain form, as `IRREGULAR` says afterwards, the force is zero.
    """
    for l in range(BATCH):
        F0, F1 = _matrix(v, _MOVED * BATCH + l), _matrix(v, l)
        U0, U1 = (
            _stretch(_rotation(v, FIRST * BATCH + l), F0),
            _stretch(_rotation(v, QUATERNION * BATCH + l), F1),
        )
        a, b, c = U0[0] + U1[0], U0[1] + U1[1], U0[2] + U1[2]
        d, e, f = U0[3] + U1[3], U0[4] + U1[4], U0[5] + U1[5]
        minor, c00, c01, c02 = a * b - d * d, b * c - f * f, e * f - d * c, d * f - b * e
        determinant, least = a * c00 + d * c01 + e * c02, _REGULAR * (a + b + c)
        regular = (a > least) & (minor > least * a) & (determinant > least * minor)
        v[IRREGULAR * BATCH + l] = 0.0 if regular else 1.0
        c11, c12 = a * c - e * e, d * e - a * f
        wl, wm = v[_MODULI * BATCH + l], v[(_MODULI + 1) * BATCH + l]
        wm = wm if regular else 0.0
        factor = (wl * (0.5 * (a + b + c) - 3.0) - 2.0 * wm) / determinant if regular else 0.0
        # the stress is G M, M = μ I + (½λ tr(A) − 3λ − 2μ) A⁻¹, G = F₀ + F₁ and A = U₀ + U₁
        M = (
            wm + factor * c00, factor * c01, factor * c02,
            factor * c01, wm + factor * c11, factor * c12,
            factor * c02, factor * c12, wm + factor * minor,
        )  # fmt: skip
        p = _times(M, F0[0] + F1[0], F0[1] + F1[1], F0[2] + F1[2])
        q = _times(M, F0[3] + F1[3], F0[4] + F1[4], F0[5] + F1[5])
        r = _times(M, F0[6] + F1[6], F0[7] + F1[7], F0[8] + F1[8])
        P = (p[0], p[1], p[2], q[0], q[1], q[2], r[0], r[1], r[2])
        B = _matrix(v, GRADIENTS * BATCH + l)
        x, y, z = (
            _times(P, B[0], B[1], B[2]),
            _times(P, B[3], B[4], B[5]),
            _times(P, B[6], B[7], B[8]),
        )
        _write(
            v, FORCE * BATCH + l, (-x[0] - y[0] - z[0], -x[1] - y[1] - z[1], -x[2] - y[2] - z[2])
        )
        _write(v, (FORCE + 3) * BATCH + l, x)
        _write(v, (FORCE + 6) * BATCH + l, y)
        _write(v, (FORCE + 9) * BATCH + l, z)
