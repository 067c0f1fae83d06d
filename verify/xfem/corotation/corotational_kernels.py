"""Compiled loops of corotational elasticity over the pieces of a cut body.

With b_i the material gradient of shape function i, w the volume of a piece, R its rotation and
g_i = R b_i, the force f_i = w R (2μE + λ tr(E) I) b_i, E = Rᵀ F − I, is the gradient of
w (μ‖E‖² + ½λ tr² E). The stiffness with frozen rotations is that of linear elasticity in the g_i;
`spin_stiffness_kernels` has what the exact one adds.

A membrane is the same with F and I restricted to its tangent plane. The loops are compiled once
for the plane and once for space, so that the innermost ones have a constant length; that over the
corners of an element need not.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import numpy as np
from numba import njit

from verify.xfem.corotation.polar_kernels import (
    mend_lane,
    new_lanes,
    rotation_in_plane,
    rotation_matrix,
    turn_lanes,
)
from verify.xfem.corotation.spin_stiffness_kernels import add_spin_stiffness, turned_normal
from verify.xfem.lanes.vectors import LANES

__all__ = ["corotational_kernels"]


@njit(cache=True)
def _project(D, n):
    """Take from D what points across the turned plane of a membrane: nothing resists there."""
    for l in range(3):
        across = 0.0
        for k in range(3):
            across += n[k] * D[k, l]
        for k in range(3):
            D[k, l] -= n[k] * across


@njit(cache=True)
def _turn_in_plane(cells, gradients, parent, normals, displacement, quaternions, rotations):
    """Update the rotations (p, 2, 2); normals and quaternions are of bodies in space."""
    F = np.empty((2, 2))
    for piece in range(len(cells)):
        cell = parent[piece]
        for k in range(2):
            for l in range(2):
                F[k, l] = 1.0 if k == l else 0.0
                for i in range(3):
                    F[k, l] += displacement[cells[piece, i], k] * gradients[cell, i, l]
        rotation_in_plane(F, rotations[piece])


@njit(cache=True)
def _turn_in_space(cells, gradients, parent, normals, displacement, quaternions, rotations):
    """Update the rotations (p, 3, 3) of a solid or a membrane, and their quaternions (p, 4)."""
    F, lanes = np.empty((3, 3)), new_lanes()
    corners = cells.shape[1]
    for start in range(0, len(cells), LANES):
        count = min(LANES, len(cells) - start)
        for lane in range(count):
            piece = start + lane
            cell = parent[piece]
            for k in range(3):
                for l in range(3):
                    F[k, l] = 1.0 if k == l else 0.0
                    if corners == 3:
                        F[k, l] -= normals[cell, k] * normals[cell, l]
            for i in range(corners):
                node = cells[piece, i]
                for k in range(3):
                    for l in range(3):
                        F[k, l] += displacement[node, k] * gradients[cell, i, l]
            for k in range(3):
                for l in range(3):
                    lanes[(3 * k + l) * LANES + lane] = F[k, l]
            for k in range(4):
                lanes[(9 + k) * LANES + lane] = quaternions[piece, k]
        if not turn_lanes(lanes):
            for lane in range(count):
                mend_lane(lanes, lane)
        for lane in range(count):
            piece = start + lane
            for k in range(4):
                quaternions[piece, k] = lanes[(9 + k) * LANES + lane]
            rotation_matrix(quaternions[piece], rotations[piece])


def _internal_force(space: int) -> Any:
    # the loops below are made for each space, so that innermost ones have a constant length
    @njit(cache=True)
    def internal_force(
        cells, gradients, parent, volumes, normals, lam, mu, rotations, displacement, force
    ):
        """Add f_int(u) to `force`; return the energy.

        Parameters
        ----------
        cells : (p, c) int array
        gradients : (m, c, d) float array
        parent, volumes : (p,) arrays
        normals : (m, 3) float array
            Unit normals of membranes; not read otherwise.
        lam, mu : (m,) float array
        rotations : (p, d, d) float array
        displacement, force : (N, d) float array
        """
        F = np.empty((space, space))
        E = np.empty((space, space))
        corners = 3 if space == 2 else cells.shape[1]
        membrane = space == 3 and corners == 3
        energy = 0.0
        for piece in range(len(cells)):
            cell = parent[piece]
            R = rotations[piece]
            for k in range(space):
                for l in range(space):
                    F[k, l] = 1.0 if k == l else 0.0
                    if membrane:
                        F[k, l] -= normals[cell, k] * normals[cell, l]
                    E[k, l] = -F[k, l]
            for i in range(corners):
                node = cells[piece, i]
                for k in range(space):
                    for l in range(space):
                        F[k, l] += displacement[node, k] * gradients[cell, i, l]
            for k in range(space):
                for l in range(space):
                    for m in range(space):
                        E[k, l] += R[m, k] * F[m, l]
            trace = square = 0.0
            for k in range(space):
                trace += E[k, k]
                for l in range(k + 1, space):
                    E[k, l] = E[l, k] = 0.5 * (E[k, l] + E[l, k])
            for k in range(space):
                for l in range(space):
                    square += E[k, l] * E[k, l]
            w, la, m2 = volumes[piece], lam[cell], 2.0 * mu[cell]
            energy += 0.5 * w * (m2 * square + la * trace * trace)
            # stress w R (2μE + λ tr E I), over F
            for k in range(space):
                for l in range(space):
                    total = la * trace * R[k, l]
                    for m in range(space):
                        total += m2 * R[k, m] * E[m, l]
                    F[k, l] = w * total
            for i in range(corners):
                node = cells[piece, i]
                for k in range(space):
                    total = 0.0
                    for l in range(space):
                        total += F[k, l] * gradients[cell, i, l]
                    force[node, k] += total
        return energy

    return internal_force


def _frozen_product(space: int) -> Any:
    @njit(cache=True)
    def frozen_product(
        cells, gradients, parent, volumes, normals, lam, mu, rotations, vector, scale, product
    ):
        """Add `scale` times the stiffness with frozen rotations times `vector` to `product`."""
        corners = 3 if space == 2 else cells.shape[1]
        membrane = space == 3 and corners == 3
        n = np.empty(3)
        D = np.empty((space, space))
        E = np.empty((space, space))
        for piece in range(len(cells)):
            cell = parent[piece]
            R = rotations[piece]
            for k in range(space):
                for l in range(space):
                    D[k, l] = 0.0
                    E[k, l] = 0.0
            for i in range(corners):
                node = cells[piece, i]
                for k in range(space):
                    for l in range(space):
                        D[k, l] += vector[node, k] * gradients[cell, i, l]
            if membrane:
                turned_normal(R, normals, cell, n)
                _project(D, n)
            for k in range(space):
                for l in range(space):
                    for m in range(space):
                        E[k, l] += R[m, k] * D[m, l]
            trace = 0.0
            for k in range(space):
                trace += E[k, k]
                for l in range(k + 1, space):
                    E[k, l] = E[l, k] = 0.5 * (E[k, l] + E[l, k])
            w = scale * volumes[piece]
            wl, wm = w * lam[cell] * trace, 2.0 * w * mu[cell]
            for k in range(space):
                for l in range(space):
                    total = wl * R[k, l]
                    for m in range(space):
                        total += wm * R[k, m] * E[m, l]
                    D[k, l] = total
            for i in range(corners):
                node = cells[piece, i]
                for k in range(space):
                    total = 0.0
                    for l in range(space):
                        total += D[k, l] * gradients[cell, i, l]
                    product[node, k] += total

    return frozen_product


def _add_frozen_stiffness(space: int) -> Any:
    @njit(cache=True)
    def add_frozen_stiffness(
        targets, gradients, parent, volumes, normals, lam, mu, rotations, scale, blocks
    ):
        """Add `scale` times the stiffness with frozen rotations to the nodal blocks."""
        corners = 3 if space == 2 else targets.shape[1]
        membrane = space == 3 and corners == 3
        n = np.empty(3)
        g = np.empty((corners, space))
        T = np.empty((space, space))
        for piece in range(len(targets)):
            cell = parent[piece]
            R = rotations[piece]
            wl = scale * volumes[piece] * lam[cell]
            wm = scale * volumes[piece] * mu[cell]
            for i in range(corners):
                for k in range(space):
                    total = 0.0
                    for l in range(space):
                        total += R[k, l] * gradients[cell, i, l]
                    g[i, k] = total
            for k in range(space):
                for l in range(space):
                    T[k, l] = wm if k == l else 0.0
            if membrane:
                turned_normal(R, normals, cell, n)
                for k in range(space):
                    for l in range(space):
                        T[k, l] -= wm * n[k] * n[l]
            for i in range(corners):
                for j in range(i, corners):
                    dot = 0.0
                    for k in range(space):
                        dot += g[i, k] * g[j, k]
                    upper = targets[piece, i, j]
                    lower = targets[piece, j, i]
                    for k in range(space):
                        for l in range(space):
                            value = wl * g[i, k] * g[j, l] + wm * g[j, k] * g[i, l]
                            value += dot * T[k, l]
                            blocks[upper, k, l] += value
                            if i != j:
                                blocks[lower, l, k] += value

    return add_frozen_stiffness


@cache
def corotational_kernels(space: int) -> SimpleNamespace:
    """Loops for the plane or for space.

    Returns
    -------
    SimpleNamespace
        ``turn``, ``internal_force``, ``frozen_product``, ``add_frozen_stiffness``,
        ``add_spin_stiffness``.
    """
    return SimpleNamespace(
        turn=_turn_in_plane if space == 2 else _turn_in_space,
        internal_force=_internal_force(space),
        frozen_product=_frozen_product(space),
        add_frozen_stiffness=_add_frozen_stiffness(space),
        add_spin_stiffness=add_spin_stiffness(space),
    )
