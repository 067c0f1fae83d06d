"""Fields of unit intensity around a tip, free of traction on the faces of its crack."""

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
