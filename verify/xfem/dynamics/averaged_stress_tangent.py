"""Derivative of the stress averaged over a step by the deformation at its end.

With G = F₀ + F₁, A = U₀ + U₁ and c = λ(½(t₀ + t₁) − d) − 2μ, the stress P = μ G + c T has

    dP = μ dF + ½λ (R₁ : dF) T + c dT,   dT = (dF − T dU₁) A⁻¹.

The derivative of a polar decomposition F = R U: dR = R Ω with the axis ω of Ω from
(tr(U) I − U) ω = axis of RᵀdF − dFᵀR, and dU = RᵀdF − Ω U. In the plane
dT = (d(t₁R₁) − T dt₁)/(t₀ + t₁), t₁R₁ being linear in F₁. The substitute that inverted pieces take
is differentiated likewise. Names are those of `averaged_stress_kernels`.
"""

import numpy as np
from numba import njit

from verify.xfem.dynamics.averaged_stress_kernels import (
    deformation,
    inner,
    invert,
    is_moving,
    product,
    stress,
)
from verify.xfem.polar_kernels import nearest_rotation

__all__ = ["add_averaged_stiffness"]


@njit(cache=True)
def _spin(R, Z, dF, out):
    """Write dR = R Ω and Ω to out[0], out[1]; Z is the inverse of tr(U) I − U."""
    A = out[1]
    product(R, dF, True, A)
    a, b, c = A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]
    x = Z[0, 0] * a + Z[0, 1] * b + Z[0, 2] * c
    y = Z[1, 0] * a + Z[1, 1] * b + Z[1, 2] * c
    z = Z[2, 0] * a + Z[2, 1] * b + Z[2, 2] * c
    A[:] = 0.0
    A[0, 1], A[0, 2], A[1, 2] = -z, y, -x
    A[1, 0], A[2, 0], A[2, 1] = z, -y, x
    product(R, A, False, out[0])


@njit(cache=True)
def _spin_compliance(R, F, U, Z):
    """Write U = RᵀF and the inverse of tr(U) I − U, or zeros where the rotation has no slope."""
    product(R, F, True, U)
    trace = U[0, 0] + U[1, 1] + U[2, 2]
    H = -U
    for k in range(3):
        H[k, k] += trace
    if not invert(H, Z):
        Z[:] = 0.0


@njit(cache=True)
def _slope_in_plane(t0, t1, R1, T, dF, dT):
    total = t0 + t1
    if total <= 0.0:
        dT[:] = 0.0
        return
    change = inner(R1, dF)
    along, across = dF[0, 0] + dF[1, 1], dF[1, 0] - dF[0, 1]
    dT[0, 0] = (along - T[0, 0] * change) / total
    dT[1, 1] = (along - T[1, 1] * change) / total
    dT[0, 1] = (-across - T[0, 1] * change) / total
    dT[1, 0] = (across - T[1, 0] * change) / total


@njit(cache=True)
def _slope(R1, U1, Z, inverse, T, dF, work, dT):
    """Write dT of the plain form; `inverse` is that of U₀ + U₁."""
    _spin(R1, Z, dF, work)
    product(work[1], U1, False, work[0])  # Ω U
    product(R1, dF, True, work[2])
    for k in range(3):
        for l in range(3):
            work[2, k, l] -= work[0, k, l]
    product(T, work[2], False, work[0])
    for k in range(3):
        for l in range(3):
            work[0, k, l] = dF[k, l] - work[0, k, l]
    product(work[0], inverse, False, dT)


@njit(cache=True)
def _slope_of_substitute(F0, F1, R1, Rm, Z, excess, dF, work, dT):
    """Write dT of the substitute; Rm and Z are those of F₀ + F₁, `excess` as in `_secant`."""
    _spin(Rm, Z, dF, work)
    dT[:] = work[0]
    G, change, dC, D = work[2], work[3], work[4], work[5]
    product(F0, F0, True, D)
    product(F1, F1, True, change)
    size = inner(change, change)
    product(dF, F1, True, dC)
    more = inner(R1, dF) - inner(Rm, dF)
    for k in range(3):
        for l in range(3):
            change[k, l] -= D[k, l]
            G[k, l] = F0[k, l] + F1[k, l]
            more -= dT[k, l] * (F1[k, l] - F0[k, l])
    for k in range(3):
        for l in range(k, 3):
            dC[k, l] = dC[l, k] = dC[k, l] + dC[l, k]
    square = inner(change, change)
    if not is_moving(square, size):
        return
    factor = excess / square
    slope = (more - 2.0 * factor * inner(change, dC)) / square
    product(G, change, False, D)
    for k in range(3):
        for l in range(3):
            dT[k, l] += slope * D[k, l]
    product(dF, change, False, D)
    product(G, dC, False, work[1])
    for k in range(3):
        for l in range(3):
            dT[k, l] += factor * (D[k, l] + work[1, k, l])


