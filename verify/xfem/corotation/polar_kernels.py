"""Rotation nearest to a deformation gradient: argmax over SO(d) of tr(Rᵀ F).

The maximum t = tr(Rᵀ F) is the trace of the stretch; R has determinant +1 whatever the sign of
det F, so a collapsed or inverted piece has a rotation too. In the plane R is closed form. In space
tr(R(q)ᵀ F) is a quadratic form in the unit quaternion q; such a form has no local maximum on the
sphere besides the global one, so Newton's method on SO(3) may start anywhere: where its Hessian
tr(S) I − S is positive definite it has found the rotation, and where it is not, the eigenvector
of the form (a Jacobi iteration, which cannot fail) is taken instead. Newton's steps run on several
deformation gradients in lockstep: one alone leaves the machine waiting for its divisions.
"""

import numpy as np
from numba import njit

from verify.xfem.lanes.vectors import LANES

__all__ = [
    "mend_lane",
    "nearest_rotation",
    "new_lanes",
    "rotation_in_plane",
    "rotation_matrix",
    "turn_lanes",
]

_NEWTON_STEPS = 12
_PIVOT = 1e-4  # of the norm of F: a Hessian nearer to singular goes to the eigenvector
_SMALL_TURN = 1e-16  # square of the last turn: Newton squares it once more, to round-off
_JACOBI_SWEEPS = 12


@njit(cache=True)
def rotation_matrix(q, R):
    """Write the matrix of the unit quaternion (w, x, y, z) to R (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[0, 1] = 2.0 * (x * y - w * z)
    R[0, 2] = 2.0 * (x * z + w * y)
    R[1, 0] = 2.0 * (x * y + w * z)
    R[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[1, 2] = 2.0 * (y * z - w * x)
    R[2, 0] = 2.0 * (x * z - w * y)
    R[2, 1] = 2.0 * (y * z + w * x)
    R[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@njit(cache=True)
def rotation_in_plane(F, R):
    """Write the rotation nearest to F (2, 2) to R."""
    along, across = F[0, 0] + F[1, 1], F[1, 0] - F[0, 1]
    length = np.hypot(along, across)
    cosine, sine = 1.0, 0.0
    if length > 0.0:
        cosine, sine = along / length, across / length
    R[0, 0] = R[1, 1] = cosine
    R[0, 1] = -sine
    R[1, 0] = sine


@njit(cache=True)
def nearest_rotation(F, R):
    """Write the rotation nearest to F (d, d) to R: of a single one, in space by the eigenvector.

    Without the lanes, which whatever calls this would have to be compiled with.

    Parameters
    ----------
    F : (d, d) float array
        Deformation gradient, d = 2 or 3; any, also singular or inverted.
    R : (d, d) float array
        Overwritten.
    """
    if F.shape[0] == 2:
        rotation_in_plane(F, R)
        return
    q = np.empty(4)
    _largest_eigenvector(F, q)
    rotation_matrix(q, R)


@njit(cache=True)
def new_lanes():
    """Memory for `LANES` rotations that are sought at once, all at the identity.

    Entry k of a lane is at k `LANES` + lane: F by rows, quaternion, square of the last turn
    (infinite where the Hessian was not positive definite), smallest admissible pivot.
    """
    lanes = np.zeros(15 * LANES)
    for lane in range(LANES):
        for entry in (0, 4, 8, 9):
            lanes[entry * LANES + lane] = 1.0
    return lanes


@njit(cache=True)
def mend_lane(lanes, lane):
    """Where Newton's method has failed, take the eigenvector; apart, to keep the loop short."""
    if lanes[13 * LANES + lane] <= _SMALL_TURN:
        return
    F = np.empty((3, 3))
    for k in range(3):
        for l in range(3):
            F[k, l] = lanes[(3 * k + l) * LANES + lane]
    q = np.empty(4)
    _largest_eigenvector(F, q)
    for k in range(4):
        lanes[(9 + k) * LANES + lane] = q[k]


@njit(cache=True)
def turn_lanes(lanes):
    """Newton's method on SO(3) until each lane has converged or failed; whether none has failed."""
    for lane in range(LANES):
        square = 0.0
        for entry in range(9):
            square += lanes[entry * LANES + lane] ** 2
        lanes[14 * LANES + lane] = _PIVOT * np.sqrt(square)
    for _ in range(_NEWTON_STEPS):
        _newton_step(lanes)
        going = failed = False
        for lane in range(LANES):
            turn = lanes[13 * LANES + lane]
            going |= _SMALL_TURN < turn < np.inf
            failed |= not turn < np.inf
        if not going:
            return not failed
    return False


