"""K^uu, K^ua and K^aa written out as in the thesis (2.58–2.64), with its signs put right.

An independent way to the stiffness of the shifted basis: from nodal signs and volume fractions
only, without cut-cell parts. For checks; dense loops, one cut.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.element import Material
from verify.xfem.mesh import SimplexMesh

_Floats = NDArray[np.float64]


def transformation(phantom, basis="shifted") -> _Floats:
    """T (N, n + enriched) of p = T q, for one cut: side-wise p from q, u over a of an enrichment.

    With H = ±1 above and below the cut, the shifted basis (2.48) is
    u = Σ N_i u_i + Σ N_j ½(H − H_j) a_j and the plain one is u = Σ N_i u_i + Σ N_j H a_j.
    """
    count, own = len(phantom.mesh.points), phantom.enriched_nodes
    place = np.zeros(count, dtype=np.int64)
    place[phantom.node_parent[count:]] = np.arange(count, phantom.node_count)
    other, extra, sign = place[own], count + np.arange(len(own)), phantom.node_side[own, 0]
    T = np.eye(phantom.node_count, count + len(own))
    T[other, extra] = 0.0
    T[other, own] = 1.0
    # p_own = u_j (plain: ± a more); the other side differs, counted from below to above
    T[other, extra] = -sign
    if basis == "heaviside":
        T[own, extra] = sign
    return T


def transformed_matrix(phantom, basis, matrix) -> _Floats:
    """Tᵀ K T, dense, for a matrix with d components per node."""
    full = np.kron(transformation(phantom, basis), np.eye(matrix.shape[0] // phantom.node_count))
    return np.asarray(full.T @ (matrix @ full))


def shifted_stiffness(
    mesh: SimplexMesh,
    material: Material,
    node_sign: NDArray[np.int8],
    above: _Floats,
    enriched: NDArray[np.int64],
    split: NDArray[np.bool_],
    sign_of_kaa: float = 1.0,
) -> _Floats:
    """Dense stiffness ((n + enriched)·d) squared in the unknowns (u, a) of the shifted basis.

    Parameters
    ----------
    mesh : SimplexMesh
    material : Material
    node_sign : (n,) int array
        H_j = ±1.
    above : (m,) float array
        V_a/V of each cell.
    enriched : (k,) int array
        Enriched nodes.
    split : (m,) bool array
        Cells that the cut goes through; in the others ψ vanishes.
    sign_of_kaa : float
        −1 gives K^aa with the sign printed in (2.64), which makes the matrix indefinite: the
        negative control.
    """
    dim, nodes = mesh.dim, len(mesh.points)
    number = np.full(nodes, -1)
    number[enriched] = nodes + np.arange(len(enriched))
    size = nodes + len(enriched)
    stiffness = np.zeros((size, dim, size, dim))
    lam = np.broadcast_to(material.lam, len(mesh.cells))
    mu = np.broadcast_to(material.mu, len(mesh.cells))
    for cell, corners in enumerate(mesh.cells):
        b, volume = mesh.gradients[cell], mesh.measures[cell]
        K = volume * (
            lam[cell] * np.einsum("ik,jl->ikjl", b, b)
            + mu[cell] * np.einsum("jk,il->ikjl", b, b)
            + mu[cell] * np.einsum("im,jm,kl->ikjl", b, b, np.eye(dim))
        )
        va, vb = above[cell], 1.0 - above[cell]
        for i, node in enumerate(corners):
            for j, other in enumerate(corners):
                stiffness[node, :, other] += K[i, :, j]
                if not split[cell] or number[other] < 0:
                    continue
                # (2.62–2.63): ψ_j is −1 below where H_j = +1, and +1 above where H_j = −1
                ua = (-vb if node_sign[other] > 0 else va) * K[i, :, j]
                stiffness[node, :, number[other]] += ua
                stiffness[number[other], :, node] += ua.T
                if number[node] >= 0 and node_sign[node] == node_sign[other]:
                    aa = (vb if node_sign[node] > 0 else va) * K[i, :, j]
                    stiffness[number[node], :, number[other]] += sign_of_kaa * aa
    return stiffness.reshape(size * dim, size * dim)
