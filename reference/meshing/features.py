"""The straight and circular parts of a body's outline and cuts, and how close they come."""

from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from reference.meshing.outline import divided_outline
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene

Array = NDArray[np.float64]
_SAMPLES = 721  # of an arc, where its distance to another feature is measured


@dataclass(frozen=True)
class Feature:
    """A segment, or an arc (counter-clockwise) if it has a radius.

    Attributes
    ----------
    name : str
        In words, for messages.
    start, end : (2,) arrays
        m.
    centre : (2,) array, optional
    radius : float, optional
        m.
    sweep : float
        Angle covered by an arc, radians.
    """

    name: str
    start: Array
    end: Array
    centre: Array | None = None
    radius: float = 0.0
    sweep: float = 0.0

    def distance(self, points: Array) -> Array:
        """Distance (n,) of each of `points` (n, 2) to this feature, m."""
        if self.centre is None:
            along = self.end - self.start
            share = np.clip((points - self.start) @ along / (along @ along), 0.0, 1.0)
            away = points - self.start - share[:, None] * along
            return np.asarray(np.linalg.norm(away, axis=1))
        spoke = points - self.centre
        first = np.arctan2(*(self.start - self.centre)[::-1])
        angle = np.mod(np.arctan2(spoke[:, 1], spoke[:, 0]) - first, 2 * np.pi)
        ends = np.stack([self.start, self.end])
        nearest = np.linalg.norm(points[:, None] - ends, axis=2).min(axis=1)
        to_circle = np.abs(np.linalg.norm(spoke, axis=1) - self.radius)
        return np.where(angle <= self.sweep, to_circle, nearest)

    def samples(self, count: int = _SAMPLES) -> Array:
        """Points (n, 2) along the feature, both ends included."""
        t = np.linspace(0.0, 1.0, count)
        if self.centre is None:
            return np.asarray(self.start + t[:, None] * (self.end - self.start))
        first = np.arctan2(*(self.start - self.centre)[::-1])
        angle = first + t * self.sweep
        return self.centre + self.radius * np.column_stack([np.cos(angle), np.sin(angle)])

    @property
    def length(self) -> float:
        """Its length, m."""
        if self.centre is None:
            return float(np.linalg.norm(self.end - self.start))
        return self.radius * self.sweep

    def gap(self, other: "Feature") -> float:
        """Smallest distance to another feature, m; 0 where they cross."""
        if len(crossing_points([self, other])):
            return 0.0
        mine, others = (f.samples(2 if f.centre is None else _SAMPLES) for f in (self, other))
        return float(min(self.distance(others).min(), other.distance(mine).min()))


def plane_features(scene: Scene) -> list[Feature]:
    """Edges of the body, divided where the part a condition acts on ends, and parts of cuts."""
    assert isinstance(scene.geometry, Rectangle | Polygon)
    corners = divided_outline(scene)
    found = [
        Feature("the boundary", a, b) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)
    ]
    for cut in scene.final_cuts:
        name = f"cut '{cut.name}'"
        if isinstance(cut, PolylineCut):
            found += [Feature(name, a, b) for a, b in pairwise(cut.vertices())]
        else:
            assert isinstance(cut, ArcCut)
            stops = np.deg2rad(cut.start + cut.sweep * np.array([0.0, 0.5, 1.0]))
            centre = np.asarray(cut.centre, dtype=float)
            ends = centre + cut.radius * np.column_stack([np.cos(stops), np.sin(stops)])
            if cut.sweep == 360.0:
                ends[2] = ends[0]
            half = float(np.deg2rad(cut.sweep / 2))
            found += [Feature(name, a, b, centre, cut.radius, half) for a, b in pairwise(ends)]
    return found


def crossing_points(features: list[Feature]) -> Array:
    """Points (k, 2) where two of the features cross or touch, to round-off, m."""
    found = [np.zeros((0, 2))]
    for one, other in combinations(features, 2):
        if one.centre is None and other.centre is None:
            found.append(_segment_crossing(one, other))
        elif one.centre is None or other.centre is None:
            line, arc = (one, other) if one.centre is None else (other, one)
            found.append(_arc_crossings(line, arc))
    return np.concatenate(found)


def close_pairs(features: list[Feature], touching: float, below: float) -> list[tuple[int, int]]:
    """Pairs of features, one of them a cut, that come closer than `below` but do not touch.

    Two parts of one cut count only where it turns back on itself; else each vertex of a smooth
    curve given as a polyline would make a pair.
    """
    lengths = np.array([feature.length for feature in features])
    found = []
    for i, j in combinations(range(len(features)), 2):
        one, other = features[i], features[j]
        if other.name != "the boundary" and touching < one.gap(other) < below:
            between = float(lengths[i + 1 : j].sum())
            if one.name != other.name or _turns_back(one, other, between):
                found.append((i, j))
    return found


def _turns_back(one: Feature, other: Feature, between: float) -> bool:
    """Whether an end of one part of a cut is half as far from a later part as the way there."""
    ways = [
        (one.start, other, one.length + between),
        (one.end, other, between),
        (other.start, one, between),
        (other.end, one, other.length + between),
    ]
    return any(part.distance(point[None])[0] < 0.5 * way for point, part, way in ways)


def _segment_crossing(one: Feature, other: Feature) -> Array:
    u, v, w = one.end - one.start, other.end - other.start, other.start - one.start
    det = u[0] * v[1] - u[1] * v[0]
    if abs(det) <= 1e-14 * one.length * other.length:
        return np.zeros((0, 2))
    s = (w[0] * v[1] - w[1] * v[0]) / det
    t = (w[0] * u[1] - w[1] * u[0]) / det
    if not (-1e-12 <= s <= 1 + 1e-12 and -1e-12 <= t <= 1 + 1e-12):
        return np.zeros((0, 2))
    return np.asarray(one.start + s * u)[None]


def _arc_crossings(line: Feature, arc: Feature) -> Array:
    assert arc.centre is not None
    u, w = line.end - line.start, line.start - arc.centre
    a, b, c = u @ u, w @ u, w @ w - arc.radius**2
    if b * b - a * c < 0:
        return np.zeros((0, 2))
    s = (-b + np.array([-1.0, 1.0]) * np.sqrt(b * b - a * c)) / a
    points = line.start + s[(s >= -1e-12) & (s <= 1 + 1e-12), None] * u
    return np.asarray(points[arc.distance(points) <= 1e-9 * arc.radius])
