"""Masses of others: lumpings of the thesis, and masses stabilised against slivers.

**Lumpings of the thesis** (2.76–81) are diagonal in the shifted basis, where an enriched node has
the unknowns u and a. Its own side moves with u and the other one with u ± a. The kinetic energy ½
m_u u̇² + ½ m_a ȧ² is, in side-wise unknowns,

    ½ m_u v_own² + ½ m_a (v_other − v_own)²,

a 2×2 block that couples the two sides of the cut. M_ua is taken as zero, as the thesis does,
although its exact lumped value is not: that is why a separated piece gets a wrong inertia.

**Stabilised masses** raise eigenvalues of the consistent mass of a cut cell. EVS adds a share of
φφᵀ for each mode φ of a part's mass whose eigenvalue is nearly zero. GEVS raises the mass in the
modes of stiffness against mass until none is faster than the uncut cell. Sources: Eisenträger,
Radtke, Garhuom, Löhnert, Düster, Juhre, Schillinger 2023, arXiv 2310.11935; Bürchner, Radtke,
Eisenträger, Düster, Rank, Kollmannsberger, Kopp 2025, arXiv 2509.07632. Both were proposed for
finite cells of high order; here they act on the parts of linear cells, one component at a time, the
gradient's energy in the place of the stiffness. For an isotropic material that bounds the step as
the stiffness does, up to the same constant as in the uncut body. Pieces that share all dof nodes
(`PhantomMesh.part`) are one part: their sum is the element of both papers.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array, csr_array, diags_array

from verify.xfem.arrays import Floats, Ints, XfemError, check_choice
from verify.xfem.mass import (
    Mass,
    assembled_mass,
    cell_densities,
    second_moments,
    side_wise_mass,
)
from verify.xfem.phantom import PhantomMesh

_NEARLY_ZERO = 1e-3  # ε_λ: of the largest eigenvalue of the part's mass
_ADDED = 1e-3  # ε_S: likewise

ShiftedLumping = Literal["enrichment", "row sum", "weighted diagonal"]


def shifted_mass(phantom: PhantomMesh, density: ArrayLike, lumping: ShiftedLumping) -> Mass:
    """Make the mass lumped in the shifted basis, in side-wise unknowns.

    Parameters
    ----------
    phantom : PhantomMesh
        At most one cut through any element: no node has more than two unknowns.
    density : float or (m,) array_like
        In kg/m³.
    lumping : {"enrichment", "row sum", "weighted diagonal"}
        (2.80–81) after Menouillard; (2.76–77); (2.78–79) with the printed Σ_j M_ij corrected to Σ_j
        M_jj, and the mass of the second to the mass of the enrichment, Σ_ij M^aa_ij. So each keeps
        the total of the block that it lumps.

    Raises
    ------
    XfemError
        If the lumping is unknown or a node has more than two unknowns.
    """
    check_choice(lumping, ShiftedLumping, "lumping")
    if phantom.aggregation is not None:
        whole = shifted_mass(phantom.corners, density, lumping)
        found: Mass = phantom.aggregation.mass(whole)
        return found
    count, nodes = phantom.node_count, len(phantom.mesh.points)
    unknowns = np.bincount(phantom.node_parent)
    if unknowns.max() > 2:
        raise XfemError(
            f"node {int(np.argmax(unknowns))} has {unknowns.max()} unknowns; the lumpings in the "
            "shifted basis are defined for one cut per element"
        )
    side_wise = side_wise_mass(phantom, density)
    own = np.bincount(phantom.node_parent, side_wise.weights)
    enriched = _enriched_mass(phantom, density, lumping, side_wise)
    base = phantom.node_parent[nodes:]
    extra = np.arange(nodes, count)
    rows = np.concatenate([np.arange(nodes), base, base, extra, extra])
    columns = np.concatenate([np.arange(nodes), base, extra, base, extra])
    values = np.concatenate([own, enriched, -enriched, -enriched, enriched])
    matrix = csr_array(coo_array((values, (rows, columns)), shape=(count, count)))
    # v_other = v_own ± ȧ, so that M⁻¹ = T diag(1/m) Tᵀ with
    # T = [[1, 0], [1, 1]]: the sign is squared
    change = coo_array(
        (
            np.ones(count + len(extra)),
            (np.concatenate([np.arange(count), extra]), np.concatenate([np.arange(count), base])),
        ),
        shape=(count, count),
    )
    scale = diags_array(1.0 / np.sqrt(np.concatenate([own, enriched])))
    return Mass(matrix=matrix, root=csr_array(change @ scale), weights=side_wise.weights)


def _enriched_mass(
    phantom: PhantomMesh, density: ArrayLike, lumping: ShiftedLumping, side_wise: Mass
) -> Floats:
    """Compute M^aa of the nodes with a second unknown, in the order of these unknowns."""
    nodes = len(phantom.mesh.points)
    if lumping == "enrichment":
        return side_wise.weights[nodes:]
    enriched = phantom.cells >= nodes
    moments = second_moments(phantom)
    moments *= cell_densities(phantom.mesh, density)[phantom.parent][:, None, None]
    # ψ_i ψ_j is 1 where both nodes lie across the cut from the piece, and 0 elsewhere
    moments *= enriched[:, :, None] & enriched[:, None, :]
    share = moments.sum(axis=2)
    if lumping == "weighted diagonal":
        diagonal = np.einsum("pii->pi", moments)
        of_cell = len(phantom.mesh.cells)
        total = np.bincount(phantom.parent, moments.sum(axis=(1, 2)), minlength=of_cell)
        traced = np.bincount(phantom.parent, diagonal.sum(axis=1), minlength=of_cell)
        scale = np.divide(total, traced, out=np.zeros(of_cell), where=traced > 0.0)
        share = diagonal * scale[phantom.parent][:, None]
    summed = np.bincount(phantom.cells[enriched], share[enriched], minlength=phantom.node_count)
    return summed[nodes:]


def eigenvalue_stabilised_mass(phantom: PhantomMesh, density: ArrayLike) -> Mass:
    """Compute the consistent mass plus ε_S m φφᵀ for the modes of each part below ε_λ m (EVS).

    ε_S = ε_λ = 1e-3, as the paper recommends; m is the largest eigenvalue of the part's own mass,
    so that both are without units. The eigenvalue of the uncut cell would give nodes of slivers
    mass without stiffness, and the lowest frequency of the body would go to zero. Mass is added.

    Raises
    ------
    XfemError
        If cells are aggregated: there are no slivers left.
    """
    first, moments = _split_parts(phantom)
    values, modes = np.linalg.eigh(moments)
    largest = values[:, -1:]
    added = np.where(values < _NEARLY_ZERO * largest, _ADDED * largest, 0.0)
    return _raised(phantom, density, first, np.einsum("pik,pk,pjk->pij", modes, added, modes))


def generalised_eigenvalue_stabilised_mass(phantom: PhantomMesh, density: ArrayLike) -> Mass:
    """Consistent mass plus (λ/λ_max − 1) Mφ(Mφ)ᵀ for the modes of each part with λ > λ_max (GEVS).

    Kφ = λMφ with φᵀMφ = 1 and K the energy of the gradient; λ_max belongs to the uncut cell. The
    mass of each part stays, because a constant is orthogonal to these modes.

    Raises
    ------
    XfemError
        If cells are aggregated: there are no slivers left; or a part is so thin that its mass is
        singular in double precision.
    """
    first, moments = _split_parts(phantom)
    parent, count = phantom.parent[first], phantom.cells.shape[1]
    corners = phantom.mesh.points[phantom.mesh.cells[parent]]
    slopes = np.linalg.pinv(corners[:, 1:] - corners[:, :1])  # of N_1 …, by columns
    slopes = np.concatenate([-slopes.sum(axis=2, keepdims=True), slopes], axis=2)
    energy = np.einsum("pki,pkj->pij", slopes, slopes)
    whole = (np.ones((count, count)) + np.eye(count)) / (count * (count + 1))
    limit = _pencil(energy, np.broadcast_to(whole, energy.shape))[0][:, -1]
    volumes = phantom.part_fraction[first] * phantom.mesh.measures[parent]
    values, modes = _pencil(energy * volumes[:, None, None], moments)
    # the sum of Mφ is zero but for round-off, which λ of a sliver would make a mass of its own
    rows, largest = np.arange(len(modes)), np.einsum("pii->pi", moments).argmax(axis=1)
    modes[rows, largest, 1:] -= modes.sum(axis=1)[:, 1:]
    values[:, 0] = 0.0  # of the constant
    added = np.maximum(values / limit[:, None] - 1.0, 0.0)
    return _raised(phantom, density, first, np.einsum("pik,pk,pjk->pij", modes, added, modes))


def _split_parts(phantom: PhantomMesh) -> tuple[Ints, Floats]:
    """Find the first piece (q,) and moments (q, d + 1, d + 1) of each part of a split cell."""
    if phantom.aggregation is not None:
        raise XfemError("a stabilised mass of aggregated cells: they have no slivers left")
    split = np.flatnonzero(phantom.split)
    first, number = np.unique(phantom.part[split], return_inverse=True)
    moments = second_moments(phantom)[split]
    found = np.zeros((len(first), *moments.shape[1:]))
    np.add.at(found, number, moments)
    return first, found


def _raised(phantom: PhantomMesh, density: ArrayLike, first: Ints, added: Floats) -> Mass:
    """Return the consistent mass plus density times `added` for the parts of pieces `first`."""
    moments = second_moments(phantom)
    moments[first] += added
    return assembled_mass(phantom, density, moments)


def _pencil(energy: Floats, moments: Floats) -> tuple[Floats, Floats]:
    """Compute the eigenvalues λ (p, k), ascending, and Mφ (p, i, k) of Kφ = λMφ.

    Scaled to a unit diagonal, the moments of a sliver are as regular as of a whole cell.
    """
    scale = np.sqrt(np.einsum("pii->pi", moments))
    try:
        factor = np.linalg.cholesky(moments / (scale[:, :, None] * scale[:, None, :]))
    except np.linalg.LinAlgError:
        raise XfemError(
            "a part of a cell too thin for the modes of its mass; expected another mass, e.g. 'evs'"
        ) from None
    inner = np.linalg.solve(factor, energy / (scale[:, :, None] * scale[:, None, :]))
    values, modes = np.linalg.eigh(np.linalg.solve(factor, inner.swapaxes(1, 2)))
    return values, scale[:, :, None] * (factor @ modes)
