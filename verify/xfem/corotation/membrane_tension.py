"""Stiffness of a membrane across its plane: what its tension gives it.

A displacement φ along the normal n changes the strain in the second order only. The second
derivative of the potential is then w (∇φ · S ∇φ), S the second Piola–Kirchhoff stress, whose
principal values are s_k = (2μ(λ_k − 1) + λ(λ_1 + λ_2 − 2))/λ_k at the stretches λ_k. Frozen
rotations leave it out. Here its positive part is added, Σ max(0, s_k) e_k e_kᵀ, so that the
stiffness of a step keeps no negative mode: a compressed membrane gets nothing.
"""

import numpy as np
from numba import njit

__all__ = ["add_tension"]

_COLLAPSED = 1e-6  # stretch below which a direction carries no tension that could be meant


@njit(cache=True)
def _positive_stress(R, F, lam, mu, normal, least):
    """(α, β) of the positive part α (I − N Nᵀ) + β U of the second Piola–Kirchhoff stress.

    Principal values below `least` are taken as that.
    """
    trace = square = 0.0
    for k in range(3):
        for l in range(3):
            stretch = 0.0
            for m in range(3):
                stretch += 0.5 * (R[m, k] * F[m, l] + R[m, l] * F[m, k])
            square += stretch * stretch
            if k == l:
                trace += stretch
    gap = np.sqrt(max(2.0 * square - trace * trace, 0.0))
    high, low = 0.5 * (trace + gap), 0.5 * (trace - gap)
    pull = lam * (trace - 2.0)
    first = second = least
    if high > _COLLAPSED:
        first = max(least, (2.0 * mu * (high - 1.0) + pull) / high)
    if low > _COLLAPSED:
        second = max(least, (2.0 * mu * (low - 1.0) + pull) / low)
    if gap <= 1e-12 * trace:
        return 0.5 * (first + second), 0.0
    beta = (first - second) / gap
    return first - beta * high, beta


@njit(cache=True)
def add_tension(
    cells, targets, gradients, parent, volumes, normals, lam, mu, rotations, displacement,
    vector, share, scale, least, force, blocks,
):  # fmt: skip
    """Add `share` times this stiffness times `vector` to `force`, `scale` times it to `blocks`.

    Parameters
    ----------
    cells, targets : int arrays
        (p, 3) and (p, 3, 3).
    gradients, parent, volumes, normals, lam, mu, rotations
        As `verify.xfem.corotation.corotational_kernels` has them, of triangles in space.
    displacement : (N, 3) float array
        That of the rotations.
    vector, force : (N, 3) float array
    share, scale : float
        Where zero, nothing is added.
    least : float
        Tension over μ that every direction is taken to have at least.
    blocks : (B, 3, 3) float array
    """
    F = np.empty((3, 3))
    U, n = np.empty((3, 3)), np.empty(3)
    for piece in range(len(cells)):
        cell = parent[piece]
        R, N, b = rotations[piece], normals[cell], gradients[cell]
        for k in range(3):
            for l in range(3):
                F[k, l] = (1.0 if k == l else 0.0) - N[k] * N[l]
                for i in range(3):
                    F[k, l] += displacement[cells[piece, i], k] * b[i, l]
        alpha, beta = _positive_stress(R, F, lam[cell], mu[cell], N, least * mu[cell])
        if alpha == 0.0 and beta == 0.0:
            continue
        for k in range(3):
            n[k] = R[k, 0] * N[0] + R[k, 1] * N[1] + R[k, 2] * N[2]
            for l in range(3):
                U[k, l] = R[0, k] * F[0, l] + R[1, k] * F[1, l] + R[2, k] * F[2, l]
        for i in range(3):
            for j in range(3):
                value = 0.0
                for k in range(3):
                    value += alpha * b[i, k] * b[j, k]
                    for l in range(3):
                        value += 0.5 * beta * b[i, k] * (U[k, l] + U[l, k]) * b[j, l]
                value *= volumes[piece]
                node, at = cells[piece, j], targets[piece, i, j]
                across = n[0] * vector[node, 0] + n[1] * vector[node, 1] + n[2] * vector[node, 2]
                for k in range(3):
                    force[cells[piece, i], k] += share * value * across * n[k]
                    for l in range(3):
                        blocks[at, k, l] += scale * value * n[k] * n[l]
