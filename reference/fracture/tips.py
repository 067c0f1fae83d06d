"""Tips and fronts of cuts, the reach around each, and singular fields of unit intensity.

The fields are free of traction on the faces of a crack. Those at a front are in its own
coordinates, with what its curvature adds.
"""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reference.exact import exact_solution
from reference.exact.circular_cuts import ArcCrack
from reference.exact.solution import ExactSolution, Parameters, hooke
from reference.meshing.features import plane_features
from reference.meshing.inner_lines import plane_interfaces
from reference.meshing.session import singular_points
from verify.errors import InputError
from verify.geometry.planar import inside_polygon
from verify.geometry.simplices import distance_to_outline, frame
from verify.scene import (
    ArcCut,
    Box,
    DiscCut,
    Material,
    Polygon,
    PolygonCut,
    PolylineCut,
    Rectangle,
    Scene,
)
from verify.scene.acceptance import FractureQuantity
from verify.scene.cuts import distance_to_cuts

Array = NDArray[np.float64]
End = Literal["start", "end"]
_ENDS: tuple[End, End] = ("start", "end")
_TOUCHING = 1e-9  # of the body: two points so close are one
_QUARTER = np.array([[0.0, -1.0], [1.0, 0.0]])  # turns by 90° to the left
# Radii of the domains, of the reach: a straight front has no axis that they must stay away from.
_ROUND, _STRAIGHT = (0.5, 0.65, 0.8), (0.6, 0.75, 0.9)
_AROUND = 64  # places on the front from which distances are taken
_STATIONS = (12, 3)  # hats of 30 degrees along a round front; along a straight one
# Of the way to the nearer end of a straight front: where it meets a wall at an angle, a domain
# that went all the way would leave the body on one side.
_WAY = 0.75


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
        """Compute the radii (count,) of domains that stay clear of tip and next feature, m."""
        return np.asarray(self.reach * np.linspace(0.4, 0.8, count))


def tips(scene: Scene) -> list[Tip]:
    """Return tips of cuts of a plane scene: ends inside the body at which nothing else is met."""
    return [
        tip_at(scene, cut.name, end)
        for cut in scene.final_cuts
        for end in _ENDS
        if isinstance(cut, ArcCut | PolylineCut) and no_tip(scene, cut.name, end) is None
    ]


def no_tip(scene: Scene, name: str, end: End) -> str | None:
    """Say why an end of a cut of a plane scene is no tip, or None if it is one."""
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
    """Return both ends (2, 2) of an open cut, m."""
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
    # round-off does not tell whether a singular point belongs to a feature
    reach, nearest = min(away, key=lambda one: one[0] * (1 + _TOUCHING * (one[1] == own)))
    if isinstance(cut, ArcCut):
        spoke = (point - np.asarray(cut.centre)) / cut.radius
        sign = 1.0 if end == "end" else -1.0
        ahead = sign * np.array([-spoke[1], spoke[0]])
        return Tip(cut.name, end, point, ahead, reach, nearest, cut)
    return Tip(cut.name, end, point, (point - before) / length, reach, nearest)


