"""Small things that several tests need: boundary nodes, dense stiffness, integrals."""

import numpy as np

from verify.xfem.block_pattern import block_pattern
from verify.xfem.element import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.loads_and_supports import simplex_rule
from verify.xfem.subdivision import subdivide


def boundary_nodes(mesh):
    facets = mesh.boundary_facets
    local = np.arange(mesh.dim + 1) != facets[:, 1:]
    return np.unique(mesh.cells[facets[:, 0]][local])


def sparse_stiffness(phantom, young=1.0, poisson=0.3):
    state = "plane strain" if phantom.mesh.dim == 2 else "solid"
    pattern = block_pattern(phantom.cells, phantom.node_count)
    blocks = InternalForce(phantom, isotropic(young, poisson, state), "linear").stiffness(pattern)
    return pattern.matrix(blocks).tocsr()


def scaled_dense_stiffness(phantom):
    """D^-1/2 K D^-1/2, so that slivers do not hide in round-off."""
    K = sparse_stiffness(phantom).toarray()
    scale = 1.0 / np.sqrt(np.diag(K))
    return scale[:, None] * K * scale


def zero_modes(phantom):
    """Number of eigenvalues of the scaled stiffness that are zero, and the gap to the next."""
    values = np.linalg.eigvalsh(scaled_dense_stiffness(phantom))
    zero = int((np.abs(values) < 1e-11).sum())
    return zero, values[zero]


def relative_l2_error(phantom, displacement, exact, degree=6):
    """‖u − exact‖/‖exact‖ over the body, integrated on the pieces."""
    body = subdivide(phantom)
    values = (body.interpolation @ displacement)[body.cells]
    corners = body.points[body.cells]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / (2 if phantom.mesh.dim == 2 else 6)
    sides = phantom.piece_side[body.cell_piece]
    error = size = 0.0
    for point, weight in zip(*simplex_rule(phantom.mesh.dim, degree), strict=True):
        at = np.einsum("k,ckd->cd", point, corners)
        want = exact(at, sides)
        got = np.einsum("k,ckd->cd", point, values)
        error += weight * volumes @ ((got - want) ** 2).sum(axis=1)
        size += weight * volumes @ (want**2).sum(axis=1)
    return np.sqrt(error / size)
