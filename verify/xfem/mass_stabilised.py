"""Masses of others against slivers: eigenvalues of the consistent mass of a cut cell are raised.

EVS (Eisenträger, Radtke, Garhuom, Löhnert, Düster, Juhre, Schillinger 2023, arXiv 2310.11935) adds
a share of φφᵀ for each mode φ of a part's mass whose eigenvalue is nearly zero. GEVS (Bürchner,
Radtke, Eisenträger, Düster, Rank, Kollmannsberger, Kopp 2025, arXiv 2509.07632) raises the mass in
the modes of stiffness against mass until none is faster than the uncut cell. Both were proposed
for finite cells of high order; here they act on the parts of linear cells, one component at a
time, the gradient's energy in the place of the stiffness. For an isotropic material that bounds
the step as the stiffness does, up to the same constant as in the uncut body. Pieces that share all
dof nodes (`PhantomMesh.part`) are one part: what both papers call the element is their sum.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.xfem.errors import XfemError
from verify.xfem.mass import Mass, assembled_mass, second_moments
from verify.xfem.phantom import PhantomMesh

__all__ = ["eigenvalue_stabilised_mass", "generalised_eigenvalue_stabilised_mass"]

_NEARLY_ZERO = 1e-3  # ε_λ: of the largest eigenvalue of the part's mass
_ADDED = 1e-3  # ε_S: likewise
_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


def eigenvalue_stabilised_mass(phantom: PhantomMesh, density: ArrayLike) -> Mass:
    """Consistent mass plus ε_S m φφᵀ for the modes of each part below ε_λ m (EVS).

    ε_S = ε_λ = 1e-3, as the paper recommends; m is the largest eigenvalue of the part's own mass,
    so that both are without units. At that of the uncut cell the nodes of slivers would have mass
    that nothing holds, and the lowest frequency of the body would go to zero. Mass is added.

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

    Kφ = λMφ with φᵀMφ = 1 and K the energy of the gradient; λ_max is that of the uncut cell. The
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


def _split_parts(phantom: PhantomMesh) -> tuple[_Ints, _Floats]:
    """First piece (q,) and moments (q, d + 1, d + 1) of each part of a split cell."""
    if phantom.aggregation is not None:
        raise XfemError("a stabilised mass of aggregated cells: they have no slivers left")
    split = np.flatnonzero(phantom.split)
    first, number = np.unique(phantom.part[split], return_inverse=True)
    moments = second_moments(phantom)[split]
    found = np.zeros((len(first), *moments.shape[1:]))
    np.add.at(found, number, moments)
    return first, found


def _raised(phantom: PhantomMesh, density: ArrayLike, first: _Ints, added: _Floats) -> Mass:
    """Return the consistent mass plus density times `added` for the parts of pieces `first`."""
    moments = second_moments(phantom)
    moments[first] += added
    return assembled_mass(phantom, density, moments)


def _pencil(energy: _Floats, moments: _Floats) -> tuple[_Floats, _Floats]:
    """Eigenvalues λ (p, k), ascending, and Mφ (p, i, k) of Kφ = λMφ.

    Scaled to a unit diagonal, the moments of a sliver are as regular as those of a cell.
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
