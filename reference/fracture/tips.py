"""Tips of the cuts of a plane scene, the reach around each, and singular fields of unit intensity.

The fields are free of traction on the faces of a crack. Those at a front are in its own
coordinates, with what its curvature adds.
"""

from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_solution
from reference.exact.arc_crack import ArcCrack
from reference.exact.field import Parameters, hooke
from reference.exact.solution import ExactSolution
from reference.meshing.features import plane_features
from reference.meshing.interfaces import plane_interfaces
from reference.meshing.session import singular_points
from verify.geometry.nearest import distance_to_outline
from verify.geometry.planar import inside_polygon
from verify.scene import ArcCut, Material, Polygon, PolylineCut, Rectangle, Scene

Array = NDArray[np.float64]
End = Literal["start", "end"]
_ENDS: tuple[End, End] = ("start", "end")
_TOUCHING = 1e-9  # of the body: two points so close are one


@dataclass(frozen=True)
class Tip:
    """An end of a straight or circular part of a cut inside the body.

    Attributes
    ----------
    cut : str
    end : {"start", "end"}
        Which end of the cut.
    point : (2,) array
        m.
    direction : (2,) array
        Unit vector in which the cut would go on.
    reach : float
        Distance to the next feature that a domain must not meet, m.
    nearest : str
        That feature, in words.
    arc : ArcCut, optional
        The cut, if it is an arc.
    """

    cut: str
    end: End
    point: Array
    direction: Array
    reach: float
    nearest: str
    arc: ArcCut | None = None

    def radii(self, count: int = 3) -> Array:
        """Radii (count,) of domains that stay clear of tip and next feature, m."""
        return np.asarray(self.reach * np.linspace(0.4, 0.8, count))


def tips(scene: Scene) -> list[Tip]:
    """Tips of the cuts of a plane scene: ends inside the body at which nothing else is met."""
    return [
        tip_at(scene, cut.name, end)
        for cut in scene.final_cuts
        for end in _ENDS
        if isinstance(cut, ArcCut | PolylineCut) and no_tip(scene, cut.name, end) is None
    ]


def no_tip(scene: Scene, name: str, end: End) -> str | None:
    """Why an end of a cut of a plane scene is no tip, or None if it is one."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    cut = next(cut for cut in scene.final_cuts if cut.name == name)
    assert isinstance(cut, ArcCut | PolylineCut)
    vertices, outline = cut.vertices(), scene.geometry.outline()
    said = f"the {end} of cut '{name}' is no tip:"
    if np.array_equal(vertices[0], vertices[-1]):
        return f"{said} the cut is closed"
    point = _ends(cut)[_ENDS.index(end)]
    touching = _TOUCHING * float(np.ptp(outline, axis=0).max())
    if distance_to_outline(point[None], outline)[0] <= touching:
        return f"{said} it is on the boundary of the body"
    if not inside_polygon(point[None], outline)[0]:
        return f"{said} it is outside the body"
    ending, away = _features_around(scene, point)
    # where more than its own end ends, branches meet
    if ending > 1 or min(away)[0] <= touching:
        return f"{said} it meets another cut"
    if any(f.distance(point[None])[0] <= touching for f in plane_interfaces(scene)):
        return f"{said} it is on an interface between materials"
    return None


def _ends(cut: ArcCut | PolylineCut) -> Array:
    """Both ends (2, 2) of an open cut, m."""
    if isinstance(cut, PolylineCut):
        return cut.vertices()[[0, -1]]
    turned = np.deg2rad(cut.start + cut.sweep * np.array([0.0, 1.0]))
    return np.asarray(cut.centre) + cut.radius * np.column_stack([np.cos(turned), np.sin(turned)])


def _features_around(scene: Scene, point: Array) -> tuple[int, list[tuple[float, str]]]:
    """Count the features that end at a point, and give distances (m) and names of the others."""
    ending, away = 0, []
    for feature in plane_features(scene):
        if np.array_equal(point, feature.start) or np.array_equal(point, feature.end):
            ending += 1
        else:
            away.append((float(feature.distance(point[None])[0]), feature.name))
    return ending, away


def tip_at(scene: Scene, name: str, end: End) -> Tip:
    """Make the tip of an end that is one, by `no_tip`."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    cut = next(cut for cut in scene.final_cuts if cut.name == name)
    assert isinstance(cut, ArcCut | PolylineCut)
    at = _ENDS.index(end)
    point = _ends(cut)[at]
    _, away = _features_around(scene, point)
    touching = _TOUCHING * float(np.ptp(scene.geometry.outline(), axis=0).max())
    singular = np.linalg.norm(singular_points(scene) - point, axis=1)
    own = f"the next kink or end of cut '{cut.name}'"  # whatever else is singular is on a feature
    away += [(float(one), own) for one in singular[singular > touching]]
    # the fields of the integral know no interface between materials
    interface = "an interface between materials"
    away += [(float(f.distance(point[None])[0]), interface) for f in plane_interfaces(scene)]
    before = cut.vertices()[[1, -2][at]]
    length = float(np.linalg.norm(point - before))
    if isinstance(cut, PolylineCut):
        away.append((length, own))
    # round-off does not tell whether a singular point is that of a feature
    reach, nearest = min(away, key=lambda one: one[0] * (1 + _TOUCHING * (one[1] == own)))
    if isinstance(cut, ArcCut):
        spoke = (point - np.asarray(cut.centre)) / cut.radius
        sign = 1.0 if end == "end" else -1.0
        ahead = sign * np.array([-spoke[1], spoke[0]])
        return Tip(cut.name, end, point, ahead, reach, nearest, cut)
    return Tip(cut.name, end, point, (point - before) / length, reach, nearest)


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
