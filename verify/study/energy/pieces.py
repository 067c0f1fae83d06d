"""Mass and inertia of the separated pieces, as the mass matrix has them and as they are."""

from dataclasses import dataclass
from math import factorial

import numpy as np
from numpy.typing import NDArray

from verify.xfem.mass import Mass
from verify.xfem.subdivision import subdivide
from verify.xfem.virtual import VirtualMesh

__all__ = ["PieceInertia", "piece_inertias"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class PieceInertia:
    """Inertia of one piece; the exact values are integrals over its material.

    Attributes
    ----------
    mass, exact_mass : float
        vᵀMv of a unit translation along the last axis, in kg (per metre in 2D).
    turning, exact_turning : float
        vᵀMv of a unit rotation about the piece's centre (in 3D about the last axis), in kg m².
    acceleration : float
        With which the piece falls if its weight pulls at it, over that of free fall: 1 if right.
    """

    mass: float
    exact_mass: float
    turning: float
    exact_turning: float
    acceleration: float


def piece_inertias(virtual: VirtualMesh, mass: Mass, density: float) -> list[PieceInertia]:
    """Inertias of the free bodies, in the order of `VirtualMesh.bodies`."""
    divided = subdivide(virtual)
    corners = divided.points[divided.cells]
    dim = corners.shape[2]
    volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / factorial(dim)
    owner = virtual.bodies[virtual.cells[divided.cell_piece, 0]]
    found = []
    for number in range(int(virtual.bodies.max()) + 1):
        chosen = owner == number
        volume, at = volumes[chosen], corners[chosen][:, :, :2]
        centre = volume @ at.mean(axis=1) / volume.sum()
        # exact for quadratics on a simplex: (Σ x_v + (Σ x)²-terms)/((d+1)(d+2))
        away = at - centre
        squares = (away**2).sum(axis=(1, 2)) + (away.sum(axis=1) ** 2).sum(axis=1)
        exact_turning = density * float(volume @ squares) / ((dim + 1) * (dim + 2))
        inside = (virtual.bodies == number).astype(float)[:, None]
        fall = inside * np.eye(dim)[-1]
        turn = np.zeros_like(virtual.node_points)
        offset = virtual.node_points[:, :2] - centre
        turn[:, 0], turn[:, 1] = -offset[:, 1], offset[:, 0]
        turn *= inside
        inertia = float(np.sum(fall * mass.apply(fall)))
        weight = float(inside[:, 0] @ mass.weights)
        found.append(
            PieceInertia(
                mass=inertia,
                exact_mass=density * float(volume.sum()),
                turning=float(np.sum(turn * mass.apply(turn))),
                exact_turning=exact_turning,
                acceleration=weight / inertia,
            )
        )
    return found
