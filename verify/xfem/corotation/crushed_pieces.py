"""Pieces that are inside out, or pressed together until their rotation is not unique."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.corotation.internal_force import InternalForce
from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_floats

__all__ = ["collapsed_pieces", "inverted_pieces"]

_Floats = NDArray[np.float64]


def inverted_pieces(force: InternalForce, displacement: _Floats) -> NDArray[np.int64]:
    """Pieces whose deformation gradient has a negative determinant (solids only)."""
    if force.is_membrane:
        raise XfemError("inversion of a membrane in space is not defined")
    return np.flatnonzero(np.linalg.det(_deformation(force, displacement)) < 0.0)


def collapsed_pieces(
    force: InternalForce, displacement: _Floats, ratio: float
) -> NDArray[np.int64]:
    """Pieces whose rotation, and with it the force, is not unique, or nearly so.

    That is where the two principal stretches of a plane piece cancel (of an inverted piece the
    smallest is negative), where the two smallest do in space, and where a membrane has shrunk
    to a line.

    Parameters
    ----------
    force : InternalForce
    displacement : (N, d) float array
    ratio : float
        Of what is left to the largest stretch, below which a piece counts.
    """
    F = _deformation(force, displacement)
    stretches = np.linalg.svd(F, compute_uv=False)
    left = stretches[:, 1]
    if not force.is_membrane:
        left = np.abs(stretches[:, -2] + np.sign(np.linalg.det(F)) * stretches[:, -1])
    return np.flatnonzero(left <= ratio * stretches[:, 0])


def _deformation(force: InternalForce, displacement: _Floats) -> _Floats:
    """Deformation gradients (p, d, d) of the pieces; of a membrane zero across its plane."""
    v = force.virtual
    check_floats("displacement", displacement, (v.node_count, v.mesh.space))
    F = np.einsum("pik,pil->pkl", v.extend(displacement)[v.cells], v.mesh.gradients[v.parent])
    F += np.eye(v.mesh.space)
    if force.is_membrane:
        normals = force.geometry[3][v.parent]
        F -= np.einsum("pk,pl->pkl", normals, normals)
    return F
