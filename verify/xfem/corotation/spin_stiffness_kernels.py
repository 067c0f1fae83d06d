"""Rotational part of the exact tangent of corotational elasticity.

With b_i the material gradient of shape function i, R the rotation of a piece and g_i = R b_i, it is
[g_i]ₓᵀ H [g_j]ₓ times the volume, H = μI + (λ tr E − 2μ)(tr(V) I − V)⁻¹, V = R Uᵀ Rᵀ.
"""

from typing import Any

import numpy as np
from numba import njit

__all__ = ["SINGULAR", "add_spin_stiffness", "turned_normal"]

SINGULAR = 1e-8  # of the trace of the stretch: a spin without stiffness of its own


@njit(cache=True)
def _deformation(nodes, b, displacement, normals, cell, F):
    """Write the deformation gradient of a piece."""
    space = F.shape[0]
    for k in range(space):
        for l in range(space):
            F[k, l] = 1.0 if k == l else 0.0
            if len(nodes) == space:
                F[k, l] -= normals[cell, k] * normals[cell, l]
    for i in range(len(nodes)):
        node = nodes[i]
        for k in range(space):
            for l in range(space):
                F[k, l] += displacement[node, k] * b[i, l]


@njit(cache=True)
def turned_normal(R, normals, cell, n):
    """Write the normal of a turned membrane to n (3,)."""
    for k in range(3):
        n[k] = 0.0
        for l in range(3):
            n[k] += R[k, l] * normals[cell, l]


@njit(cache=True)
def _spin_row(g, out):
    """Write the matrix of u ↦ g × u: (1, 2) in the plane, (3, 3) in space."""
    if len(g) == 2:
        out[0, 0], out[0, 1] = -g[1], g[0]
    else:
        out[:] = 0.0
        out[0, 1], out[0, 2], out[1, 2] = -g[2], g[1], -g[0]
        out[1, 0], out[2, 0], out[2, 1] = g[2], -g[1], g[0]


@njit(cache=True)
def _spin_stiffness(V, lam_trace, mu, H):
    """Write H (1, 1) or (3, 3); without the inverse, and False, where that does not exist."""
    trace = 0.0
    for k in range(V.shape[0]):
        trace += V[k, k]
    factor = lam_trace - 2.0 * mu
    if V.shape[0] == 2:
        regular = trace > 0.0
        H[0, 0] = mu + factor / trace if regular else 0.0
        return regular
    a, b, c = trace - V[0, 0], trace - V[1, 1], trace - V[2, 2]
    d = -0.5 * (V[0, 1] + V[1, 0])
    e = -0.5 * (V[0, 2] + V[2, 0])
    f = -0.5 * (V[1, 2] + V[2, 1])
    determinant = a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e)
    if not determinant > SINGULAR * abs(trace) ** 3:
        H[:] = 0.0
        return False
    scale = factor / determinant
    H[0, 0] = mu + scale * (b * c - f * f)
    H[1, 1] = mu + scale * (a * c - e * e)
    H[2, 2] = mu + scale * (a * b - d * d)
    H[0, 1] = H[1, 0] = scale * (e * f - d * c)
    H[0, 2] = H[2, 0] = scale * (d * f - b * e)
    H[1, 2] = H[2, 1] = scale * (d * e - a * f)
    return True


def add_spin_stiffness(space: int) -> Any:
    """Make the loop for the plane or for space, so that innermost ones have a constant length."""
    spins = 1 if space == 2 else 3

    @njit(cache=True)
    def add(
        cells, targets, gradients, parent, volumes, normals, lam, mu, rotations, displacement,
        scale, blocks,
    ):  # fmt: skip
        """Add what the exact stiffness has beyond the frozen one; return the pieces left out.

        A piece is left out where its rotation is not differentiable (tr(V) I − V singular).
        """
        corners = 3 if space == 2 else cells.shape[1]
        membrane = space == 3 and corners == 3
        n = np.empty(3)
        F = np.empty((space, space))
        V = np.empty((space, space))
        g = np.empty((corners, space))
        H = np.empty((spins, spins))
        X = np.empty((corners, spins, space))
        Y = np.empty((corners, spins, space))
        left_out = 0
        for piece in range(len(cells)):
            cell = parent[piece]
            R = rotations[piece]
            _deformation(cells[piece], gradients[cell], displacement, normals, cell, F)
            for i in range(corners):
                for k in range(space):
                    g[i, k] = 0.0
                    for l in range(space):
                        g[i, k] += R[k, l] * gradients[cell, i, l]
                _spin_row(g[i], X[i])
            trace = 1.0 - corners
            for k in range(space):
                for l in range(space):
                    V[k, l] = 0.0
                    for m in range(space):
                        V[k, l] += F[k, m] * R[l, m]
                trace += V[k, k]
            if not _spin_stiffness(V, lam[cell] * trace, mu[cell], H):
                left_out += 1
                continue
            w = scale * volumes[piece]
            for j in range(corners):
                for a in range(spins):
                    for l in range(space):
                        Y[j, a, l] = 0.0
                        for b in range(spins):
                            Y[j, a, l] += w * H[a, b] * X[j, b, l]
            if membrane:
                turned_normal(R, normals, cell, n)
            for i in range(corners):
                for j in range(corners):
                    at = targets[piece, i, j]
                    dot = 0.0
                    if membrane:
                        for k in range(space):
                            dot += w * mu[cell] * g[i, k] * g[j, k]
                    for k in range(space):
                        for l in range(space):
                            total = dot * n[k] * n[l] if membrane else 0.0
                            for a in range(spins):
                                total += X[i, a, k] * Y[j, a, l]
                            blocks[at, k, l] += total
        return left_out

    return add
