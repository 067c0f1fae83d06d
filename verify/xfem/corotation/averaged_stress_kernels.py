"""Stress averaged over a step so that its work is the change of strain energy, exactly.

The potential is quadratic in F but for the trace of the stretch, t. Its discrete gradient needs
only a T with T : (F₁ − F₀) = t₁ − t₀ that is R in the limit and has T Fₘᵀ symmetric, so that
angular momentum is kept, Fₘ = (F₀ + F₁)/2. Then

    P = 2μ (Fₘ − T) + λ (½(t₀ + t₁) − d) T.

In the plane t R is linear in F, and T = (t₀ R₀ + t₁ R₁)/(t₀ + t₁). In space
U₁² − U₀² = ½[(U₁−U₀)(U₀+U₁) + (U₀+U₁)(U₁−U₀)], hence t₁ − t₀ = (U₀+U₁)⁻¹ : (C₁ − C₀) and
T = 2 Fₘ (U₀ + U₁)⁻¹. Neither has a quotient that is 0/0 at rest. Where an inverted piece makes
U₀ + U₁ indefinite, T = R(Fₘ) plus a multiple of Fₘ (C₁ − C₀) takes its place (Gonzalez 2000), and
keeps it to the end of the step, so that Newton's method does not alternate between the two.
"""

import numpy as np
from numba import njit

from verify.xfem.corotation.polar_kernels import nearest_rotation

__all__ = ["REGULAR", "averaged_force", "is_moving", "stress"]

REGULAR = 1e-6  # smallest pivot of U₀ + U₁ over its trace
_STILL = 1e-26  # square of a relative change of C that is round-off


@njit(cache=True, error_model="numpy")
def _product(A, B, transposed, out):
    """Write A B, or Aᵀ B, to `out`."""
    size = len(out)
    for k in range(size):
        for l in range(size):
            total = 0.0
            for m in range(size):
                total += (A[m, k] if transposed else A[k, m]) * B[m, l]
            out[k, l] = total


@njit(cache=True, error_model="numpy")
def _inner(A, B):
    """Sum of the products of entries."""
    total = 0.0
    for k in range(len(A)):
        for l in range(len(A)):
            total += A[k, l] * B[k, l]
    return total


@njit(cache=True, error_model="numpy")
def _invert(A, out):
    """Write the inverse of the symmetric part of A (3, 3); False if not positive definite."""
    a, b, c = A[0, 0], A[1, 1], A[2, 2]
    d, e, f = 0.5 * (A[0, 1] + A[1, 0]), 0.5 * (A[0, 2] + A[2, 0]), 0.5 * (A[1, 2] + A[2, 1])
    least = REGULAR * (a + b + c)
    minor = a * b - d * d
    p, q, r = b * c - f * f, e * f - d * c, d * f - b * e
    determinant = a * p + d * q + e * r
    if not (a > least and minor > least * a and determinant > least * minor):
        return False
    out[0, 0], out[1, 1], out[2, 2] = p, a * c - e * e, minor
    out[0, 1] = out[1, 0] = q
    out[0, 2] = out[2, 0] = r
    out[1, 2] = out[2, 1] = d * e - a * f
    for k in range(3):
        for l in range(3):
            out[k, l] /= determinant
    return True


@njit(cache=True, error_model="numpy")
def is_moving(square, size):
    """Whether a change of C, squared, is more than round-off of C, squared."""
    return square > _STILL * size


@njit(cache=True, error_model="numpy")
def _secant_in_plane(R0, R1, t0, t1, T):
    """Write T; whether it is undefined, both traces being zero."""
    total = t0 + t1
    for k in range(2):
        for l in range(2):
            T[k, l] = R1[k, l]
            if total > 0.0:
                T[k, l] = (t0 * R0[k, l] + t1 * R1[k, l]) / total
    return total <= 0.0


@njit(cache=True, error_model="numpy")
def _secant(F0, F1, R0, R1, t0, t1, normal, substituted, work, T):
    """Write T (3, 3); whether it is the substitute. A normal that is not zero: a membrane's."""
    middle, A, B = work[0], work[1], work[2]
    for k in range(3):
        for l in range(3):
            middle[k, l] = F0[k, l] + F1[k, l]
    if not substituted:
        _product(R0, F0, True, A)
        _product(R1, F1, True, B)
        for k in range(3):
            for l in range(3):
                A[k, l] += B[k, l] + 2.0 * normal[k] * normal[l]
        if _invert(A, B):
            _product(middle, B, False, T)
            return False
    nearest_rotation(middle, T)
    _product(F0, F0, True, A)
    _product(F1, F1, True, B)
    size = _inner(B, B)
    excess = t1 - t0
    for k in range(3):
        for l in range(3):
            B[k, l] -= A[k, l]
            excess -= T[k, l] * (F1[k, l] - F0[k, l])
    square = _inner(B, B)
    if is_moving(square, size):
        _product(middle, B, False, A)
        for k in range(3):
            for l in range(3):
                T[k, l] += excess / square * A[k, l]
    return True


@njit(cache=True, error_model="numpy")
def stress(F0, F1, R0, R1, lam, mu, dim, normal, substituted, work, P):
    """Write P; whether the substitute was taken."""
    t0, t1 = _inner(R0, F0), _inner(R1, F1)
    if len(F0) == 2:
        taken = _secant_in_plane(R0, R1, t0, t1, P)
    else:
        taken = _secant(F0, F1, R0, R1, t0, t1, normal, substituted, work, P)
    factor = lam * (0.5 * (t0 + t1) - dim) - 2.0 * mu
    for k in range(len(F0)):
        for l in range(len(F0)):
            P[k, l] = mu * (F0[k, l] + F1[k, l]) + factor * P[k, l]
    return taken


@njit(cache=True, error_model="numpy")
def _deformation(nodes, b, displacement, normal, F):
    """Write the deformation gradient; that of a membrane without its normal."""
    for k in range(len(F)):
        for l in range(len(F)):
            F[k, l] = 1.0 if k == l else 0.0
            if len(nodes) == len(F):
                F[k, l] -= normal[k] * normal[l]
            for i in range(len(nodes)):
                F[k, l] += displacement[nodes[i], k] * b[i, l]


@njit(cache=True, error_model="numpy")
def averaged_force(
    cells, gradients, parent, volumes, normals, lam, mu, first, second, start, end,
    substituted, force,
):  # fmt: skip
    """Add the internal force between two displacements to `force`.

    Parameters
    ----------
    first, second : (p, d, d) float array
        Rotations at the start and at the end.
    start, end : (N, d) float array
        Displacements.
    substituted : (p,) bool array
        Pieces that have taken the substitute in this step; added to.
    """
    count, corners = cells.shape
    space = gradients.shape[2]
    membrane = corners == space
    F0, F1 = np.empty((space, space)), np.empty((space, space))
    P, work = np.empty((space, space)), np.empty((3, 3, 3))
    normal = np.zeros(3)
    for piece in range(count):
        cell = parent[piece]
        if membrane:
            normal = normals[cell]
        b = gradients[cell]
        _deformation(cells[piece], b, start, normal, F0)
        _deformation(cells[piece], b, end, normal, F1)
        substituted[piece] = stress(
            F0, F1, first[piece], second[piece], lam[cell], mu[cell], corners - 1, normal,
            substituted[piece], work, P,
        )  # fmt: skip
        for i in range(corners):
            for k in range(space):
                for l in range(space):
                    force[cells[piece, i], k] += volumes[piece] * P[k, l] * b[i, l]