@njit(cache=True, error_model="numpy", fastmath={"contract"})
def _newton_step(v):
    """One step for all lanes, without a branch, so that the lanes become those of the machine."""
    for l in range(LANES):
        f00, f01, f02 = v[l], v[LANES + l], v[2 * LANES + l]
        f10, f11, f12 = v[3 * LANES + l], v[4 * LANES + l], v[5 * LANES + l]
        f20, f21, f22 = v[6 * LANES + l], v[7 * LANES + l], v[8 * LANES + l]
        w, x, y, z = v[9 * LANES + l], v[10 * LANES + l], v[11 * LANES + l], v[12 * LANES + l]
        least = v[14 * LANES + l]
        r00, r01, r02 = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)
        r10, r11, r12 = 2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)
        r20, r21, r22 = 2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)
        a00 = r00 * f00 + r10 * f10 + r20 * f20
        a01 = r00 * f01 + r10 * f11 + r20 * f21
        a02 = r00 * f02 + r10 * f12 + r20 * f22
        a10 = r01 * f00 + r11 * f10 + r21 * f20
        a11 = r01 * f01 + r11 * f11 + r21 * f21
        a12 = r01 * f02 + r11 * f12 + r21 * f22
        a20 = r02 * f00 + r12 * f10 + r22 * f20
        a21 = r02 * f01 + r12 * f11 + r22 * f21
        a22 = r02 * f02 + r12 * f12 + r22 * f22
        # Hessian tr(S) I − S and its inverse by cofactors: one division, where elimination needs
        # three after each other, for which the lanes would wait
        h00, h11, h22 = a11 + a22, a00 + a22, a00 + a11
        h01, h02, h12 = -0.5 * (a01 + a10), -0.5 * (a02 + a20), -0.5 * (a12 + a21)
        c00, c01, c02 = h11 * h22 - h12 * h12, h02 * h12 - h01 * h22, h01 * h12 - h02 * h11
        c11, c12 = h00 * h22 - h02 * h02, h01 * h02 - h00 * h12
        c22 = h00 * h11 - h01 * h01
        determinant = h00 * c00 + h01 * c01 + h02 * c02
        # turn that makes Rᵀ F symmetric to first order
        s0, s1, s2 = a21 - a12, a02 - a20, a10 - a01
        inverse = 1.0 / determinant
        t0 = inverse * (c00 * s0 + c01 * s1 + c02 * s2)
        t1 = inverse * (c01 * s0 + c11 * s1 + c12 * s2)
        t2 = inverse * (c02 * s0 + c12 * s1 + c22 * s2)
        # the pivots of elimination, each times those before it
        good = (h00 > least) & (c22 > least * h00) & (determinant > least * c22)
        turn = t0 * t0 + t1 * t1 + t2 * t2
        v[13 * LANES + l] = turn if good else np.inf
        t0, t1, t2 = 0.5 * t0, 0.5 * t1, 0.5 * t2
        nw = w - x * t0 - y * t1 - z * t2
        nx = x + w * t0 + y * t2 - z * t1
        ny = y + w * t1 + z * t0 - x * t2
        nz = z + w * t2 + x * t1 - y * t0
        # the new one is longer by that of (1, t): known before it is, and so is its root
        scale = 1.0 / np.sqrt((w * w + x * x + y * y + z * z) * (1.0 + 0.25 * turn))
        v[9 * LANES + l] = nw * scale if good else w
        v[10 * LANES + l] = nx * scale if good else x
        v[11 * LANES + l] = ny * scale if good else y
        v[12 * LANES + l] = nz * scale if good else z


@njit(cache=True)
def _largest_eigenvector(F, q):
    """Write to q the unit eigenvector of the largest eigenvalue of the form tr(R(q)ᵀ F)."""
    form = np.empty((4, 4))
    form[0, 0] = F[0, 0] + F[1, 1] + F[2, 2]
    form[1, 1] = F[0, 0] - F[1, 1] - F[2, 2]
    form[2, 2] = F[1, 1] - F[0, 0] - F[2, 2]
    form[3, 3] = F[2, 2] - F[0, 0] - F[1, 1]
    form[0, 1] = form[1, 0] = F[2, 1] - F[1, 2]
    form[0, 2] = form[2, 0] = F[0, 2] - F[2, 0]
    form[0, 3] = form[3, 0] = F[1, 0] - F[0, 1]
    form[1, 2] = form[2, 1] = F[0, 1] + F[1, 0]
    form[1, 3] = form[3, 1] = F[0, 2] + F[2, 0]
    form[2, 3] = form[3, 2] = F[1, 2] + F[2, 1]
    vectors = np.zeros((4, 4))
    for k in range(4):
        vectors[k, k] = 1.0
    for _ in range(_JACOBI_SWEEPS):
        for i in range(3):
            for j in range(i + 1, 4):
                off = form[i, j]
                if off == 0.0:
                    continue
                angle = 0.5 * np.arctan2(2.0 * off, form[j, j] - form[i, i])
                c, s = np.cos(angle), np.sin(angle)
                for k in range(4):
                    p, r = form[k, i], form[k, j]
                    form[k, i], form[k, j] = c * p - s * r, s * p + c * r
                for k in range(4):
                    p, r = form[i, k], form[j, k]
                    form[i, k], form[j, k] = c * p - s * r, s * p + c * r
                for k in range(4):
                    p, r = vectors[k, i], vectors[k, j]
                    vectors[k, i], vectors[k, j] = c * p - s * r, s * p + c * r
    best = 0
    for i in range(1, 4):
        if form[i, i] > form[best, best]:
            best = i
    norm = 0.0
    for k in range(4):
        norm += vectors[k, best] ** 2
    norm = np.sqrt(norm)
    for k in range(4):
        q[k] = vectors[k, best] / norm
