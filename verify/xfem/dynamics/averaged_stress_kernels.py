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

from functools import cache
from types import SimpleNamespace

import numpy as np
from numba import njit

from verify.xfem.polar_kernels import nearest_rotation

__all__ = ["averaged_stress_kernels"]

_REGULAR = 1e-6  # smallest pivot of U₀ + U₁ over its trace
_STILL = 1e-26  # square of a relative change of C that is round-off
_DIFFERENCE = 3e-8  # of F; the error of a one-sided difference costs Newton nothing


@cache
def averaged_stress_kernels(dim: int, space: int) -> SimpleNamespace:
    """Loops for simplices of dimension `dim` in `space`.

    Returns
    -------
    SimpleNamespace
        ``averaged_force`` and ``add_averaged_stiffness``, its derivative with respect to the end
        of the step, which is not symmetric.
    """
    corners = dim + 1
    membrane = dim < space

    @njit(cache=True)
    def product(A, B, transposed, out):
        """Write A B, or Aᵀ B, to `out`."""
        for k in range(space):
            for l in range(space):
                total = 0.0
                for m in range(space):
                    total += (A[m, k] if transposed else A[k, m]) * B[m, l]
                out[k, l] = total

    @njit(cache=True)
    def trace_product(A, B):
        total = 0.0
        for k in range(space):
            for l in range(space):
                total += A[k, l] * B[k, l]
        return total

    @njit(cache=True)
    def invert(A, out):
        """Write the inverse of the symmetric part of A (3, 3); False if not positive definite."""
        a, b, c = A[0, 0], A[1, 1], A[2, 2]
        d, e, f = 0.5 * (A[0, 1] + A[1, 0]), 0.5 * (A[0, 2] + A[2, 0]), 0.5 * (A[1, 2] + A[2, 1])
        least = _REGULAR * (a + b + c)
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

    @njit(cache=True)
    def secant(F0, F1, R0, R1, t0, t1, normal, substituted, work, T):
        """Write T; whether it is the substitute."""
        middle, A, B, q = work[0], work[1], work[2], work[3, 0]
        if space == 2:
            total = t0 + t1
            for k in range(space):
                for l in range(space):
                    T[k, l] = R1[k, l]
                    if total > 0.0:
                        T[k, l] = (t0 * R0[k, l] + t1 * R1[k, l]) / total
            return total <= 0.0
        for k in range(space):
            for l in range(space):
                middle[k, l] = F0[k, l] + F1[k, l]
        if not substituted:
            product(R0, F0, True, A)
            product(R1, F1, True, B)
            for k in range(space):
                for l in range(space):
                    A[k, l] += B[k, l]
                    if membrane:
                        A[k, l] += 2.0 * normal[k] * normal[l]
            if invert(A, B):
                product(middle, B, False, T)
                return False
        q[0], q[1], q[2], q[3] = 1.0, 0.0, 0.0, 0.0
        nearest_rotation(middle, q, T)
        product(F0, F0, True, A)
        product(F1, F1, True, B)
        size = trace_product(B, B)
        excess = t1 - t0
        for k in range(space):
            for l in range(space):
                B[k, l] -= A[k, l]
                excess -= T[k, l] * (F1[k, l] - F0[k, l])
        square = trace_product(B, B)
        if square > _STILL * size:
            product(middle, B, False, A)
            for k in range(space):
                for l in range(space):
                    T[k, l] += excess / square * A[k, l]
        return True

    @njit(cache=True)
    def stress(F0, F1, R0, R1, lam, mu, normal, substituted, work, P):
        """Write P; whether the substitute was taken."""
        t0, t1 = trace_product(R0, F0), trace_product(R1, F1)
        taken = secant(F0, F1, R0, R1, t0, t1, normal, substituted, work, P)
        factor = lam * (0.5 * (t0 + t1) - dim) - 2.0 * mu
        for k in range(space):
            for l in range(space):
                P[k, l] = mu * (F0[k, l] + F1[k, l]) + factor * P[k, l]
        return taken

    @njit(cache=True)
    def gradient(nodes, b, displacement, normal, F):
        for k in range(space):
            for l in range(space):
                F[k, l] = 1.0 if k == l else 0.0
                if membrane:
                    F[k, l] -= normal[k] * normal[l]
                for i in range(corners):
                    F[k, l] += displacement[nodes[i], k] * b[i, l]

    @njit(cache=True)
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
        F0, F1 = np.empty((space, space)), np.empty((space, space))
        P, work = np.empty((space, space)), np.empty((4, 4, 4))
        normal = np.zeros(3)
        for piece in range(len(cells)):
            cell = parent[piece]
            if membrane:
                normal = normals[cell]
            b = gradients[cell]
            gradient(cells[piece], b, start, normal, F0)
            gradient(cells[piece], b, end, normal, F1)
            substituted[piece] = stress(
                F0, F1, first[piece], second[piece], lam[cell], mu[cell], normal,
                substituted[piece], work, P,
            )  # fmt: skip
            for i in range(corners):
                for k in range(space):
                    for l in range(space):
                        force[cells[piece, i], k] += volumes[piece] * P[k, l] * b[i, l]

    @njit(cache=True)
    def add_averaged_stiffness(
        cells, targets, gradients, parent, volumes, normals, lam, mu, first, second, start, end,
        substituted, blocks,
    ):  # fmt: skip
        """Add the derivative of the averaged force to the nodal blocks."""
        F0, F1 = np.empty((space, space)), np.empty((space, space))
        P, D, work = np.empty((space, space)), np.empty((space, space)), np.empty((4, 4, 4))
        R, q, normal = np.empty((space, space)), np.zeros(4), np.zeros(3)
        column = np.empty((corners, space))
        for piece in range(len(cells)):
            cell = parent[piece]
            if membrane:
                normal = normals[cell]
            b = gradients[cell]
            la, mm, taken = lam[cell], mu[cell], substituted[piece]
            gradient(cells[piece], b, start, normal, F0)
            gradient(cells[piece], b, end, normal, F1)
            stress(F0, F1, first[piece], second[piece], la, mm, normal, taken, work, P)
            scale = volumes[piece] / _DIFFERENCE
            q[0] = 1.0
            q[1] = q[2] = q[3] = 0.0
            for l in range(space):
                for m in range(space):
                    kept = F1[l, m]
                    F1[l, m] = kept + _DIFFERENCE
                    nearest_rotation(F1, q, R)
                    stress(F0, F1, first[piece], R, la, mm, normal, taken, work, D)
                    F1[l, m] = kept
                    for i in range(corners):
                        for k in range(space):
                            column[i, k] = 0.0
                            for n in range(space):
                                column[i, k] += scale * (D[k, n] - P[k, n]) * b[i, n]
                    for j in range(corners):
                        for i in range(corners):
                            for k in range(space):
                                blocks[targets[piece, i, j], k, l] += column[i, k] * b[j, m]

    return SimpleNamespace(
        averaged_force=averaged_force, add_averaged_stiffness=add_averaged_stiffness
    )
