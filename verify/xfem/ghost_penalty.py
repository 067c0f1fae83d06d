"""Ghost penalty: jumps of the gradient across the faces of cut cells cost energy (Burman 2010).

Each side is penalised on its own, so that the halves stay separate. The penalty vanishes for
linear fields, hence for rigid motion, even of finite rotation, and needs no rotations of its own.
It bounds the stiffness of slivers from below, which an explicit step pays for unless the mass
grows alike: `GhostPenalty.mass`.
"""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from verify.xfem.arrays import Floats, Ints, XfemError
from verify.xfem.block_pattern import BlockPattern, pattern_places
from verify.xfem.contacts import face_contacts
from verify.xfem.element import Material
from verify.xfem.mass import Mass, cell_densities
from verify.xfem.phantom import PhantomMesh

DEFAULT_FACTOR = 0.01  # least accuracy lost for a bounded condition number: see the docs on slivers


class GhostPenalty:
    """½ γ Σ (λ + 2μ) h A |⟦∂u/∂n⟧|² over the faces between pieces of which one is cut.

    Parameters
    ----------
    phantom : PhantomMesh
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
    couplings : (f, 2) int array
        Dof nodes on either side of each face that only the penalty couples.

    Raises
    ------
    XfemError
        If the factor is not positive, cells are aggregated (there are no slivers left), or the
        body is a membrane in space: across its creases the gradient of a rigid turn jumps, so that
        turning would cost energy.
    """

    def __init__(
        self, phantom: PhantomMesh, material: Material, factor: float = DEFAULT_FACTOR
    ) -> None:
        if not (isinstance(factor, int | float | np.floating) and 0.0 < factor < np.inf):
            raise XfemError(f"ghost penalty with factor {factor!r}; expected a positive one")
        if phantom.aggregation is not None:
            raise XfemError("ghost penalty of a body with aggregated cells; expected one or other")
        if phantom.mesh.is_membrane:
            raise XfemError("ghost penalty of a membrane in space; expected a body that fills it")
        lam, mu = material.of_cells(len(phantom.mesh.cells))
        self.phantom, self.factor = phantom, factor
        pieces = np.stack(face_contacts(phantom, near=True))
        # pieces of one part have the same unknowns: the first stands for all
        counts_once = phantom.split[pieces].any(axis=0) & (phantom.part[pieces] == pieces).all(
            axis=0
        )
        pieces = pieces[:, counts_once]
        mesh, cells = phantom.mesh, phantom.parent[pieces]
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
        columns = np.concatenate([phantom.cells[p] for p in pieces], axis=1)
        rows = np.broadcast_to(faces[:, None], columns.shape)
        jump = np.concatenate([values[0], -values[1]], axis=1)
        self.jumps = csr_array(
            coo_array(
                (jump.ravel(), (rows.ravel(), columns.ravel())),
                shape=(len(faces), phantom.node_count),
            )
        )
        self.weights = 0.5 * (height + across) * area
        self._heights = 0.5 * (height + across)
        self._cells = cells
        self.modulus = self._of_faces(lam + 2.0 * mu)
        self.couplings: Ints = np.stack(
            [phantom.cells[pieces[0], local], phantom.cells[pieces[1], there]], axis=1
        )
        self._places: tuple[BlockPattern, Ints] | None = None

    @cached_property
    def matrix(self) -> csr_array:
        """(N, N) the penalty's stiffness, the same for every component, in N/m."""
        weights = self.factor * self.modulus * self.weights
        return csr_array(self.jumps.T @ (self.jumps * weights[:, None]))

    def add_stiffness(self, pattern: BlockPattern, blocks: Floats, scale: float = 1.0) -> None:
        """Add `scale` times the penalty to nodal blocks (B, d, d) of a pattern.

        Raises
        ------
        XfemError
            If the pattern lacks couplings of the penalty.
        """
        rows, columns, values = self._entries
        if self._places is None or self._places[0] is not pattern:
            self._places = (pattern, pattern_places(pattern, rows, columns))
        at = self._places[1]
        for axis in range(blocks.shape[1]):
            blocks[at, axis, axis] += scale * values

    @cached_property
    def _entries(self) -> tuple[Ints, Ints, Floats]:
        entries = self.matrix.tocoo()
        return entries.row.astype(np.int64), entries.col.astype(np.int64), entries.data

    def mass(self, mass: Mass, density: Floats | float) -> Mass:
        """Add the counterpart γ Σ ρ h³ A |⟦∂v/∂n⟧|² to a mass; the result is not diagonal.

        It does not act on rigid motion: total mass, weight and momenta stay.
        """
        rho = self._of_faces(cell_densities(self.phantom.mesh, density))
        weights = self.factor * rho * self._heights**2 * self.weights
        extra = self.jumps.T @ (self.jumps * weights[:, None])
        return Mass(csr_array(mass.matrix + extra), None, mass.weights)

    def _of_faces(self, values: NDArray) -> Floats:
        """Take the larger of the values of both cells at each face."""
        each = np.broadcast_to(values, len(self.phantom.mesh.cells))
        larger: Floats = each[self._cells].max(axis=0)
        return larger
