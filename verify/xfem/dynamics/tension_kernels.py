"""What tension adds to the stiffness of a membrane across its plane.

A membrane with the stress S and stretch U in its plane (both with the same principal directions)
resists a deflection w by the force density −div(S U⁻¹ ∇w). Pairs of corners i, j of a piece are
coupled by V ∇Nᵢ·(S U⁻¹)₊ ∇Nⱼ n nᵀ. Only tension counts, ( )₊: compression makes a membrane buckle,
and a step that is to have a solution must not see that.
"""

import numpy as np
from numba import njit

__all__ = ["add_tension", "tension", "tension_product"]


@njit(cache=True)
def tension(
    cells, gradients, parent, volumes, normals, lam, mu, rotations, displacement, points, pairs,
    across,
):  # fmt: skip
    """Write the coupling of corners (p, 3, 3), in N/m, and the normal (p, 3) of each piece."""
    for piece in range(len(cells)):
        cell = parent[piece]
        g, n0, R = gradients[cell], normals[cell], rotations[piece]
        # a basis of the undeformed plane, and its image under F
        t0 = g[0] / np.sqrt((g[0] * g[0]).sum())
        t1 = np.array([
            n0[1] * t0[2] - n0[2] * t0[1], n0[2] * t0[0] - n0[0] * t0[2],
            n0[0] * t0[1] - n0[1] * t0[0],
        ])  # fmt: skip
        f0, f1 = np.zeros(3), np.zeros(3)
        for a in range(3):
            x = points[cells[piece, a]] + displacement[cells[piece, a]]
            f0 += x * (g[a] * t0).sum()
            f1 += x * (g[a] * t1).sum()
        r0, r1 = R @ t0, R @ t1
        across[piece] = R @ n0
        # U = Rᵀ F in that basis, symmetric since R is the polar rotation
        u00, u11 = (r0 * f0).sum(), (r1 * f1).sum()
        u01 = 0.5 * ((r0 * f1).sum() + (r1 * f0).sum())
        middle, half = 0.5 * (u00 + u11), 0.5 * (u00 - u11)
        radius = np.sqrt(half * half + u01 * u01)
        low, high = (
            _ratio(middle - radius, middle, lam[cell], mu[cell]),
            _ratio(middle + radius, middle, lam[cell], mu[cell]),
        )
        mean, slope = 0.5 * (high + low), 0.0
        if radius > 0.0:
            slope = 0.5 * (high - low) / radius
        s00, s11, s01 = mean + slope * half, mean - slope * half, slope * u01
        for i in range(3):
            gi0, gi1 = (g[i] * t0).sum(), (g[i] * t1).sum()
            for j in range(3):
                gj0, gj1 = (g[j] * t0).sum(), (g[j] * t1).sum()
                pairs[piece, i, j] = volumes[piece] * (
                    gi0 * (s00 * gj0 + s01 * gj1) + gi1 * (s01 * gj0 + s11 * gj1)
                )


@njit(cache=True)
def _ratio(stretch, middle, lam, mu):
    """Tension over stretch in a principal direction, zero where there is none."""
    stress = 2.0 * lam * (middle - 1.0) + 2.0 * mu * (stretch - 1.0)
    return stress / stretch if stress > 0.0 and stretch > 0.0 else 0.0


@njit(cache=True)
def add_tension(pairs, across, targets, scale, blocks):
    """Add `scale` times that stiffness to the nodal blocks (B, 3, 3)."""
    for piece in range(len(pairs)):
        n = across[piece]
        for i in range(3):
            for j in range(3):
                weight = scale * pairs[piece, i, j]
                target = targets[piece, i, j]
                for k in range(3):
                    for l in range(3):
                        blocks[target, k, l] += weight * n[k] * n[l]


@njit(cache=True)
def tension_product(pairs, across, cells, vector, scale, out):
    """Add `scale` times that stiffness times a vector (N, 3) to `out` (N, 3)."""
    for piece in range(len(pairs)):
        n = across[piece]
        for j in range(3):
            along = (n * vector[cells[piece, j]]).sum() * scale
            for i in range(3):
                out[cells[piece, i]] += pairs[piece, i, j] * along * n
