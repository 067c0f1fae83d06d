"""The front of a plane crack in space, and the coordinates that belong to it."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.errors import InputError

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
