"""Rotation nearest to a deformation gradient: argmax over SO(d) of tr(Rᵀ F).

The maximum t = tr(Rᵀ F) is the trace of the stretch; R has determinant +1 whatever the sign of det
F, so a collapsed or inverted element has a rotation too. In the plane R is closed form. In space
tr(R(q)ᵀ F) is a quadratic form in the unit quaternion q (Horn, J. Opt. Soc. Am. A 4, 1987). Such a
form has no local maximum on the sphere besides the global one, so Newton's method on SO(3) may
start anywhere. It has found the rotation where its Hessian tr(S) I − S, S = sym(Rᵀ F), is positive
definite. Elsewhere the eigenvector of the form replaces it, by a Jacobi iteration, which cannot
fail.
"""

import numpy as np

from verify.compiled import njit
from verify.xfem.arrays import Floats

_NEWTON_STEPS = 12
_PIVOT = 1e-4  # of the norm of F: a Hessian nearer to singular goes to the eigenvector
_SMALL_ANGLE = 1e-16  # square of the last rotation: Newton squares it once more, to round-off
_JACOBI_SWEEPS = 12
# skew matrices (turns, d, d) of infinitesimal rotations, by d
SPINS = {2: np.array([[[0.0, -1.0], [1.0, 0.0]]]), 3: np.cross(np.eye(3)[:, None], np.eye(3))}
SPINS[3] = SPINS[3].transpose(0, 2, 1)


def nearest_rotations(F: Floats) -> Floats:
    """Find the rotations (p, d, d) nearest to F (p, d, d), also singular or inverted."""
    R = np.empty(F.shape)
    if F.shape[1] == 2:
        rotations_in_plane(F, R)
    else:
        rotations_in_space(F, np.tile([1.0, 0.0, 0.0, 0.0], (len(F), 1)), R)
    return R


def adjugate(A: Floats) -> tuple[Floats, Floats]:
    """Compute adjugates and determinants of symmetric matrices (p, 3, 3)."""
    cofactors = np.cross(A[:, [1, 2, 0]], A[:, [2, 0, 1]])
    return cofactors, np.einsum("pk,pk->p", A[:, 0], cofactors[:, 0])


@njit(cache=True)
def rotations_in_plane(F, R):
    """Write the rotations nearest to F (p, 2, 2) to R; the identity where none is nearest."""
    for p in range(len(F)):
        along, across = F[p, 0, 0] + F[p, 1, 1], F[p, 1, 0] - F[p, 0, 1]
        length = np.hypot(along, across)
        c, s = (along / length, across / length) if length > 0.0 else (1.0, across)
        R[p, 0, 0], R[p, 1, 1], R[p, 1, 0], R[p, 0, 1] = c, c, s, -s


@njit(cache=True)
def rotations_in_space(F, quaternions, R):
    """Write the rotations nearest to F (p, 3, 3) to R, starting from quaternions (p, 4)."""
    for p in range(len(F)):
        q = quaternions[p]
        if not _newton(F[p], q, R[p]):
            largest_eigenvector(F[p], q)
        rotation_matrix(q, R[p])


@njit(cache=True)
def rotation_matrix(q, R):
    """Write the matrix of the unit quaternion (w, x, y, z) to R (3, 3)."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    R[0, 0], R[0, 1], R[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    R[1, 0], R[1, 1], R[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    R[2, 0], R[2, 1], R[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@njit(cache=True)
def _newton(F, q, R):
    """Improve the quaternion by Newton's method on SO(3); whether it has converged."""
    S = np.empty((3, 3))
    square = 0.0
    for k in range(3):
        for l in range(3):
            square += F[k, l] ** 2
    least = _PIVOT * np.sqrt(square)
    for _ in range(_NEWTON_STEPS):
        rotation_matrix(q, R)
        for k in range(3):
            for l in range(3):
                S[k, l] = R[0, k] * F[0, l] + R[1, k] * F[1, l] + R[2, k] * F[2, l]
        # Hessian tr(S) I − S, its cofactors, and the pivots of elimination times those before
        a, b, c = S[1, 1] + S[2, 2], S[0, 0] + S[2, 2], S[0, 0] + S[1, 1]
        d, e, f = -0.5 * (S[0, 1] + S[1, 0]), -0.5 * (S[0, 2] + S[2, 0]), -0.5 * (S[1, 2] + S[2, 1])
        c00, c01, c02, c22 = b * c - f * f, e * f - d * c, d * f - e * b, a * b - d * d
        c11, c12 = a * c - e * e, d * e - a * f
        determinant = a * c00 + d * c01 + e * c02
        if not (a > least and c22 > least * a and determinant > least * c22):
            return False
        # rotation that makes Rᵀ F symmetric to first order
        r, s, t = S[2, 1] - S[1, 2], S[0, 2] - S[2, 0], S[1, 0] - S[0, 1]
        x = (c00 * r + c01 * s + c02 * t) / determinant
        y = (c01 * r + c11 * s + c12 * t) / determinant
        z = (c02 * r + c12 * s + c22 * t) / determinant
        q0, q1, q2, q3 = q[0], q[1], q[2], q[3]
        q[0] = q0 - 0.5 * (q1 * x + q2 * y + q3 * z)
        q[1] = q1 + 0.5 * (q0 * x + q2 * z - q3 * y)
        q[2] = q2 + 0.5 * (q0 * y + q3 * x - q1 * z)
        q[3] = q3 + 0.5 * (q0 * z + q1 * y - q2 * x)
        length = np.sqrt(q[0] ** 2 + q[1] ** 2 + q[2] ** 2 + q[3] ** 2)
        for k in range(4):
            q[k] /= length
        if x * x + y * y + z * z <= _SMALL_ANGLE:
            return True
    return False


@njit(cache=True)
def largest_eigenvector(F, q):
    """Write to q the unit eigenvector of the largest eigenvalue of the form tr(R(q)ᵀ F)."""
    form = np.empty((4, 4))
    form[0, 0] = F[0, 0] + F[1, 1] + F[2, 2]
    for k in range(3):
        l, m = (k + 1) % 3, (k + 2) % 3
        form[k + 1, k + 1] = F[k, k] - F[l, l] - F[m, m]
        form[0, k + 1] = form[k + 1, 0] = F[m, l] - F[l, m]
        form[l + 1, m + 1] = form[m + 1, l + 1] = F[l, m] + F[m, l]
    vectors = np.empty((4, 4))
    for i in range(4):
        for k in range(4):
            vectors[i, k] = 1.0 if i == k else 0.0
    for _ in range(_JACOBI_SWEEPS):
        for i in range(3):
            for j in range(i + 1, 4):
                if form[i, j] == 0.0:
                    continue
                angle = 0.5 * np.arctan2(2.0 * form[i, j], form[j, j] - form[i, i])
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
    square = 0.0
    for k in range(4):
        square += vectors[k, best] ** 2
    for k in range(4):  # not as a whole: numba would compile its message for shapes that do not fit
        q[k] = vectors[k, best] / np.sqrt(square)
