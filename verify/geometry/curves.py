"""Plane pieces of curves, segments and arcs, and where they meet.

As parts of a cut they are what was asked for: an arc stays an arc, it is not cut into facets.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.geometry.simplices import shares

Array = NDArray[np.float64]

# parameters this far outside [0, 1] still count as an end: round-off of an intersection
_END = 1e-12


@dataclass(frozen=True)
class Segment:
    """The straight piece from `start` to `end`; its normal points to the left."""

    start: Array
    end: Array
    curvature = 0.0  # 1/m

    @property
    def length(self) -> float:
        """Length, m."""
        return float(np.linalg.norm(self.end - self.start))

    def point(self, t: Array) -> Array:
        """Points (n, 2) at parameters `t` (n,) in [0, 1]."""
        t = np.asarray(t, dtype=float)[:, None]
        return (1 - t) * self.start + t * self.end

    def tangent(self, t: Array) -> Array:
        """Return unit tangents (n, 2)."""
        direction = (self.end - self.start) / self.length
        return np.tile(direction, (len(t), 1))

    def facing(self, points: Array) -> Array:
        """Return unit normals (n, 2), to the left, at points (n, 2) of it."""
        x, y = (self.end - self.start) / self.length
        return np.tile([-y, x], (len(points), 1))

    def nearest(self, points: Array) -> Array:
        """Parameters (n,) of the nearest points to `points` (n, 2)."""
        return shares(points, self.start, self.end)

    def foot(self, points: Array) -> Array:
        """Nearest points (n, 2) to `points` (n, 2)."""
        return self.point(self.nearest(points))

    def level(self, points: Array) -> Array:
        """Distance (n,) from the whole line, m, positive on the left."""
        x, y = (self.end - self.start) / self.length
        return np.asarray(x * (points[:, 1] - self.start[1]) - y * (points[:, 0] - self.start[0]))

    def rotated(self, turn: Array) -> "Segment":
        """Rotate by the matrix `turn` (2, 2)."""
        return Segment(turn @ self.start, turn @ self.end)


@dataclass(frozen=True)
class Arc:
    """The counter-clockwise arc over angles `start` to `start + sweep`; normal to the centre."""

    centre: Array
    radius: float
    start_angle: float
    sweep: float

    @property
    def length(self) -> float:
        """Length, m."""
        return self.radius * self.sweep

    @property
    def closed(self) -> bool:
        """Whether it has no ends."""
        return self.sweep >= 2 * np.pi

    @property
    def curvature(self) -> float:
        """One over the radius, 1/m."""
        return 1.0 / self.radius

    def facing(self, points: Array) -> Array:
        """Return unit normals (n, 2), to the centre, at points (n, 2) of it."""
        return np.asarray((self.centre - points) / self.radius)

    def point(self, t: Array) -> Array:
        """Points (n, 2) at parameters `t` (n,) in [0, 1]."""
        angle = self.start_angle + self.sweep * np.asarray(t, dtype=float)
        return self.centre + self.radius * np.column_stack([np.cos(angle), np.sin(angle)])

    def tangent(self, t: Array) -> Array:
        """Return unit tangents (n, 2)."""
        angle = self.start_angle + self.sweep * np.asarray(t, dtype=float)
        return np.column_stack([-np.sin(angle), np.cos(angle)])

    def nearest(self, points: Array) -> Array:
        """Parameters (n,) of the nearest points to `points` (n, 2)."""
        offset = points - self.centre
        turned = np.mod(np.arctan2(offset[:, 1], offset[:, 0]) - self.start_angle, 2 * np.pi)
        beyond = turned > self.sweep
        nearer_start = 2 * np.pi - turned < turned - self.sweep
        t: Array = np.where(beyond, np.where(nearer_start, 0.0, 1.0), turned / self.sweep)
        return t

    def foot(self, points: Array) -> Array:
        """Nearest points (n, 2) to `points` (n, 2)."""
        return self.point(self.nearest(points))

    def level(self, points: Array) -> Array:
        """Distance (n,) from the whole circle, m, positive on the side of the centre."""
        return np.asarray(self.radius - np.linalg.norm(points - self.centre, axis=1))

    def depth(self, points: Array) -> Array:
        """Distance (n,) to the nearer end along the arc, m, negative beyond it."""
        x, y = (points - self.centre).T
        half = self.sweep / 2.0
        turn = np.angle(np.exp(1j * (np.arctan2(y, x) - self.start_angle - half)))
        return np.asarray(self.radius * (half - np.abs(turn)))

    def rotated(self, turn: Array) -> "Arc":
        """Rotate by the matrix `turn` (2, 2)."""
        angle = float(np.arctan2(turn[1, 0], turn[0, 0]))
        return Arc(turn @ self.centre, self.radius, self.start_angle + angle, self.sweep)


Piece = Segment | Arc


def closed_pieces(corners: Array) -> list[Piece]:
    """Edges of the closed polygon `corners` (n, 2)."""
    return [Segment(a, b) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)]


def meeting_parameters(one: Piece, other: Piece) -> Array:
    """Parameters (k,) on `one` of its points on `other`; of an overlap its ends."""
    match one, other:
        case Segment(), Segment():
            return _segment_segment(one, other)
        case Segment(), Arc():
            return _segment_arc(one, other)
        case Arc(), Segment():
            return _on_arc(one, other.point(_segment_arc(other, one)))
    assert isinstance(one, Arc)
    assert isinstance(other, Arc)
    return _arc_arc(one, other)


def _segment_segment(one: Segment, other: Segment) -> Array:
    u, v, w = one.end - one.start, other.end - other.start, other.start - one.start
    det = u[0] * v[1] - u[1] * v[0]
    found = [float(s) for p in (other.start, other.end) if (s := _foot(one, p)) is not None]
    if abs(det) > 1e-15 * one.length * other.length:
        s = (w[0] * v[1] - w[1] * v[0]) / det
        t = (w[0] * u[1] - w[1] * u[0]) / det
        if -_END <= s <= 1 + _END and -_END <= t <= 1 + _END:
            found.append(s)
    return np.clip(np.array(found), 0.0, 1.0)


def _foot(one: Segment, point: Array) -> float | None:
    """Parameter of `point` on the segment, or None if it is not on it."""
    t = one.nearest(point[None])
    off = float(np.linalg.norm(one.point(t)[0] - point))
    return float(t[0]) if off <= _END * one.length else None


def _segment_arc(one: Segment, other: Arc) -> Array:
    u, w = one.end - one.start, one.start - other.centre
    a, b, c = u @ u, w @ u, w @ w - other.radius**2
    root = b * b - a * c
    if root < -_END * a * other.radius**2:
        return np.zeros(0)
    half = float(np.sqrt(max(float(root), 0.0)))
    t = np.array([-b - half, -b + half]) / a
    t = t[(t >= -_END) & (t <= 1 + _END)]
    kept = [s for s in t if len(_on_arc(other, one.point(np.array([s]))))]
    return np.clip(np.array(kept), 0.0, 1.0)


def _arc_arc(one: Arc, other: Arc) -> Array:
    between = other.centre - one.centre
    d = float(np.linalg.norm(between))
    if d == 0.0 or d > one.radius + other.radius or d < abs(one.radius - other.radius):
        return np.zeros(0)
    along = (d * d + one.radius**2 - other.radius**2) / (2 * d)
    across = np.sqrt(max(one.radius**2 - along**2, 0.0))
    e = between / d
    normal = np.array([-e[1], e[0]])
    points = one.centre + along * e + np.array([[across], [-across]]) * normal
    return _on_arc(one, points[[len(_on_arc(other, p[None])) > 0 for p in points]])


def _on_arc(arc: Arc, points: Array) -> Array:
    """Parameters of the `points` on the arc's circle that lie within its sweep."""
    offset = points - arc.centre
    turned = np.mod(np.arctan2(offset[:, 1], offset[:, 0]) - arc.start_angle, 2 * np.pi)
    turned = np.where(turned > 2 * np.pi - _END, 0.0, turned) / arc.sweep
    kept: Array = np.clip(turned[turned <= 1 + _END], 0.0, 1.0)
    return kept
