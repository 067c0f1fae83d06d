"""Small pieces: the condition, and how far a force on one moves it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from verify.study.slivers.system_numbers import condition_numbers
from verify.system import System
from verify.xfem.assembly import body_pattern
from verify.xfem.cuts import Plane
from verify.xfem.elasticity import isotropic
from verify.xfem.internal_force import InternalForce
from verify.xfem.structured_meshes import rectangle_mesh
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["SmallPiece", "small_pieces"]

_DIVISIONS = 8


@dataclass(frozen=True)
class SmallPiece:
    """XFEM on a clamped square whose cut leaves small pieces, untreated.

    Attributes
    ----------
    size : float
        ε: distance of the cut from a node, in element sizes.
    condition, scaled : float
        Of the stiffness, and of the stiffness scaled by its diagonal.
    compliance : float
        Displacement of a smallest piece per unit force on it, over that for ε = 0.1.
    """

    size: float
    condition: float
    scaled: float
    compliance: float


def small_pieces(sizes: Sequence[float]) -> list[SmallPiece]:
    """Measure pieces of a layer that the cut leaves ε thick; the first size is 0.1."""
    found: list[SmallPiece] = []
    first = 0.0
    for size in (0.1, *sizes):
        height = 0.5 + size / _DIVISIONS
        virtual = cut_mesh(
            rectangle_mesh((_DIVISIONS, _DIVISIONS)), [Plane([0.5, height], [0.0, 1.0])]
        )
        system = _clamped(virtual)
        raw, scaled = condition_numbers(system)
        compliance = _compliance(virtual, system)
        first = first or compliance
        found.append(SmallPiece(size, raw, scaled, compliance / first))
    return found


def _clamped(virtual: VirtualMesh) -> System:
    """Soft tissue (Table 4.1), held at its lower and upper side."""
    pattern = body_pattern(virtual)
    blocks = InternalForce(virtual, isotropic(1e4, 0.3, "plane strain"), "linear").stiffness(
        pattern
    )
    height = virtual.node_points[:, 1]
    held = (height < 1e-9) | (height > 1.0 - 1e-9)
    return System(csr_array(pattern.matrix(blocks)), None, np.repeat(held, 2))


def _compliance(virtual: VirtualMesh, system: System) -> float:
    """Displacement across the cut per unit force there, at the centroid of a smallest piece.

    The worst among the pieces of up to twice the smallest volume: which one of several equal
    ones is smallest is up to round-off.
    """
    free = np.flatnonzero(~system.fixed)
    stiffness = csr_array(system.stiffness)[free][:, free]
    scale = 1.0 / np.sqrt(stiffness.diagonal())
    factors = splu((stiffness * scale[:, None] * scale[None, :]).tocsc())
    worst = 0.0
    for piece in np.flatnonzero(virtual.volumes <= 2.0 * virtual.volumes.min()):
        force = np.zeros(len(system.fixed))
        shape = virtual.shape_integrals[piece] / virtual.volumes[piece]
        force[2 * virtual.cells[piece] + 1] = shape
        loaded = force[free] * scale
        worst = max(worst, float(loaded @ factors.solve(loaded)))
    return worst
