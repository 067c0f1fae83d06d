"""Linear stiffness of a cut body: assembled into nodal blocks, or applied without a matrix."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.xfem.assembly_kernels import add_stiffness, linear_force
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.elasticity import Material
from verify.xfem.mesh import SimplexMesh
from verify.xfem.virtual import VirtualMesh

__all__ = ["LinearStiffness"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class LinearStiffness:
    """Σ over pieces of V_piece/V · Kᵉ(parent): the whole effect of the cut on the stiffness.

    Parameters
    ----------
    virtual : VirtualMesh
        Of triangles in space (a membrane) only the stiffness in its plane is meant: across a flat
        membrane there is none, and supports must hold it.
    material : Material
        Of a membrane in plane stress, times the thickness.

    Raises
    ------
    XfemError
        If the material has neither one value nor one per cell of the uncut mesh.
    """

    virtual: VirtualMesh
    lam: _Floats
    mu: _Floats
    normals: _Floats

    def __init__(self, virtual: VirtualMesh, material: Material) -> None:
        mesh = virtual.mesh
        lam, mu = material.of_cells(len(mesh.cells))
        object.__setattr__(self, "virtual", virtual)
        object.__setattr__(self, "normals", _unit_normals(mesh))
        object.__setattr__(self, "lam", lam)
        object.__setattr__(self, "mu", mu)

    def assemble(self, pattern: BlockPattern, out: _Floats | None = None) -> _Floats:
        """(B, d, d) nodal blocks of the stiffness, in N/m (per metre of thickness in 2D).

        The first cells of the pattern must be those of the body.
        """
        dim = self.virtual.mesh.space
        blocks = np.zeros((len(pattern.columns), dim, dim)) if out is None else out
        if out is not None:
            blocks[:] = 0.0
        v = self.virtual
        targets = pattern.targets[: len(v.cells)]
        added = pattern.unfold(blocks)
        add_stiffness(
            targets, v.mesh.gradients, self.normals, v.parent, v.volumes, self.lam, self.mu, added
        )
        pattern.fold(added, blocks)
        return blocks

    def force(self, displacement: _Floats) -> tuple[_Floats, float]:
        """Apply to a displacement (N, d): internal force (N, d) and strain energy, in N and J."""
        v = self.virtual
        extended = v.extend(displacement)
        force = np.zeros_like(extended)
        energy = linear_force(
            v.cells,
            v.mesh.gradients,
            self.normals,
            v.parent,
            v.volumes,
            self.lam,
            self.mu,
            extended,
            force,
        )
        return v.restrict(force), float(energy)


def _unit_normals(mesh: SimplexMesh) -> _Floats:
    """(m, 3) unit normals of a membrane; zeros (1, d) for a solid."""
    if mesh.dim == mesh.space:
        return np.zeros((1, mesh.space))
    edges = mesh.edge_vectors
    normals = np.cross(edges[:, 0], edges[:, 1])
    unit: _Floats = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return unit
