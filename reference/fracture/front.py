"""Fronts of plane cracks in space, their coordinates, and the parts that domains fit around."""

from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.errors import InputError
from verify.scene import Box, DiscCut, PolygonCut, Scene
from verify.scene.acceptance import FractureQuantity
from verify.scene.cuts import distance_to_cuts

Array = NDArray[np.float64]


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

    Its arc length starts in the direction `towards`, by default that of a coordinate axis.
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
        normal = np.asarray(self.normal, dtype=float)
        normal = normal / np.linalg.norm(normal)
        first = np.eye(3)[np.argmin(np.abs(normal))]
        if self.towards is not None:
            first = np.asarray(self.towards, dtype=float)
        first = first - (first @ normal) * normal
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(normal, first), normal])


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


# Radii of the domains, of the reach: a straight front has no axis that they must stay away from.
_ROUND, _STRAIGHT = (0.5, 0.65, 0.8), (0.6, 0.75, 0.9)
_AROUND = 64  # places on the front from which distances are taken
_STATIONS = (12, 3)  # hats of 30 degrees along a round front; along a straight one
# Of the way to the nearer end of a straight front: where it meets a wall at an angle, a domain
# that went all the way would leave the body on one side.
_WAY = 0.75


def front_at(scene: Scene, asked: FractureQuantity) -> tuple[Front, Array]:
    """Give the front around a point at which a factor is asked for, and radii of domains, m.

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
    """Distance (m) from a front to what a domain must not meet; 0 if it meets it.

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
    # between two of these places the front may meet what is nearer than half their distance
    met = float(np.pi * (cut.radius or 0.0) / _AROUND)
    reach = min(float(cut.radius or 0.0), float(walls.min()), float(away))
    return reach if reach > met else 0.0


def _straight_part(cut: PolygonCut, point: Array, box: Array) -> tuple[Array, Array, Array]:
    """Give both ends (3,) of a part of an edge around a point, and the way ahead (3,).

    It ends short of where the edge does or leaves the box, whichever is nearer, and runs along
    ahead × normal: what is up, seen from it, is the positive side.
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
    # between two of these places the front may meet what is nearer than half their distance
    return reach if reach > 0.5 * length / (_AROUND - 1) else 0.0


def _cut(scene: Scene, asked: FractureQuantity) -> DiscCut | PolygonCut:
    cut = next(cut for cut in scene.final_cuts if cut.name == asked.cut)
    if not isinstance(cut, DiscCut | PolygonCut):
        raise InputError(f"cut '{asked.cut}' is neither a disc nor a polygon")
    return cut
