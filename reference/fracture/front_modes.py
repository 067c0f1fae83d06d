"""The three singular fields at a front, in its own coordinates, with what its curvature adds."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_solution
from reference.exact.hooke import hooke
from verify.scene import Material

Array = NDArray[np.float64]


class ModeField(NamedTuple):
    """A singular field of unit intensity at n points, in the axes ahead, across, along.

    The stress is that of the plane problem; at a curved front it is not quite in equilibrium, and
    the strain that belongs to it is not quite that of the displacement.

    Attributes
    ----------
    stress : (n, 3, 3) array
        1/√m.
    gradient : (n, 3, 3) array
        Of the displacement, i, j: ∂u_i/∂x_j.
    divergence : (n, 3) array
        Of the stress.
    misfit : (n, 3, 3) array
        Derivative, in the direction ahead, of the strain of the displacement less that of the
        stress.
    """

    stress: Array
    gradient: Array
    divergence: Array
    misfit: Array


def mode_field(
    mode: int, material: Material, ahead: Array, across: Array, curvature: float
) -> ModeField:
    """Evaluate mode 1, 2 or 3 at places (n,) ahead of and across a front.

    In the coordinates of a plane curve of curvature κ, h = 1 + κ x1, the axes turn by
    ∂_3 e_1 = κ e_3/h and ∂_3 e_3 = −κ e_1/h.
    """
    n = len(ahead)
    by_h = curvature / (1 + curvature * ahead)
    stress, gradient = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    divergence, misfit = np.zeros((n, 3)), np.zeros((n, 3, 3))
    if mode == 3:
        shear = hooke(material).shear
        root = np.sqrt(ahead + 1j * across)
        displacement = np.sqrt(2 / np.pi) / shear * root.imag
        slope = 1 / (np.sqrt(2 * np.pi) * shear) / root
        # root' = 1/(2 root): ∂_1 of its imaginary part, and ∂_2
        gradient[:, 2, 0], gradient[:, 2, 1] = slope.imag, slope.real
        gradient[:, 0, 2] = -by_h * displacement
        stress[:, 0, 2] = stress[:, 2, 0] = shear * slope.imag
        stress[:, 1, 2] = stress[:, 2, 1] = shear * slope.real
        divergence[:, 2] = 2 * by_h * stress[:, 0, 2]
        misfit[:, 0, 2] = -0.5 * by_h * (slope.imag - by_h * displacement)
        misfit[:, 2, 0] = misfit[:, 0, 2]
        return ModeField(stress, gradient, divergence, misfit)
    plane = Material(young=material.young, poisson=material.poisson, plane="strain")
    intensity = [1.0, 0.0] if mode == 1 else [0.0, 1.0]
    tip = exact_solution("tip", {"tip": [0.0, 0.0], "intensity": intensity}, plane)
    points = np.column_stack([ahead, across])
    slope = tip.gradient(points)
    widening = tip.displacement(points)[:, 0]
    gradient[:, :2, :2] = slope
    gradient[:, 2, 2] = by_h * widening
    stress[:, :2, :2] = tip.law.stress(slope)
    stress[:, 2, 2] = material.poisson * (stress[:, 0, 0] + stress[:, 1, 1])
    divergence[:, 0] = by_h * (stress[:, 0, 0] - stress[:, 2, 2])
    divergence[:, 1] = by_h * stress[:, 0, 1]
    misfit[:, 2, 2] = by_h * (slope[:, 0, 0] - by_h * widening)
    return ModeField(stress, gradient, divergence, misfit)
