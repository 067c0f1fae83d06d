"""The mass lumpings of the thesis (2.76–81), which are diagonal in the shifted basis.

In that basis an enriched node has the unknowns u and a. Its own side moves with u and the other
one with u ± a, so a kinetic energy ½ m_u u̇² + ½ m_a ȧ² is, in side-wise unknowns,

    ½ m_u v_own² + ½ m_a (v_other − v_own)²,

a 2×2 block that couples the two sides of the cut. M_ua is taken as zero, as the thesis does,
although its exact lumped value is not: that is why a separated piece gets a wrong inertia.
"""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array, csr_array, diags_array

from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_choice
from verify.xfem.mass import AggregatedMass, Mass, cell_densities, second_moments, side_wise_mass
from verify.xfem.phantom import PhantomMesh

__all__ = ["ShiftedLumping", "shifted_mass"]

ShiftedLumping = Literal["enrichment", "row sum", "weighted diagonal"]


def shifted_mass(phantom: PhantomMesh, density: ArrayLike, lumping: ShiftedLumping) -> Mass:
    """Mass lumped in the shifted basis, in side-wise unknowns.

    Parameters
    ----------
    phantom : PhantomMesh
        At most one cut through any element: no node has more than two unknowns.
    density : float or (m,) array_like
        In kg/m³.
    lumping : {"enrichment", "row sum", "weighted diagonal"}
        (2.80–81) after Menouillard; (2.76–77); (2.78–79) with the printed Σ_j M_ij corrected to
        Σ_j M_jj, and the mass of the second to that of the enrichment, Σ_ij M^aa_ij, so that
        either keeps the total of the block that it lumps.

    Raises
    ------
    XfemError
        If the lumping is unknown or a node has more than two unknowns.
    """
    check_choice(lumping, ShiftedLumping, "lumping")
    if phantom.aggregation is not None:
        whole = shifted_mass(phantom.corners, density, lumping)
        return AggregatedMass.of(whole, phantom.aggregation)
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
    # v_other = v_own ± ȧ, so that M⁻¹ = T diag(1/m) Tᵀ with T = [[1, 0], [1, 1]]
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
) -> NDArray[np.float64]:
    """M^aa of the nodes with a second unknown, in the order of these unknowns."""
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
