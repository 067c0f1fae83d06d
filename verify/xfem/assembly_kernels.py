"""Compiled loops over virtual cells: stiffness into its place, and forces without a matrix.

With b_i the gradient of shape function i and w the volume of the piece,
K_ij = w (λ b_i b_jᵀ + μ b_j b_iᵀ + μ (b_i·b_j) P), the same for every dimension. P is the identity,
or for a membrane with unit normal n the projection I − n nᵀ on its plane.
"""

import numpy as np
from numba import njit

__all__ = ["add_stiffness", "constrain", "linear_force"]

_ROUND_OFF = 1e-14  # of the largest diagonal entry of a node


@njit(cache=True)
def add_stiffness(targets, gradients, normals, parent, volumes, lam, mu, blocks):
    """Add the stiffness of all pieces to `blocks` (B, d, d).

    Parameters
    ----------
    targets : (p, c, c) int array
    gradients : (m, c, d) float array
        Of the cells of the uncut mesh, in 1/m.
    normals : (m, d) float array
        Unit normals of membrane cells; one row of zeros for all cells of a solid.
    parent : (p,) int array
    volumes : (p,) float array
        Volumes of the pieces.
    lam, mu : (m,) float array
        Lamé parameters of the cells of the uncut mesh.
    blocks : (B, d, d) float array
        Added to.
    """
    count, corners, _ = targets.shape
    dim = gradients.shape[2]
    if corners == 4:
        _add_stiffness_of_tetrahedra(targets, gradients, parent, volumes, lam, mu, blocks)
        return
    for piece in range(count):
        cell = parent[piece]
        b = gradients[cell]
        n = normals[cell if len(normals) > 1 else 0]
        wl = volumes[piece] * lam[cell]
        wm = volumes[piece] * mu[cell]
        for i in range(corners):
            for j in range(i, corners):
                dot = 0.0
                for k in range(dim):
                    dot += b[i, k] * b[j, k]
                upper = blocks[targets[piece, i, j]]
                lower = blocks[targets[piece, j, i]]
                for k in range(dim):
                    for l in range(dim):
                        value = wl * b[i, k] * b[j, l] + wm * b[j, k] * b[i, l]
                        if k == l:
                            value += wm * dot
                        value -= wm * dot * n[k] * n[l]
                        upper[k, l] += value
                        if i != j:
                            lower[l, k] += value


@njit(cache=True)
def _add_stiffness_of_tetrahedra(targets, gradients, parent, volumes, lam, mu, blocks):
    """Do the same with every length known to the compiler: half of the time."""
    for piece in range(len(targets)):
        cell = parent[piece]
        wl = volumes[piece] * lam[cell]
        wm = volumes[piece] * mu[cell]
        for i in range(4):
            x, y, z = gradients[cell, i, 0], gradients[cell, i, 1], gradients[cell, i, 2]
            for j in range(i, 4):
                u, v, w = gradients[cell, j, 0], gradients[cell, j, 1], gradients[cell, j, 2]
                dot = wm * (x * u + y * v + z * w)
                xx, yy, zz = (
                    (wl + wm) * x * u + dot,
                    (wl + wm) * y * v + dot,
                    (wl + wm) * z * w + dot,
                )
                xy, yx = wl * x * v + wm * u * y, wl * y * u + wm * v * x
                xz, zx = wl * x * w + wm * u * z, wl * z * u + wm * w * x
                yz, zy = wl * y * w + wm * v * z, wl * z * v + wm * w * y
                at = targets[piece, i, j]
                blocks[at, 0, 0] += xx
                blocks[at, 0, 1] += xy
                blocks[at, 0, 2] += xz
                blocks[at, 1, 0] += yx
                blocks[at, 1, 1] += yy
                blocks[at, 1, 2] += yz
                blocks[at, 2, 0] += zx
                blocks[at, 2, 1] += zy
                blocks[at, 2, 2] += zz
                if i != j:
                    at = targets[piece, j, i]
                    blocks[at, 0, 0] += xx
                    blocks[at, 1, 0] += xy
                    blocks[at, 2, 0] += xz
                    blocks[at, 0, 1] += yx
                    blocks[at, 1, 1] += yy
                    blocks[at, 2, 1] += yz
                    blocks[at, 0, 2] += zx
                    blocks[at, 1, 2] += zy
                    blocks[at, 2, 2] += zz


@njit(cache=True)
def linear_force(cells, gradients, normals, parent, volumes, lam, mu, displacement, force):
    """Add the internal force K u (N, d) of the displacement (N, d) to `force`; return ½ uᵀKu."""
    count, corners = cells.shape
    dim = gradients.shape[2]
    gradient = np.empty((dim, dim))
    stress = np.empty((dim, dim))
    energy = 0.0
    for piece in range(count):
        cell = parent[piece]
        b = gradients[cell]
        n = normals[cell if len(normals) > 1 else 0]
        gradient[:] = 0.0
        for i in range(corners):
            u = displacement[cells[piece, i]]
            for k in range(dim):
                for l in range(dim):
                    gradient[k, l] += u[k] * b[i, l]
        for l in range(dim):
            across = 0.0
            for k in range(dim):
                across += n[k] * gradient[k, l]
            for k in range(dim):
                gradient[k, l] -= n[k] * across
        trace = 0.0
        for k in range(dim):
            trace += gradient[k, k]
        density = 0.0
        for k in range(dim):
            for l in range(dim):
                stress[k, l] = mu[cell] * (gradient[k, l] + gradient[l, k])
            stress[k, k] += lam[cell] * trace
        for k in range(dim):
            for l in range(dim):
                density += 0.5 * stress[k, l] * gradient[k, l]
        energy += volumes[piece] * density
        for i in range(corners):
            f = force[cells[piece, i]]
            for k in range(dim):
                total = 0.0
                for l in range(dim):
                    total += stress[k, l] * b[i, l]
                f[k] += volumes[piece] * total
    return energy


@njit(cache=True)
def constrain(starts, columns, fixed, blocks):
    """Decouple the fixed components: zero their rows and columns but for the diagonal.

    Parameters
    ----------
    starts, columns : int arrays
        Pattern of the blocks.
    fixed : (N, d) bool array
    blocks : (B, d, d) float array
        Changed in place; the diagonal entries stay, so that scaling stays meaningful, but for
        those that are not positive (zero or its round-off across a flat membrane, less than that
        across a compressed one), which become one.
    """
    dim = fixed.shape[1]
    constrained = np.zeros(len(fixed), dtype=np.bool_)
    for node in range(len(fixed)):
        for k in range(dim):
            constrained[node] |= fixed[node, k]
    for row in range(len(starts) - 1):
        for at in range(starts[row], starts[row + 1]):
            column = columns[at]
            if not (constrained[row] or constrained[column]):
                continue
            least = 0.0
            if row == column:
                for k in range(dim):
                    least = max(least, _ROUND_OFF * blocks[at, k, k])
            for k in range(dim):
                for l in range(dim):
                    if (fixed[row, k] or fixed[column, l]) and not (row == column and k == l):
                        blocks[at, k, l] = 0.0
                    elif row == column and k == l and fixed[row, k] and blocks[at, k, k] <= least:
                        blocks[at, k, k] = 1.0