def tip_fields(
    material: Material, tip: Array, direction: Array, arc: ArcCut | None
) -> list[list[tuple[float, ExactSolution]]]:
    """Give the fields of mode I and mode II, each as a sum of exact ones with their factors.

    At a straight crack Williams' fields. At an arc, fields of the arc in an infinite plate under
    three remote stresses, so combined that this end has one mode.
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

    The stress solves the plane problem. At a curved front it is not quite in equilibrium, and its
    strain is not quite the strain of the displacement.

    Attributes
    ----------
    stress : (n, 3, 3) array
        1/√m.
    gradient : (n, 3, 3) array
        Of the displacement, i, j: ∂u_i/∂x_j.
    divergence : (n, 3) array
        Of the stress.
    misfit : (n, 3, 3) array
        Derivative, in the direction ahead, of the strain of the displacement less the strain of the
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

    The coordinates are of a plane curve of curvature κ, with h = 1 + κ x1. Their axes turn by ∂_3
    e_1 = κ e_3/h and ∂_3 e_3 = −κ e_1/h.
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


class FrontCoordinates(NamedTuple):
    """Points in the coordinates of a front.

    Attributes
    ----------
    ahead : (n,) array
        Distance ahead of the front in the plane of the crack, m; negative behind it.
    across : (n,) array
        Height over the plane of the crack, m.
    along : (n,) array
        Arc length of the nearest point of the front, m.
    axes : (n, 3, 3) array
        Unit vectors there, as rows: ahead, across, along the front.
    """

    ahead: Array
    across: Array
    along: Array
    axes: Array


class Front(Protocol):
    """A smooth front of a plane crack."""

    @property
    def length(self) -> float:
        """Arc length, m."""
        ...

    @property
    def closed(self) -> bool:
        """Whether it has no ends."""
        ...

    @property
    def curvature(self) -> float:
        """1/m; positive where the crack is inside the curve."""
        ...

    def coordinates(self, points: Array) -> FrontCoordinates:
        """Give the coordinates of points (n, 3)."""
        ...

    def places(self, along: Array) -> Array:
        """Give the points (n, 3) of the front at arc lengths (n,), m."""
        ...


@dataclass(frozen=True)
class CircularFront:
    """The rim of a penny-shaped crack: anticlockwise about its normal.

    Its arc length starts in the direction `towards`, by default a coordinate axis.
    """

    centre: ArrayLike
    normal: ArrayLike
    radius: float
    closed: bool = True
    towards: ArrayLike | None = None

    @property
    def length(self) -> float:
        """Circumference, m."""
        return 2 * np.pi * self.radius

    @property
    def curvature(self) -> float:
        """1/radius."""
        return 1 / self.radius

    def coordinates(self, points: Array) -> FrontCoordinates:
        """Give the coordinates of points (n, 3), which lie off the axis."""
        first, second, normal = self._axes()
        spokes = points - np.asarray(self.centre, dtype=float)
        across = spokes @ normal
        x, y = spokes @ first, spokes @ second
        angle = np.arctan2(y, x)
        ahead = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
        up = np.broadcast_to(normal, ahead.shape)
        axes = np.stack([ahead, up, np.cross(ahead, up)], axis=1)
        return FrontCoordinates(
            np.hypot(x, y) - self.radius, across, np.mod(angle, 2 * np.pi) * self.radius, axes
        )

    def places(self, along: Array) -> Array:
        """Give the points (n, 3) of the front at arc lengths (n,), m."""
        first, second, _ = self._axes()
        angle = along / self.radius
        spokes = np.outer(np.cos(angle), first) + np.outer(np.sin(angle), second)
        return np.asarray(self.centre, dtype=float) + self.radius * spokes

    def _axes(self) -> Array:
        """Give unit vectors (3, 3): to where the arc length starts, across that, the normal."""
        return frame(self.normal, self.towards)


@dataclass(frozen=True)
class StraightFront:
    """A straight front from `start` to `end`; the crack lies behind it, opposite to `ahead`."""

    start: ArrayLike
    end: ArrayLike
    ahead: ArrayLike
    closed: bool = False
    curvature: float = 0.0

    def __post_init__(self) -> None:
        """Check that `ahead` is a direction across the front."""
        along, ahead = self._along(), np.asarray(self.ahead, dtype=float)
        size = float(np.linalg.norm(along) * np.linalg.norm(ahead))
        if not abs(float(along @ ahead)) <= 1e-6 * size or size == 0.0:
            raise InputError("a front whose direction ahead is not across it")

    def _along(self) -> Array:
        return np.asarray(self.end, dtype=float) - np.asarray(self.start, dtype=float)

    @property
    def length(self) -> float:
        """Distance of the ends, m."""
        return float(np.linalg.norm(self._along()))

    def coordinates(self, points: Array) -> FrontCoordinates:
        """Give the coordinates of points (n, 3)."""
        along = self._along() / self.length
        ahead = np.asarray(self.ahead, dtype=float)
        ahead = ahead / np.linalg.norm(ahead)
        up = np.cross(along, ahead)
        local = (points - np.asarray(self.start, dtype=float)) @ np.stack([ahead, up, along]).T
        axes = np.broadcast_to(np.stack([ahead, up, along]), (len(points), 3, 3))
        return FrontCoordinates(local[:, 0], local[:, 1], local[:, 2], axes)

    def places(self, along: Array) -> Array:
        """Give the points (n, 3) of the front at arc lengths (n,), m."""
        return np.asarray(self.start, dtype=float) + np.outer(along, self._along() / self.length)


def front_at(scene: Scene, asked: FractureQuantity) -> tuple[Front, Array]:
    """Give the front around a point at which a factor is evaluated, and radii of domains, m.

    A straight front is the part of it that hats at the point lie on. The radii are 0 where the
    front meets something.
    """
    cut = _cut(scene, asked)
    assert isinstance(scene.geometry, Box)
    reach, point = front_reach(scene, asked), np.asarray(asked.point, dtype=float)
    if isinstance(cut, PolygonCut):
        box = np.array([scene.geometry.lower, scene.geometry.upper], dtype=float)
        return StraightFront(*_straight_part(cut, point, box)), reach * np.array(_STRAIGHT)
    spoke, radius = point - np.asarray(cut.centre), float(cut.radius or 0.0)
    front = CircularFront(cut.centre, cut.normal, radius, towards=spoke)
    return front, reach * np.array(_ROUND)


def station_count(front: Front) -> int:
    """Return the number of hats along a front that give the factor at a point of it."""
    return _STATIONS[0] if front.closed else _STATIONS[1]


def station_spacing(front: Front) -> float:
    """Distance of neighbouring hats, m; nodes farther apart leave one of them without a node."""
    return front.length / (station_count(front) + (0 if front.closed else 1))


def front_reach(scene: Scene, asked: FractureQuantity) -> float:
    """Compute the distance (m) from a front to what a domain must not meet; 0 if it meets it.

    Of a round front all of it counts; of a straight one what of it the hats at a point lie on.
    """
    cut = _cut(scene, asked)
    assert isinstance(scene.geometry, Box)
    lower, upper = np.asarray(scene.geometry.lower), np.asarray(scene.geometry.upper)
    others = [one for one in scene.final_cuts if one.name != asked.cut]
    if isinstance(cut, PolygonCut):
        return _straight_reach(cut, np.asarray(asked.point), np.array([lower, upper]), others)
    turn = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    first, second, _ = cut.axes()
    spokes = np.outer(np.cos(turn), first) + np.outer(np.sin(turn), second)
    front = np.asarray(cut.centre) + (cut.radius or 0.0) * spokes
    walls = np.concatenate([front - lower, upper - front], axis=1)
    away = distance_to_cuts(others, front).min(initial=np.inf)
    # between two of these places the front may meet a feature nearer than half their distance
    met = float(np.pi * (cut.radius or 0.0) / _AROUND)
    reach = min(float(cut.radius or 0.0), float(walls.min()), float(away))
    return reach if reach > met else 0.0


def _straight_part(cut: PolygonCut, point: Array, box: Array) -> tuple[Array, Array, Array]:
    """Give both ends (3,) of a part of an edge around a point, and the way ahead (3,).

    It ends short of the place where the edge ends or leaves the box. It runs along ahead × normal:
    seen from it, the positive side is up.
    """
    start, end = cut.edge_of(point)
    along = (end - start) / np.linalg.norm(end - start)
    place = start + ((point - start) @ along) * along
    half = min(np.linalg.norm(end - place), np.linalg.norm(place - start))
    for axis in np.flatnonzero(np.abs(along) > 0.0):
        ways = (box[:, axis] - place[axis]) / along[axis]
        half = min(half, *np.abs(ways))
    half *= _WAY
    ahead = np.cross(along, cut.normal)  # the inside is on the left of its edges
    return place + half * along, place - half * along, ahead


def _straight_reach(cut: PolygonCut, point: Array, box: Array, others: list[Any]) -> float:
    """Radius (m) of the cylinder around the part of a straight front that meets nothing else."""
    start, end, _ = _straight_part(cut, point, box)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length if length > 0.0 else np.zeros(3)
    walls = np.concatenate([np.minimum(start, end) - box[0], box[1] - np.maximum(start, end)])
    beside = np.tile(np.sqrt(np.maximum(1.0 - along**2, 0.0)), 2)
    slack = 1e-9 * float(np.linalg.norm(box[1] - box[0]))
    if length <= slack or walls.min() < -slack:
        return 0.0
    steep = beside > 1e-9
    reach = float((walls[steep] / beside[steep]).min(initial=np.inf))
    share = np.linspace(0.0, 1.0, _AROUND)[:, None]
    front = start + share * (end - start)
    reach = min(reach, float(distance_to_cuts(others, front).min(initial=np.inf)))
    corners = np.array(cut.points, dtype=float)
    edges = corners + share[:, None] * (np.roll(corners, -1, axis=0) - corners)
    off = edges.reshape(-1, 3) - start
    at = off @ along
    away = np.linalg.norm(off - at[:, None] * along, axis=1)
    beside_it = (at >= 0.0) & (at <= length) & (away > slack)  # the others than its own
    reach = min(reach, float(away[beside_it].min(initial=np.inf)))
    # between two of these places the front may meet a feature nearer than half their distance
    return reach if reach > 0.5 * length / (_AROUND - 1) else 0.0


def _cut(scene: Scene, asked: FractureQuantity) -> DiscCut | PolygonCut:
    cut = next(cut for cut in scene.final_cuts if cut.name == asked.cut)
    if not isinstance(cut, DiscCut | PolygonCut):
        raise InputError(f"cut '{asked.cut}' is neither a disc nor a polygon")
    return cut
