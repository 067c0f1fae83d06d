"""Other bases of the same space: shifted and plain Heaviside enrichment, for one cut per cell.

Unknowns q stack u of all mesh nodes over a of the enriched ones. With H = ±1 above and below the
cut, the shifted basis (2.48) is u = Σ N_i u_i + Σ N_j ½(H − H_j) a_j and the plain one is
u = Σ N_i u_i + Σ N_j H a_j. Both are linear changes of the side-wise unknowns p = T q.
"""

from typing import Literal

import numpy as np
from scipy.sparse import csc_array, csr_array, identity, kron
from scipy.sparse.linalg import splu

from verify.xfem.arrays import Floats, Ints, check_choice
from verify.xfem.errors import BasisError, XfemError
from verify.xfem.phantom import PhantomMesh

Basis = Literal["shifted", "heaviside"]


def transformation(phantom: PhantomMesh, basis: Basis) -> csr_array:
    """T (N, n + enriched) of p = T q, the same for each component of the displacement.

    Raises
    ------
    XfemError
        If the basis is unknown.
    BasisError
        If a node has more than two unknowns, or two that no single cut separates: there the
        side-wise unknowns are the only ones.
    """
    check_choice(basis, Basis, "basis")
    own, other, sign = _pairs(phantom)
    nodes, count = len(phantom.mesh.points), len(own)
    extra = nodes + np.arange(count)
    everywhere = np.arange(nodes)
    if basis == "shifted":
        # p_own = u_j; the other side differs by a, counted from below to above
        rows = np.concatenate([everywhere, other, other])
        columns = np.concatenate([everywhere, own, extra])
        values = np.concatenate([np.ones(nodes + count), -sign])
    else:
        rows = np.concatenate([everywhere, own, other, other])
        columns = np.concatenate([everywhere, extra, own, extra])
        values = np.concatenate([np.ones(nodes), sign, np.ones(count), -sign])
    return csr_array((values, (rows, columns)), shape=(phantom.node_count, nodes + count))


def sidewise_from(phantom: PhantomMesh, basis: Basis, unknowns: Floats) -> Floats:
    """Side-wise displacement (N, d) from the unknowns (n + enriched, d) of another basis."""
    T = transformation(phantom, basis)
    _check_count(unknowns, T.shape[1], "unknowns")
    return np.asarray(T @ unknowns)


def from_sidewise(phantom: PhantomMesh, basis: Basis, displacement: Floats) -> Floats:
    """Unknowns (n + enriched, d) of another basis from the side-wise displacement (N, d)."""
    _check_count(displacement, phantom.node_count, "displacements")
    return np.asarray(splu(csc_array(transformation(phantom, basis))).solve(displacement))


def transformed_matrix(phantom: PhantomMesh, basis: Basis, matrix: csr_array) -> csr_array:
    """Tᵀ K T for a matrix (N·d, N·d) with d components per node."""
    dim = matrix.shape[0] // phantom.node_count
    full = kron(transformation(phantom, basis), identity(dim), format="csr")
    return csr_array(full.T @ matrix @ full)


def _check_count(values: Floats, count: int, what: str) -> None:
    if np.ndim(values) == 0 or len(values) != count:
        raise XfemError(f"{what} of shape {np.shape(values)}; expected ({count}, d)")


def _pairs(phantom: PhantomMesh) -> tuple[Ints, Ints, Floats]:
    """Enriched nodes: the unknown on the node's own side, the other, and H of the node."""
    counts = np.bincount(phantom.node_parent)
    if (counts > 2).any():
        raise BasisError(
            f"node {int(np.argmax(counts > 2))} has {counts.max()} unknowns; the shifted and "
            "Heaviside bases need one cut per element, use the side-wise one"
        )
    own = phantom.enriched_nodes
    place = np.full(len(counts), -1)
    place[phantom.node_parent[len(counts) :]] = np.arange(len(counts), phantom.node_count)
    other = place[own]
    apart = phantom.node_side[own] != phantom.node_side[other]
    if not (apart.sum(axis=1) == 1).all():
        at = own[int(np.argmax(apart.sum(axis=1) != 1))]
        raise BasisError(f"no single cut separates the two unknowns of node {at}")
    if not len(own):  # nothing is cut
        return own, other, np.zeros(0)
    cut = apart.argmax(axis=1)
    return own, other, phantom.node_side[own, cut].astype(float)
