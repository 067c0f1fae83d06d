"""Strain and stress of the cells of a solution, as full tensors in space.

Linear kinematics: ε = sym ∇u, σ = λ tr(ε) I + 2μ ε. Corotational kinematics and membranes have Biot
strain U − I and Biot stress of the same form instead, where F = I + ∇u = R U: material tensors,
the same for a body that is turned. What plane strain, plane stress or a membrane says of the
direction across is filled in.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.locate import SolutionField
from verify.compare.simplices import in_frames, triangle_frames
from verify.scene import Scene

Array = NDArray[np.float64]


def strain_and_stress(field: SolutionField, scene: Scene) -> tuple[Array, Array]:
    """Strain (m, 3, 3) and stress (m, 3, 3) in Pa at the centres of the cells of a solution.

    Of linear cells they are those of the whole cell. A cell without volume has none: zero.
    """
    centres = field.shape.corners.mean(axis=1)
    gradient = field.in_cells(centres, np.arange(len(centres)))[1]
    membrane = scene.cell_dimension < scene.dimension
    frames = triangle_frames(field.shape.corners) if membrane else None
    if frames is not None:
        gradient = in_frames(gradient, frames)
    if membrane or scene.analysis.kinematics == "corotational":
        own = _biot_strain(gradient)
    else:
        own = 0.5 * (gradient + np.swapaxes(gradient, 1, 2))
    moduli, k = scene.material.at(centres), scene.cell_dimension
    strain = np.zeros((len(centres), 3, 3))
    strain[:, :k, :k] = own
    if membrane or scene.material.plane == "stress":
        trace = np.einsum("nii->n", own)
        strain[:, 2, 2] = -moduli.poisson / (1.0 - moduli.poisson) * trace
    if frames is not None:
        strain = np.swapaxes(frames, 1, 2) @ strain @ frames
    shear = moduli.young / (2.0 * (1.0 + moduli.poisson))
    lame = 2.0 * shear * moduli.poisson / (1.0 - 2.0 * moduli.poisson)
    trace = np.einsum("nii->n", strain)
    stress = 2.0 * shear[:, None, None] * strain
    stress += (lame * trace)[:, None, None] * np.eye(3)
    return strain, stress


def _biot_strain(gradient: Array) -> Array:
    """U − I (n, k, k) of displacement gradients (n, d, k), from C − I: 1 is never added to it.

    The smallest stretch of a cell that is inside out is negative, as in the energy.
    """
    k = gradient.shape[2]
    along = gradient[:, :k]
    excess, axes = np.linalg.eigh(
        along + np.swapaxes(along, 1, 2) + np.swapaxes(gradient, 1, 2) @ gradient
    )
    excess = np.maximum(excess, -1.0)
    less_one = excess / (1.0 + np.sqrt(1.0 + excess))
    if gradient.shape[1] == k:
        inverted = np.linalg.det(np.eye(k) + gradient) < 0.0
        less_one[inverted, 0] = -2.0 - less_one[inverted, 0]
    return np.asarray(np.einsum("nik,nk,njk->nij", axes, less_one, axes))
