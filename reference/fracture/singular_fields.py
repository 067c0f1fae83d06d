"""Singular fields of unit intensity, free of traction on the faces of a crack: at tips, at fronts.

Those at a front are in its own coordinates, with what its curvature adds.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_solution
from reference.exact.arc_crack import ArcCrack
from reference.exact.hooke import hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import ExactSolution
from verify.scene import ArcCut, Material

Array = NDArray[np.float64]
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])  # turns by 90° to the left


def tip_fields(
    material: Material, tip: Array, direction: Array, arc: ArcCut | None
) -> list[list[tuple[float, ExactSolution]]]:
    """Give the fields of mode I and mode II, each as a sum of exact ones with their factors.

    At a straight crack those of Williams; at an arc, those of the arc in an infinite plate under
    three remote stresses, combined so that only the one mode is left at this end.
    """
    if arc is None:
        angle = float(np.rad2deg(np.arctan2(direction[1], direction[0])))
        given = {"tip": tip.tolist(), "angle": angle}
        modes = ([1.0, 0.0], [0.0, 1.0])
        return [
            [(1.0, exact_solution("tip", {**given, "intensity": mode}, material))] for mode in modes
        ]
    given = {
        "centre": list(arc.centre),
        "radius": arc.radius,
        "angle": arc.start + 0.5 * arc.sweep,
        "half_angle": 0.5 * arc.sweep,
    }
    stresses = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
    law = hooke(material)
    fields = [ArcCrack(law, Parameters("arc_crack", {**given, "stress": s})) for s in stresses]
    intensities = np.array([field.intensity_at(tip) for field in fields])
    shares = np.linalg.pinv(intensities)  # rows: the shares of the three in each mode
    return [list(zip(row.tolist(), fields, strict=True)) for row in shares]


def ahead_of(
    points: Array, tip: Array, direction: Array, arc: ArcCut | None
) -> tuple[Array, Array]:
    """Give the way (…, 2) in which a domain moves along its crack, and its gradient (2, 2), 1/m.

    It is a translation along a straight crack, and a turn about the centre of an arc: both leave
    the crack where it is and an isotropic body what it is.
    """
    if arc is None:
        return np.broadcast_to(direction, points.shape), np.zeros((2, 2))
    spokes = points - np.asarray(arc.centre)
    sense = np.sign((_QUARTER @ (tip - np.asarray(arc.centre))) @ direction)
    turn = sense * _QUARTER / arc.radius
    return spokes @ turn.T, turn


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
