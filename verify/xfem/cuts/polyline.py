"""A cut along a polyline in the plane: straight, kinked or a sampled curve; open or closed."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import places, real_array

__all__ = ["Polyline"]

_Floats = NDArray[np.float64]

_PAIRS_AT_ONCE = 2_000_000  # points × segments in one sweep: bounds memory to some 100 MB


@dataclass(frozen=True)
class Polyline:
    """A polyline in the plane.

    The positive side is on the left when one walks along it. Past an open end the level set is
    that of the last segment's line.

    Parameters
    ----------
    vertices : (k, 2) array_like
        Vertices in order, in metres.
    closed : bool
        Whether the last vertex is joined to the first.

    Raises
    ------
    XfemError
        If there are too few vertices, a segment without length, a segment that turns back on
        the one before, or segments that intersect.
    """

    vertices: _Floats
    closed: bool

    def __init__(self, vertices: ArrayLike, closed: bool = False) -> None:
        corners = real_array(vertices, "polyline with vertices")
        fewest = 3 if closed else 2
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < fewest:
            raise XfemError(f"polyline of shape {corners.shape}; expected (k, 2) with k ≥ {fewest}")
        if not np.isfinite(corners).all():
            raise XfemError("polyline with a vertex that is not finite")
        object.__setattr__(self, "vertices", corners)
        object.__setattr__(self, "closed", bool(closed))
        self._check_segments()

    @cached_property
    def _starts(self) -> _Floats:
        return self.vertices if self.closed else self.vertices[:-1]

    @cached_property
    def _segments(self) -> _Floats:
        return np.diff(self.vertices, axis=0, append=self.vertices[:1])[: len(self._starts)]

    @cached_property
    def _lengths(self) -> _Floats:
        return np.linalg.norm(self._segments, axis=1)

    @cached_property
    def _normals(self) -> _Floats:
        tangents = self._segments / self._lengths[:, None]
        return np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)

    def level_set(self, points: _Floats) -> _Floats:
        """Signed distance to the polyline, to its end tangents past its ends."""
        segment, share, offset = self._nearest(points)
        along = self._normals[segment]
        interior = (share > 0.0) & (share < 1.0)
        # at a kink the sum of both normals tells the side, and the distance is to the vertex
        vertex = segment + (share >= 1.0)
        kink = ~interior & (self.closed | ((vertex > 0) & (vertex < len(self._normals))))
        count = len(self._normals)
        pseudo = self._normals[(vertex - 1) % count] + self._normals[vertex % count]
        side = np.where((offset * pseudo).sum(axis=1) >= 0.0, 1.0, -1.0)
        distance = (offset * along).sum(axis=1)
        return np.where(kink, side * np.linalg.norm(offset, axis=1), distance)

    def depth(self, points: _Floats) -> _Floats:
        """Arc length to the nearer end, negative past it; infinite for a closed polyline."""
        if self.closed:
            return np.full(len(points), np.inf)
        segment, share, offset = self._nearest(points)
        walked = np.concatenate([[0.0], np.cumsum(self._lengths)])
        arc = walked[segment] + share * self._lengths[segment]
        tangent = self._segments[segment] / self._lengths[segment][:, None]
        # the part of the offset along the end tangent is how far past the end a point is
        beyond = (offset * tangent).sum(axis=1)
        arc = arc + np.where((arc <= 0.0) | (arc >= walked[-1]), beyond, 0.0)
        return np.minimum(arc, walked[-1] - arc)

    def _nearest(self, points: _Floats) -> tuple[NDArray[np.int64], _Floats, _Floats]:
        """Nearest segment, place on it in [0, 1], and the offset from there to the point."""
        points = places(points, 2, "polyline")
        chunk = max(1, _PAIRS_AT_ONCE // len(self._starts))
        parts = [self._nearest_of(points[i : i + chunk]) for i in range(0, len(points), chunk)]
        if not parts:
            return np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 2))
        segment, share, offset = (np.concatenate(column) for column in zip(*parts, strict=True))
        return segment, share, offset

    def _nearest_of(self, points: _Floats) -> tuple[NDArray[np.int64], _Floats, _Floats]:
        to_point = points[:, None, :] - self._starts
        share = np.clip((to_point * self._segments).sum(-1) / self._lengths**2, 0.0, 1.0)
        offsets = to_point - share[..., None] * self._segments
        segment = (offsets**2).sum(-1).argmin(axis=1)
        row = np.arange(len(points))
        return segment, share[row, segment], offsets[row, segment]

    def _check_segments(self) -> None:
        shortest = 1e-14 * np.abs(self.vertices).max()
        if not (self._lengths > shortest).all():
            raise XfemError(f"segment {int(self._lengths.argmin())} of the polyline has no length")
        t = self._segments / self._lengths[:, None]
        following = np.roll(t, -1, axis=0) if self.closed else t[1:]
        back = (t[: len(following)] * following).sum(axis=1) < -1.0 + 1e-12
        if back.any():
            raise XfemError(f"the polyline turns back on itself at vertex {int(back.argmax()) + 1}")
        pair = _first_intersection(self._starts, self._segments, self.closed)
        if pair is not None:
            raise XfemError(f"segments {pair[0]} and {pair[1]} of the polyline intersect")


def _first_intersection(starts: _Floats, segments: _Floats, closed: bool) -> tuple[int, int] | None:
    """First pair of segments, not neighbours, that have a point in common."""
    count = len(starts)
    ends = starts + segments
    for i in range(count - 2):
        others = slice(i + 2, count - 1 if closed and i == 0 else count)
        side_a = _cross(segments[i], starts[others] - starts[i])
        side_b = _cross(segments[i], ends[others] - starts[i])
        side_c = _cross(segments[others], starts[i] - starts[others])
        side_d = _cross(segments[others], ends[i] - starts[others])
        low_i, high_i = np.minimum(starts[i], ends[i]), np.maximum(starts[i], ends[i])
        low, high = np.minimum(starts, ends)[others], np.maximum(starts, ends)[others]
        boxes = ((low <= high_i) & (low_i <= high)).all(axis=1)
        meet = boxes & (side_a * side_b <= 0.0) & (side_c * side_d <= 0.0)
        if meet.any():
            return i, i + 2 + int(meet.argmax())
    return None


def _cross(a: _Floats, b: _Floats) -> _Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
