"""Mass of a cut body, as a scalar matrix on dof nodes (the same for every component).

Side-wise lumping gives each dof node its share ρ V_piece/(d + 1) of the pieces around it. It is
diagonal and conserves the mass of every piece exactly. With it the smallest step of the uncut
elements is stable, however small the pieces. The consistent mass integrates shape functions
exactly. `verify.methods.mass_variants` has others: the lumpings that the thesis compares, and
masses stabilised against slivers.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csr_array

from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    SingularStiffnessError,
    XfemError,
    finite_array,
)
from verify.xfem.block_pattern import BlockPattern, body_pattern, find_places, pattern_places
from verify.xfem.linear_solvers import scaled_inverse
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh

_DIGITS = 1e-3  # of an acceleration, that its mass must give back


@dataclass(frozen=True)
class Mass:
    """A symmetric positive definite mass matrix.

    Attributes
    ----------
    matrix : (N, N) csr_array
        In kilograms (per metre of thickness in 2D).
    root : (N, N) csr_array or None
        L with M⁻¹ = L Lᵀ where it is known in closed form.
    weights : (N,) float array
        Physical mass that belongs to each unknown: what gravity pulls at. For the lumpings of
        the thesis it differs from the row sums of the matrix, which is their defect.
    sparsity : BlockPattern, optional
        Of the body, where the matrix has its rows and columns.
    """

    matrix: csr_array
    root: csr_array | None
    weights: Floats
    sparsity: BlockPattern | None = field(default=None, kw_only=True)

    @cached_property
    def diagonal(self) -> Floats | None:
        """(N,) the diagonal if the matrix is one, else None."""
        rows, columns, _ = self.entries
        return None if (rows != columns).any() else np.asarray(self.matrix.diagonal())

    @property
    def is_coupled(self) -> bool:
        """Whether its inverse is known neither as a diagonal nor as a product."""
        return self.diagonal is None and self.root is None

    @property
    def keeps_element_steps(self) -> bool:
        """Whether the step of the smallest uncut element is stable, whatever the cuts."""
        return self.diagonal is not None

    @cached_property
    def entries(self) -> tuple[Ints, Ints, Floats]:
        """(rows, columns, values) of the non-zeros."""
        matrix = self.matrix
        rows = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
        return rows, matrix.indices.astype(np.int64), matrix.data

    def apply(self, vectors: Floats) -> Floats:
        """Multiply (N, d) vectors by M."""
        if self.diagonal is not None:
            return self.diagonal[:, None] * vectors
        return self.matrix @ vectors

    def solve(self, forces: Floats) -> Floats:
        """Multiply (N, d) forces by M⁻¹."""
        if self.diagonal is not None:
            return forces / self.diagonal[:, None]
        if self.root is not None:
            return self.root @ (self.root.T @ forces)
        return self._inverse(forces)

    @cached_property
    def _inverse(self) -> Callable[[Floats], Floats]:
        return self.inverse_of(np.ones(len(self.weights), dtype=bool))

    def inverse_of(self, free: Bools) -> Callable[[Floats], Floats]:
        """Factorise the rows and columns of free nodes (N,); the inverse maps others to zero.

        Raises
        ------
        XfemError
            As `inverse_of_mass`.
        """
        kept = np.flatnonzero(free)
        inverse = inverse_of_mass(self.matrix[kept][:, kept])

        def solve(forces: Floats) -> Floats:
            found = np.zeros(forces.shape)
            found[kept] = inverse(forces[kept])
            return found

        return solve

    def weight(self, gravity: ArrayLike) -> Floats:
        """Compute the dead weight (N, d) of the unknowns under gravity (d,), in newtons.

        Raises
        ------
        XfemError
            If gravity is not a finite vector.
        """
        return self.weights[:, None] * finite_array(gravity, "vector of gravity", (None,))

    def pattern(self, phantom: PhantomMesh, couplings: Ints | None = None) -> BlockPattern:
        """Make the sparsity of stiffness and mass together; its first cells are the body's.

        The lumpings of the thesis couple the unknowns of one node. The mass of a ghost penalty
        couples unknowns on both sides of a face. No cell does either.

        Parameters
        ----------
        phantom : PhantomMesh
        couplings : (k, 2) int array, optional
            Further pairs of dof nodes that are to be coupled.
        """
        own = np.empty((0, 2), dtype=np.int64) if couplings is None else couplings
        if self.sparsity is not None and couplings is None:
            return self.sparsity
        if self.diagonal is None and self.sparsity is None:
            rows, columns, _ = self.entries
            upper = rows < columns
            pairs = np.stack([rows[upper], columns[upper]], axis=1)
            _, found = find_places(body_pattern(phantom), pairs[:, 0], pairs[:, 1])
            own = np.concatenate([own, pairs[~found]])
        return body_pattern(phantom, own)

    def places(self, pattern: BlockPattern) -> Ints | slice:
        """Find the block of each of the `entries` in a pattern: all of them in its own.

        Raises
        ------
        XfemError
            If the pattern lacks one.
        """
        rows, columns, _ = self.entries
        if pattern is self.sparsity:
            return slice(None)
        if self.diagonal is not None and len(rows) == pattern.node_count:
            return pattern.diagonal.astype(np.int64)
        return pattern_places(pattern, rows, columns)


def inverse_of_mass(matrix: csr_array) -> Callable[[Floats], Floats]:
    """Factorise a mass (n, n) that is not diagonal; the result solves for (n,) or (n, k) forces.

    Scaled to a unit diagonal the condition number is below 10 at slivers of any share. It is larger
    only where shape functions depend on each other, as in a part between two cuts that are close:
    1/t² of a part of t elements.

    Raises
    ------
    XfemError
        If such a part is too thin: a random acceleration does not come back with three digits.
    """
    try:
        inverse = scaled_inverse(matrix)
        root = np.sqrt(matrix.diagonal())
        one = np.random.default_rng(0).standard_normal(len(root)) / root
        error = np.abs(root * (inverse(matrix @ one) - one)).max(initial=0.0)
    except SingularStiffnessError:
        error = np.inf
    if not error < _DIGITS:
        raise XfemError(
            "mass singular to round-off, though scaled: a part too thin between two cuts, or of no "
            "mass; expected the side-wise mass, or cuts further apart"
        )
    return inverse


def cell_densities(mesh: SimplexMesh, density: ArrayLike) -> Floats:
    """Return the density (m,) of the uncut cells.

    Raises
    ------
    XfemError
        If it is not positive and finite, or neither one value nor one per cell.
    """
    count = len(mesh.cells)
    values = finite_array(density, "density", (), (count,))
    if not (values > 0.0).all():
        raise XfemError(f"density {values.min():g}; expected positive")
    return np.broadcast_to(values, count)


def side_wise_mass(phantom: PhantomMesh, density: ArrayLike) -> Mass:
    """Lump side-wise: the diagonal Σ ρ V_piece/(d + 1) over the pieces of each dof node.

    Parameters
    ----------
    phantom : PhantomMesh
    density : float or (m,) array_like
        In kg/m³; for membranes times the thickness.

    Raises
    ------
    XfemError
        If the density is not positive and finite, or neither one value nor one per cell.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> phantom = xfem.cut_mesh(xfem.rectangle_mesh((4, 4)), [xfem.Plane([0.6, 0.0], [1.0, 0.0])])
    >>> round(float(xfem.side_wise_mass(phantom, 1000.0).weights.sum()), 9)
    1000.0
    """
    if phantom.aggregation is not None:
        found: Mass = phantom.aggregation.mass(side_wise_mass(phantom.corners, density))
        return found
    corners = phantom.cells.shape[1]
    share = phantom.volumes * cell_densities(phantom.mesh, density)[phantom.parent] / corners
    weights = np.bincount(phantom.cells.ravel(), np.repeat(share, corners))
    every = np.arange(len(weights) + 1, dtype=np.int32)
    matrix, root = (csr_array((x, every[:-1], every)) for x in (weights, 1.0 / np.sqrt(weights)))
    return Mass(matrix, root, weights)


def second_moments(phantom: PhantomMesh) -> Floats:
    """Integrate N_i N_j over each piece exactly: (p, d + 1, d + 1), in m^d."""
    corners = phantom.cells.shape[1]
    whole = (np.ones((corners, corners)) + np.eye(corners)) / (corners * (corners + 1))
    moments = phantom.volumes[:, None, None] * whole
    moments[phantom.split] = 0.0
    sub = phantom.sub_cells
    # ∫ N_i N_j of a simplex: V/((d + 1)(d + 2)) Σ_vw (1 + δ_vw) N_i(v) N_j(w)
    vertex_sum = sub.barycentric.sum(axis=1)
    products = np.einsum("kvi,kvj->kij", sub.barycentric, sub.barycentric)
    products += vertex_sum[:, :, None] * vertex_sum[:, None, :]
    volume = sub.fraction * phantom.mesh.measures[phantom.parent[sub.piece]]
    products *= (volume / (corners * (corners + 1)))[:, None, None]
    np.add.at(moments, sub.piece, products)
    return moments


def consistent_mass(phantom: PhantomMesh, density: ArrayLike) -> Mass:
    """Compute the consistent mass (2.72–75) in side-wise unknowns: ∫ρ N_i N_j over each piece.

    Its explicit step vanishes with the smallest piece. Parameters as for `side_wise_mass`.
    """
    if phantom.aggregation is not None:
        found: Mass = phantom.aggregation.mass(consistent_mass(phantom.corners, density))
        return found
    return assembled_mass(phantom, density, second_moments(phantom))


def assembled_mass(phantom: PhantomMesh, density: ArrayLike, moments: Floats) -> Mass:
    """Make the mass whose share of each piece is its density times `moments` (p, d + 1, d + 1)."""
    moments = moments * cell_densities(phantom.mesh, density)[phantom.parent][:, None, None]
    pattern, count = body_pattern(phantom), phantom.node_count
    entries = np.bincount(pattern.targets.ravel(), moments.ravel(), len(pattern.columns))
    matrix = csr_array((entries, pattern.columns, pattern.starts), shape=(count, count))
    return Mass(matrix, None, np.asarray(matrix.sum(axis=1)).ravel(), sparsity=pattern)
