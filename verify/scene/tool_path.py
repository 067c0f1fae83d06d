"""A cut made by a tool on its way: where its tip is at what time, and in space how deep it reaches.

A facet of a conforming mesh is separated at the first step that begins after the blade has passed
all of it; so is an element of an unfitted mesh. Places passed before the time 0 are open from the
start.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, ValidationError

from verify.errors import InputError
from verify.geometry.curves import Piece
from verify.geometry.patches import Patch
from verify.geometry.planar import polyline_defect
from verify.scene.cuts import (
    ArcCut,
    CutShape,
    CylinderCut,
    DiscCut,
    Facets,
    PolygonCut,
    PolylineCut,
    SphereCut,
    SweptCut,
)
from verify.scene.strict import Finite, Point3, Positive, Rules, Vector, none_or_both

Array = NDArray[np.float64]
_SAME = 1e-9  # of a length: two this close are one
_IN_PLANE = "belongs to a path in space; the points are plane"
_IN_SPACE = "missing; in space the blade has a depth and a direction"
_SEARCHES = 20  # Newton steps to a place that a turning blade sweeps

Directions = Annotated[list[Point3], Field(min_length=1)]


class ToolPathCut(CutShape):
    """Points of the tool's tip in order, with times or a speed; in space a blade of some depth.

    The positive side is left of the path in the plane; in space it is where (direction of motion)
    × (direction of the blade) points.

    Attributes
    ----------
    points
        points of the tip in order, m
    times
        when the tip is at each point, s, before 0 too; or a speed
    speed
        of the tip, m/s; or times
    starts_at
        with a speed: when the tip is at its first point, s; before 0 too
    depth
        3D: length of the blade, m
    direction
        3D: where the blade points from the tip; one direction, or one per point
    """

    kind: Literal["tool_path"]
    points: list[Vector] = Field(min_length=2)
    times: list[Finite] | None = None
    speed: Positive | None = None
    starts_at: Finite = 0.0
    depth: Positive | None = None
    direction: Point3 | Directions | None = None
    expected: Literal["through", "edge", "inner"] | None = None

    on_the_way: ClassVar[bool] = True

    rules: ClassVar[Rules] = (
        ("points", lambda c: len({len(point) for point in c.points}) > 1,
         "some have 2 coordinates, others 3"),
        ("", none_or_both("times", "speed"), "a tool path has either times or a speed"),
        ("", lambda c: c.times is not None and len(c.times) != len(c.points)
         and (len(c.times), len(c.points)), "{} times for {} points"),
        ("times", lambda c: any(b < a for a, b in pairwise(c.times or [])), "time runs backwards"),
        ("", lambda c: c.times and c.starts_at,
         "starts_at belongs to a speed; times say when it starts"),
        ("depth", lambda c: c.dimension == 2 and c.depth is not None, _IN_PLANE),
        ("direction", lambda c: c.dimension == 2 and c.direction is not None, _IN_PLANE),
        ("depth", lambda c: c.dimension == 3 and c.depth is None, _IN_SPACE),
        ("direction", lambda c: c.dimension == 3 and c.direction is None, _IN_SPACE),
        ("direction", lambda c: c.dimension == 3
         and len(c._directions()) not in (1, len(c.points))
         and (len(c._directions()), len(c.points)),
         "{} for {} points; expected one, or one per point"),
        ("direction", lambda c: c.dimension == 3
         and not np.linalg.norm(c._directions(), axis=1).all(), "has no length"),
        ("points", lambda c: not np.linalg.norm(np.diff(c._tips(), axis=0), axis=1).any(),
         "the tool does not move"),
        ("", lambda c: c.dimension == 2 and polyline_defect(c.vertices()),
         "the path {}; begin another tool_path there"),
    )  # fmt: skip

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return len(self.points[0])

    @property
    def moments(self) -> Array:
        """(n,) when the tip is at each point, in s."""
        if self.times is not None:
            return np.array(self.times, dtype=float)
        assert self.speed is not None
        steps = np.linalg.norm(np.diff(self._tips(), axis=0), axis=1)
        return self.starts_at + np.concatenate([[0.0], np.cumsum(steps)]) / self.speed

    @property
    def opens_at(self) -> float:
        """When the tip is at its first point, in s."""
        return float(self.moments[0])

    @property
    def ends_at(self) -> float:
        """When the tip is at its last point, in s."""
        return float(self.moments[-1])

    @property
    def blade(self) -> Array:
        """(n, 3) vector from the tip to the other end of the blade at each point, in m."""
        directions = self._directions()
        lengths = np.linalg.norm(directions, axis=1, keepdims=True)
        blade = (self.depth or 0.0) * directions / lengths
        return np.broadcast_to(blade, (len(self.points), 3)).copy()

    @property
    def travel(self) -> Array:
        """(n,) way of the blade up to each point, m: of the end that goes farther."""
        tips, blades = self._tips(), self._blades()
        moves = [np.linalg.norm(np.diff(end, axis=0), axis=1) for end in (tips, tips + blades)]
        return np.concatenate([[0.0], np.cumsum(np.max(moves, axis=0))])

    @property
    def top_speed(self) -> float:
        """Largest speed of an end of the blade, m/s."""
        lasting = np.diff(self.moments) > 0.0
        return float(np.max(np.diff(self.travel)[lasting] / np.diff(self.moments)[lasting]))

    def vertices(self, spacing: float | None = None) -> Array:
        """Points (n, d) of the tip, each once; `spacing` does not matter to straight segments."""
        tips = self._tips()
        moves = np.linalg.norm(np.diff(tips, axis=0), axis=1) > 0.0
        return tips[np.concatenate([[True], moves])]

    def facets(self, spacing: float | None = None) -> Facets:
        """Divide what the blade sweeps into segments or triangles."""
        return self.whole().facets(spacing)

    def pieces(self) -> Sequence[Piece | Patch]:
        """Return the pieces of what the blade sweeps."""
        return self.whole().pieces()

    def whole(self) -> PolylineCut | SweptCut | PolygonCut:
        """Return the final cut, all that the blade sweeps, on the same side.

        Raises
        ------
        InputError
            If the blade turns on its way and sweeps no plane: no other kind of cut is that.
        """
        return self._made(self._tips(), self._blades())

    def between(self, start: float, end: float) -> PolylineCut | SweptCut | PolygonCut | None:
        """Return what the blade sweeps after one time until another, s; None if it rests.

        Raises
        ------
        InputError
            As `whole`.
        """
        moments, ends = self.moments, np.hstack([self._tips(), self._blades()])

        def at(time: float) -> tuple[int, Array]:
            k = int(np.searchsorted(moments, time, side="right"))
            if not 0 < k < len(moments):
                return k, ends[:0]
            share = (time - moments[k - 1]) / (moments[k] - moments[k - 1])
            return k, ends[k - 1 : k] + share * (ends[k] - ends[k - 1])

        (first, before), (last, after) = at(start), at(end)
        way = np.concatenate([before, ends[first:last], after])
        if not len(way) or not np.ptp(way, axis=0).any():
            return None
        return self._made(*np.hsplit(way, 2))

    def _made(self, tips: Array, blades: Array) -> PolylineCut | SweptCut | PolygonCut:
        """Return the cut that a blade sweeps from place to place, tips and blades (n, d)."""
        shared: dict[str, Any] = {"name": self.name, "expected": self.expected}
        moved = np.append(True, np.diff(tips, axis=0).any(axis=1))
        points: list[Any] = [tuple(map(float, tip)) for tip in tips[moved]]
        if self.dimension == 2:
            return PolylineCut(kind="polyline", points=points, **shared)
        try:
            if np.allclose(blades, blades[0], rtol=0.0, atol=_SAME * (self.depth or 0.0)):
                x, y, z = map(float, blades[0])
                return SweptCut(kind="swept", points=points, along=(x, y, z), **shared)
            outline = [*tips, *(tips + blades)[::-1]]
            corners: list[Any] = [tuple(map(float, point)) for point in _distinct(outline)]
            return PolygonCut(kind="polygon", points=corners, **shared)
        except ValidationError as error:
            reason = str(error.errors()[0]["msg"]).removeprefix("Value error, ")
            raise InputError(
                f"cut '{self.name}': what the blade sweeps is no cut to be solved with: {reason}; "
                "expected a blade that keeps its direction, or sweeps a plane"
            ) from None

    def passed_at(self, points: Array) -> Array:
        """Give the times (n,) in s at which the blade is first at points (n, d) of the cut, in m.

        A point off the cut has the time of the nearest place that the search finds on it; one past
        the end the time at which the blade would be there, if it went on.
        """
        tips, moments, blades = self._tips(), self.moments, self._blades()
        points = np.asarray(points, dtype=float)
        nearest = np.full(len(points), np.inf)
        times = np.full(len(points), np.inf)
        still = np.all(tips[1:] == tips[:-1], axis=1) & np.all(blades[1:] == blades[:-1], axis=1)
        moves = np.flatnonzero(~still)
        for k in moves:
            share, distance, beyond = _place_in_patch(points, tips[k : k + 2], blades[k : k + 2])
            if k == moves[-1]:
                share += beyond
            closer = distance < nearest - _SAME * np.linalg.norm(np.ptp(tips, axis=0))
            nearest = np.where(closer, distance, nearest)
            reached = moments[k] + share * (moments[k + 1] - moments[k])
            times = np.where(closer, reached, times)
        return times

    def _blades(self) -> Array:
        """Blade (n, d) of any dimension; in the plane it is a point."""
        return self.blade if self.dimension == 3 else np.zeros((len(self.points), 2))

    def _tips(self) -> Array:
        return np.array(self.points, dtype=float)

    def _directions(self) -> Array:
        return np.array(self.direction, dtype=float).reshape(-1, 3)


def _place_in_patch(points: Array, tips: Array, blades: Array) -> tuple[Array, Array, Array]:
    """Share (n,) of a move at which the blade is nearest to points, and its distance (n,) then.

    The move sweeps tip(s) + r · blade(s), both linear in s, with s and r from 0 to 1. The third is
    by how much s would be above 1 (n,), at most 1.
    """
    tip, move = tips[0], tips[1] - tips[0]
    blade, turn = blades[0], blades[1] - blades[0]
    s, r = np.full(len(points), 0.5), np.full(len(points), 0.5)
    for _ in range(_SEARCHES):
        along = move + r[:, None] * turn
        across = blade + s[:, None] * turn
        left = points - tip - s[:, None] * move - r[:, None] * across
        a, b, c = _dot(along, along), _dot(along, across), _dot(across, across)
        f, g = _dot(along, left), _dot(across, left)
        flat = a * c - b * b <= _SAME**2 * a * c  # in the plane, where the blade is a point
        determinant = np.where(flat, 1.0, a * c - b * b)
        s_new = s + np.where(flat, f / np.where(a > 0.0, a, 1.0), (c * f - b * g) / determinant)
        r_new = r + np.where(flat, 0.0, (a * g - b * f) / determinant)
        s, r = np.clip(s_new, -1.0, 2.0), np.clip(r_new, -1.0, 2.0)
    beyond = np.maximum(s - 1.0, 0.0)
    s, r = np.clip(s, 0.0, 1.0), np.clip(r, 0.0, 1.0)
    place = tip + s[:, None] * move + r[:, None] * (blade + s[:, None] * turn)
    return s, np.linalg.norm(points - place, axis=1), beyond


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("nd,nd->n", a, b)


def _distinct(points: list[Array]) -> list[Array]:
    """Leave out points that repeat the one before them, round and round."""
    pairs = zip(points, [points[-1], *points], strict=False)
    return [point for point, before in pairs if (point != before).any()]


Cut = Annotated[
    PolylineCut | ArcCut | PolygonCut | DiscCut | CylinderCut | SphereCut | SweptCut | ToolPathCut,
    Field(discriminator="kind"),
]
