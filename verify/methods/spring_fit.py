"""Stiffness of springs on the edges of simplices, from Young's modulus and Poisson's ratio.

"fitted"
    The springs of each cell are chosen so that their linear stiffness is nearest to that of the
    finite element, in the Frobenius norm (Lloyd, Székely & Harders, *Identification of spring
    parameters for deformable object simulation*, IEEE TVCG 13 (2007)). For equilateral triangles
    it gives their E√3/4 (plane stress, ν = 1/3), for regular tetrahedra their 2√2/25·E l (ν = 1/4).
"van_gelder"
    k = Σ over cells of E V / l² (Van Gelder, *Approximate simulation of elastic membranes by
    triangulated spring meshes*, J. Graphics Tools 3 (1998)), V the area or volume of the cell.

Springs along edges obey Cauchy's relations, so that isotropy needs λ = μ: ν = 1/4 in space and in
plane strain, 1/3 in plane stress. Whatever the fit, no other ratio can be had, and even these only
where the edges are arranged as in equilateral triangles.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh

Fit = Literal["fitted", "van_gelder"]

_Floats = NDArray[np.float64]


def cell_edges(dim: int) -> NDArray[np.int64]:
    """(e, 2) local nodes of the edges of a simplex."""
    return np.stack(np.triu_indices(dim + 1, 1), axis=1)


def spring_stiffness(
    mesh: SimplexMesh, material: Material, fit: Fit = "fitted"
) -> tuple[_Floats, NDArray[np.bool_]]:
    """Stiffness of the springs of each cell alone, in N/m (per metre of thickness in 2D).

    Parameters
    ----------
    mesh : SimplexMesh
        A solid.
    material : Material
    fit : {"fitted", "van_gelder"}

    Returns
    -------
    stiffness : (m, e) float array
        Not negative.
    clamped : (m, e) bool array
        Springs that the fit would make negative, and that are left out.

    Raises
    ------
    XfemError
        If the fit is unknown or the mesh a membrane.
    """
    if mesh.is_membrane:
        raise XfemError("springs of a membrane in space; expected triangles in the plane or tets")
    count = len(mesh.cells)
    lam, mu = (np.broadcast_to(x, count).astype(float) for x in (material.lam, material.mu))
    edges = cell_edges(mesh.dim)
    along = mesh.points[mesh.cells[:, edges[:, 1]]] - mesh.points[mesh.cells[:, edges[:, 0]]]
    squared = (along**2).sum(axis=2)
    if fit == "van_gelder":
        # E of the material from λ and μ of the problem at hand: stress over strain, sides free
        young = mu * (2.0 * mu + mesh.dim * lam) / (mu + 0.5 * (mesh.dim - 1) * lam)
        return (young * mesh.measures)[:, None] / squared, np.zeros(squared.shape, dtype=bool)
    if fit != "fitted":
        raise XfemError(f"spring fit '{fit}'; expected fitted or van_gelder")
    # spring e: the matrix v vᵀ, v = −t at its first node and t at its second, so that the products
    # of two of them, and of one with K, are small sums over common nodes
    t = along / np.sqrt(squared)[:, :, None]
    incidence = np.zeros((len(edges), mesh.dim + 1))
    incidence[np.arange(len(edges)), edges[:, 0]] = -1.0
    incidence[np.arange(len(edges)), edges[:, 1]] = 1.0
    cosine = np.einsum("mei,mfi->mef", t, t) * (incidence @ incidence.T)
    stretch = np.einsum("en,mni,mei->me", incidence, mesh.gradients, t)  # t·grad u·t of v itself
    slope = np.einsum("en,mni->mei", incidence, mesh.gradients)
    # vᵀK v = V (λ tr² ε + 2μ ε:ε), ε the symmetric part of t ⊗ slope
    shear = 0.5 * ((slope**2).sum(axis=2) + stretch**2)
    target = mesh.measures[:, None] * (lam[:, None] * stretch**2 + 2.0 * mu[:, None] * shear)
    return _non_negative(cosine**2, target)


def _non_negative(gram: _Floats, target: _Floats) -> tuple[_Floats, NDArray[np.bool_]]:
    """Least squares with the worst negative unknown left out, until none is negative."""
    count, size = target.shape
    clamped = np.zeros((count, size), dtype=bool)
    eye = np.eye(size, dtype=bool)
    while True:
        held = clamped[:, :, None] | clamped[:, None, :]
        system = np.where(held, eye, gram)
        solution = np.linalg.solve(system, np.where(clamped, 0.0, target)[:, :, None])[:, :, 0]
        negative = solution < -1e-12 * np.abs(solution).max(axis=1, keepdims=True)
        bad = np.flatnonzero(negative.any(axis=1))
        if len(bad) == 0:
            return np.maximum(solution, 0.0), clamped
        clamped[bad, solution[bad].argmin(axis=1)] = True
