"""Largest stable step 2/ω_max of central differences, exact and as a bound per element."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import bsr_array, csc_array, csr_array, kron
from scipy.sparse.linalg import LinearOperator, eigsh, splu

from verify.xfem.elasticity import Material
from verify.xfem.errors import XfemError
from verify.xfem.mass import Mass
from verify.xfem.mesh import SimplexMesh

__all__ = ["critical_step", "element_critical_steps"]

_DENSE = 400  # unknowns up to which all eigenvalues are cheaper than a Lanczos iteration


def critical_step(
    stiffness: bsr_array | csr_array,
    mass: Mass,
    fixed: NDArray[np.bool_] | None = None,
    tolerance: float = 1e-6,
) -> float:
    """Critical step of the assembled body, by a Lanczos iteration on Cᵀ K C, M⁻¹ = C Cᵀ.

    The scaling on both sides keeps the iteration accurate with slivers, whose mass and stiffness
    go to zero together.

    Parameters
    ----------
    stiffness : (N d, N d) sparse array
        At the state of interest; linear, or tangent.
    mass : Mass
    fixed : (N, d) bool array, optional
        Supported components. They may be left out: that only makes the step smaller.
    tolerance : float
        Relative, of the eigenvalue.

    Returns
    -------
    float
        In seconds; infinite if nothing resists.

    Raises
    ------
    XfemError
        If sizes do not match or everything is fixed.
    """
    K = csr_array(stiffness)
    nodes = mass.matrix.shape[0]
    if K.shape[0] % nodes or K.shape[0] != K.shape[1]:
        raise XfemError(f"stiffness of shape {K.shape} with a mass of {nodes} unknown nodes")
    block = np.eye(K.shape[0] // nodes)
    free = np.arange(K.shape[0])
    if fixed is not None:
        if fixed.size != K.shape[0]:
            raise XfemError(f"supports of shape {fixed.shape} on {K.shape[0]} components")
        free = np.flatnonzero(~fixed.ravel())
        if len(free) == 0:
            raise XfemError("every component is fixed: no step is critical")
    M = csr_array(kron(mass.matrix, block))
    if mass.root is not None and (mass.diagonal is not None or fixed is None):
        C = csr_array(kron(mass.root, block))
        A = C.T @ K @ C
        if mass.diagonal is not None:
            A = A[free][:, free]
        return _step(_largest(A, tolerance))
    return _step(_largest_general(K[free][:, free], M[free][:, free], tolerance))


def _step(eigenvalue: float) -> float:
    return float(2.0 / np.sqrt(eigenvalue)) if eigenvalue > 0.0 else float("inf")


def _largest(A: csr_array, tolerance: float) -> float:
    if A.shape[0] <= _DENSE:
        return float(np.linalg.eigvalsh(A.toarray())[-1])
    return float(eigsh(A, k=1, which="LA", tol=tolerance, return_eigenvectors=False)[0])


def _largest_general(K: csr_array, M: csr_array, tolerance: float) -> float:
    """Scaled to a unit diagonal of M first: slivers make its raw condition number 1/ε."""
    scale = 1.0 / np.sqrt(M.diagonal())
    K = K * scale[:, None] * scale[None, :]
    M = M * scale[:, None] * scale[None, :]
    if K.shape[0] <= _DENSE:
        factor = np.linalg.inv(np.linalg.cholesky(M.toarray()))
        return float(np.linalg.eigvalsh(factor @ K.toarray() @ factor.T)[-1])
    inverse = LinearOperator(K.shape, matvec=splu(csc_array(M)).solve)
    values = eigsh(K, k=1, M=M, Minv=inverse, which="LA", tol=tolerance, return_eigenvectors=False)
    return float(values[0])


def element_critical_steps(mesh: SimplexMesh, material: Material, density: ArrayLike) -> NDArray:
    """Critical step (m,) of each uncut element alone, with its mass lumped.

    The smallest is a lower bound of the step of any cut body with side-wise mass, because a
    piece has the stiffness and the mass of its element times the same factor.
    """
    b = mesh.gradients
    space = mesh.space
    count = len(mesh.cells)
    lam = np.broadcast_to(material.lam, count)[:, None, None, None, None]
    mu = np.broadcast_to(material.mu, count)[:, None, None, None, None]
    # unknowns scaled by a unit mass: K_ij (d + 1)/(ρ V)
    eye = np.eye(space)
    dots = np.einsum("eik,ejk->eij", b, b)
    K = lam * np.einsum("eik,ejl->eikjl", b, b) + mu * np.einsum("ejk,eil->eikjl", b, b)
    K += mu * np.einsum("eij,kl->eikjl", dots, eye)
    size = (mesh.dim + 1) * space
    largest = np.linalg.eigvalsh(K.reshape(count, size, size))[:, -1]
    return 2.0 / np.sqrt(largest * (mesh.dim + 1) / np.broadcast_to(density, count))