@njit(cache=True)
def _prepare(F0, F1, R0, R1, normal, substituted, T, work):
    """Write to work[6:] what all directions share; whether T is the substitute, and its excess."""
    U, Z, inverse, Rm = work[6], work[7], work[8], work[9]
    A = work[0]
    if not substituted:
        product(R0, F0, True, A)
        product(R1, F1, True, work[1])
        for k in range(3):
            for l in range(3):
                A[k, l] += work[1, k, l] + 2.0 * normal[k] * normal[l]
        if invert(A, inverse):
            _spin_compliance(R1, F1, U, Z)
            return False, 0.0
    q = np.zeros(4)
    q[0] = 1.0
    A[:] = F0 + F1
    nearest_rotation(A, q, Rm)
    _spin_compliance(Rm, A, U, Z)
    excess = inner(R1, F1) - inner(R0, F0)
    for k in range(3):
        for l in range(3):
            excess -= Rm[k, l] * (F1[k, l] - F0[k, l])
    return True, excess


@njit(cache=True)
def stress_slope(F0, F1, R0, R1, lam, mu, dim, normal, substituted, work, slope):
    """Write dP/dF₁ (d, d, d, d), the last two indices those of F₁.

    Parameters
    ----------
    F0, F1, R0, R1 : (d, d) float array
    work : (10, 3, 3) float array
    """
    size = len(F0)
    t0, t1 = inner(R0, F0), inner(R1, F1)
    factor = lam * (0.5 * (t0 + t1) - dim) - 2.0 * mu
    T, dF, dT = np.empty((size, size)), np.zeros((size, size)), np.empty((size, size))
    # with λ = 0 and μ = ½ the stress is ½ (F₀ + F₁) − T
    stress(F0, F1, R0, R1, 0.0, 0.5, dim, normal, substituted, work, T)
    for k in range(size):
        for l in range(size):
            T[k, l] = 0.5 * (F0[k, l] + F1[k, l]) - T[k, l]
    taken, excess = False, 0.0
    if size == 3:
        taken, excess = _prepare(F0, F1, R0, R1, normal, substituted, T, work)
    for l in range(size):
        for m in range(size):
            dF[l, m] = 1.0
            if size == 2:
                _slope_in_plane(t0, t1, R1, T, dF, dT)
            elif taken:
                _slope_of_substitute(F0, F1, R1, work[9], work[7], excess, dF, work, dT)
            else:
                _slope(R1, work[6], work[7], work[8], T, dF, work, dT)
            dF[l, m] = 0.0
            for k in range(size):
                for n in range(size):
                    slope[k, n, l, m] = 0.5 * lam * R1[l, m] * T[k, n] + factor * dT[k, n]
            slope[l, m, l, m] += mu


@njit(cache=True)
def add_averaged_stiffness(
    cells, targets, gradients, parent, volumes, normals, lam, mu, first, second, start, end,
    substituted, blocks,
):  # fmt: skip
    """Add the derivative of `averaged_force` by the end of the step to the nodal blocks.

    The derivative is not symmetric; arguments as there.
    """
    count, corners = cells.shape
    space = gradients.shape[2]
    F0, F1 = np.empty((space, space)), np.empty((space, space))
    work, normal = np.empty((10, 3, 3)), np.zeros(3)
    slope, half = np.empty((space, space, space, space)), np.empty((space, space, space))
    for piece in range(count):
        cell = parent[piece]
        if corners == space:
            normal = normals[cell]
        b, w = gradients[cell], volumes[piece]
        deformation(cells[piece], b, start, normal, F0)
        deformation(cells[piece], b, end, normal, F1)
        stress_slope(
            F0, F1, first[piece], second[piece], lam[cell], mu[cell], corners - 1, normal,
            substituted[piece], work, slope,
        )  # fmt: skip
        for i in range(corners):
            for k in range(space):
                for l in range(space):
                    for m in range(space):
                        half[k, l, m] = 0.0
                        for n in range(space):
                            half[k, l, m] += w * slope[k, n, l, m] * b[i, n]
            for j in range(corners):
                at = targets[piece, i, j]
                for k in range(space):
                    for l in range(space):
                        for m in range(space):
                            blocks[at, k, l] += half[k, l, m] * b[j, m]
