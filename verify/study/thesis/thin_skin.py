"""Thin skin: layers of linear tetrahedra are far too stiff in bending."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from verify.accelerated import FAST
from verify.xfem.elasticity import isotropic
from verify.xfem.loads import body_force
from verify.xfem.statics import solve_static
from verify.xfem.structured_meshes import box_mesh
from verify.xfem.supports import Supports
from verify.xfem.virtual import cut_mesh

__all__ = ["SkinBending", "skin_bending"]

_LENGTH, _WIDTH, _THICKNESS = 0.06, 0.02, 0.002  # m: the longest incision, a strip, the skin
_YOUNG, _WEIGHT = 1.0e4, 1.0  # Pa, N/m³: any weight, the answer is linear in it
_POISSON = 0.0  # for which the theory of beams is that of elasticity, but for the clamp


@dataclass(frozen=True)
class SkinBending:
    """A clamped strip of skin under its weight.

    Attributes
    ----------
    edge : float
        Of the elements along the skin, m.
    layers : int
        Of elements over the thickness.
    tetrahedra : int
    deflection : float
        Of the free end, over that of the beam: 1 is right.
    stretch : float
        Elongation under its weight along its length, over that of the bar.
    """

    edge: float
    layers: int
    tetrahedra: int
    deflection: float
    stretch: float


def skin_bending(meshes: Sequence[tuple[float, int]]) -> list[SkinBending]:
    """Bend and stretch the strip on meshes of (edge in m, layers)."""
    area, inertia = _WIDTH * _THICKNESS, _WIDTH * _THICKNESS**3 / 12.0
    bent = _WEIGHT * area * _LENGTH**4 / (8.0 * _YOUNG * inertia)
    stretched = _WEIGHT * _LENGTH**2 / (2.0 * _YOUNG)
    material = isotropic(_YOUNG, _POISSON, "solid")
    found = []
    for edge, layers in meshes:
        divisions = round(_LENGTH / edge), max(round(_WIDTH / edge), 1), layers
        mesh = box_mesh(divisions, upper=(_LENGTH, _WIDTH, _THICKNESS))
        virtual = cut_mesh(mesh, [])
        held = Supports.none(virtual).prescribe(virtual, np.flatnonzero(mesh.points[:, 0] == 0.0))
        end = mesh.points[:, 0] > _LENGTH * (1.0 - 1e-9)
        moved = [
            solve_static(virtual, material, held, load, kernels=FAST).displacement[end]
            for load in (
                body_force(virtual, (0.0, 0.0, -_WEIGHT)),
                body_force(virtual, (_WEIGHT, 0.0, 0.0)),
            )
        ]
        found.append(
            SkinBending(
                edge,
                layers,
                len(mesh.cells),
                -float(moved[0][:, 2].mean()) / bent,
                float(moved[1][:, 0].mean()) / stretched,
            )
        )
    return found
