"""Ghost penalty: jumps of the gradient across the faces of cut cells cost energy (Burman 2010).

Each side is penalised on its own, so that the halves stay separate. The penalty vanishes for
linear fields, hence for rigid motion, even of finite rotation, and needs no rotations of its own.
It bounds the stiffness of slivers from below, which an explicit step pays for unless the mass
grows alike: `GhostPenalty.mass`.
"""

from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from verify.xfem.block_pattern import BlockPattern, block_pattern
from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.mass import Mass, cell_densities
from verify.xfem.piece_contacts import face_contacts
from verify.xfem.virtual import VirtualMesh

__all__ = ["GhostPenalty"]

_Floats = NDArray[np.float64]


class GhostPenalty:
    """½ γ Σ (λ + 2μ) h A |⟦∂u/∂n⟧|² over the faces between pieces of which one is cut.

    Parameters
    ----------
    virtual : VirtualMesh
    material : Material
    factor : float
        γ; dimensionless.

    Attributes
    ----------
    jumps : (f, N) csr_array
        ⟦∂N_i/∂n⟧ on each face, in 1/m.
    weights : (f,) float array
        h A, with h the mean height of both cells over the face, in m^d.
    modulus : (f,) float array
        (λ + 2μ) of the stiffer cell, in pascal.

    Raises
    ------
    XfemError
        If the factor is not positive.
    """

    def __init__(self, virtual: VirtualMesh, material: Material, factor: float = 0.01) -> None:
        if not (np.isfinite(factor) and factor > 0.0):
            raise XfemError(f"ghost penalty with factor {factor:g}; expected a positive one")
        self.virtual, self.factor = virtual, factor
        pieces = np.stack(face_contacts(virtual, near=True))
        pieces = pieces[:, virtual.split[pieces].any(axis=0)]
        mesh, cells = virtual.mesh, virtual.parent[pieces]
        local = (mesh.neighbours[cells[0]] == cells[1][:, None]).argmax(axis=1)
        there = (mesh.neighbours[cells[1]] == cells[0][:, None]).argmax(axis=1)
        faces = np.arange(len(local))
        slope = mesh.gradients[cells[0], local]
        steepness = np.linalg.norm(slope, axis=1)
        height = 1.0 / steepness
        across = 1.0 / np.linalg.norm(mesh.gradients[cells[1], there], axis=1)
        area = mesh.measures[cells[0]] * mesh.dim * steepness
        normal = -slope / steepness[:, None]
        values = [np.einsum("fij,fj->fi", mesh.gradients[c], normal) for c in cells]
        columns = np.concatenate([virtual.cells[p] for p in pieces], axis=1)
        rows = np.broadcast_to(faces[:, None], columns.shape)
        jump = np.concatenate([values[0], -values[1]], axis=1)
        self.jumps = csr_array(
            coo_array(
                (jump.ravel(), (rows.ravel(), columns.ravel())),
                shape=(len(faces), virtual.node_count),
            )
        )
        self.weights = 0.5 * (height + across) * area
        self._heights = 0.5 * (height + across)
        self._cells = cells
        self.modulus = self._of_faces(material.lam + 2.0 * material.mu)
        self._pairs = np.stack(
            [virtual.cells[pieces[0], local], virtual.cells[pieces[1], there]], axis=1
        )

    @cached_property
    def matrix(self) -> csr_array:
        """(N, N) the penalty's stiffness, the same for every component, in N/m."""
        weights = self.factor * self.modulus * self.weights
        return csr_array(self.jumps.T @ (self.jumps * weights[:, None]))

    def pattern(self) -> BlockPattern:
        """Sparsity of stiffness and penalty; its first cells are those of the body."""
        corners = self.virtual.cells.shape[1]
        couplings = self._pairs[:, [0] + [1] * (corners - 1)]
        cells = np.concatenate([self.virtual.cells, couplings])
        return block_pattern(cells, self.virtual.node_count)

    def add_stiffness(self, pattern: BlockPattern, blocks: _Floats) -> None:
        """Add the penalty to nodal blocks (B, d, d) of a `pattern`."""
        entries = self.matrix.tocoo()
        of_row = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
        keys = of_row * pattern.node_count + pattern.columns
        at = np.searchsorted(keys, entries.row.astype(np.int64) * pattern.node_count + entries.col)
        for axis in range(blocks.shape[1]):
            blocks[at, axis, axis] += entries.data

    def force(self, displacement: _Floats) -> tuple[_Floats, float]:
        """Force (N, d) of the penalty, in newtons, and its energy."""
        force = self.matrix @ displacement
        return force, 0.5 * float((force * displacement).sum())

    def mass(self, mass: Mass, density: _Floats | float) -> Mass:
        """Mass with the counterpart γ Σ ρ h³ A |⟦∂v/∂n⟧|²; not diagonal any more.

        It does not act on rigid motion: total mass, weight and momenta stay.
        """
        rho = self._of_faces(cell_densities(self.virtual, density))
        weights = self.factor * rho * self._heights**2 * self.weights
        extra = self.jumps.T @ (self.jumps * weights[:, None])
        return replace(mass, matrix=csr_array(mass.matrix + extra), root=None)

    def _of_faces(self, values: NDArray) -> _Floats:
        """Larger of the values of both cells at each face."""
        each = np.broadcast_to(values, len(self.virtual.mesh.cells))
        larger: _Floats = each[self._cells].max(axis=0)
        return larger
