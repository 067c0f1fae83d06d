"""Cuts: geometric objects in the material frame, a class per kind.

In the plane polylines and arcs; in space polygons, discs, parts of cylinders and spheres, swept
polylines. A tool path (`verify.scene.tool_path`) is one of these in the end.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, field_validator

from verify.geometry.curves import Arc, Piece, Segment
from verify.geometry.patches import CylinderPatch, DiscPatch, Patch, PlanePatch, SpherePatch
from verify.geometry.planar import polygon_defect, polyline_defect
from verify.geometry.simplices import ear_clipping, feet, frame, nearest_parts, unit_normals
from verify.scene.strict import (
    Finite,
    Line,
    NonNegative,
    Point2,
    Point3,
    Positive,
    Rules,
    Strict,
    none_or_both,
    one_alone,
)

Array = NDArray[np.float64]
Facets = tuple[Array, NDArray[np.int64]]

_TURN = 64  # points on a full circle in space, without a given spacing


class CutShape(Strict):
    """What every kind of cut answers.

    Attributes
    ----------
    toughness
        of a tool_path: energy that cutting takes, J/m²
    """

    name: Line = "cut"
    toughness: Positive | None = None

    on_the_way: ClassVar[bool] = False  # whether a tool makes it, place by place
    faceted: ClassVar[bool] = False  # whether its facets are the cut itself, however few

    @field_validator("toughness")
    @classmethod
    def _of_a_blade(cls, toughness: float | None) -> float | None:
        if toughness is not None and not cls.on_the_way:
            raise ValueError("no blade makes this cut; expected it with kind = 'tool_path' alone")
        return toughness

    def whole(self) -> Any:
        """Return the cut that is there in the end."""
        return self

    def pieces(self) -> Sequence[Piece | Patch]:
        """Return its parts as they are, not cut into facets; normals into the positive side."""
        raise NotImplementedError

    def facets(self, spacing: float | None = None) -> Facets:
        """Divide the cut into segments or triangles.

        Parameters
        ----------
        spacing : float, optional
            Largest distance of points along curved directions, m; default a 64th of a turn in
            space, a 256th in the plane.

        Returns
        -------
        points : (n, d) array
            On the cut.
        facets : (m, d) int array
            Segments in order; triangles anticlockwise seen from the positive side.
        """
        raise NotImplementedError

    @property
    def plane_normal(self) -> Array | None:
        """Unit normal (d,) to the positive side, of a cut that is one part of a line or plane."""
        first, *more = self.pieces()
        if more or first.curvature:
            return None
        return np.asarray(first.facing(self.facets()[0][:1])[0])


class _Fixed(CutShape):
    """A cut that opens at once.

    Attributes
    ----------
    opens_at
        time at which it opens, s
    """

    opens_at: NonNegative = 0.0

    def passed_at(self, points: Array) -> Array:
        """Return the times (n,) at which it opens at points (n, d) of it, s."""
        return np.full(len(points), self.opens_at)


class _PlaneCut(_Fixed):
    """A cut in the plane.

    Attributes
    ----------
    expected
        how it meets the body: checked if given (through: both ends outside or on the boundary;
        edge: one end; inner: none)
    """

    expected: Literal["through", "edge", "inner"] | None = None

    dimension: ClassVar[int] = 2

    def vertices(self, spacing: float | None = None) -> Array:
        """Points (n, 2) along it, in order; the last is the first of a closed one."""
        raise NotImplementedError

    def facets(self, spacing: float | None = None) -> Facets:
        """Divide it into segments between its `vertices`."""
        points = self.vertices(spacing)
        along = np.arange(len(points) - 1)
        return points, np.column_stack([along, along + 1])


class PolylineCut(_PlaneCut):
    """A polyline in the plane; what lies left of its direction is its positive side.

    Attributes
    ----------
    points
        points in order, m
    """

    kind: Literal["polyline"]
    points: list[Point2] = Field(min_length=2)

    faceted: ClassVar[bool] = True
    rules: ClassVar[Rules] = (
        ("", lambda c: polyline_defect(c.vertices()), "the polyline {}"),
    )  # fmt: skip

    def vertices(self, spacing: float | None = None) -> Array:
        """Vertices (n, 2) of the polyline; `spacing` does not matter to straight segments."""
        return np.array(self.points, dtype=float)

    def pieces(self) -> list[Piece]:
        """Return its segments, in order."""
        return [Segment(a, b) for a, b in pairwise(self.vertices())]


class ArcCut(_PlaneCut):
    """A circular arc in the plane, counter-clockwise; its centre is on the positive side.

    Attributes
    ----------
    centre
        m
    radius
        m
    start
        angle of the first end, degrees
    sweep
        angle covered, degrees
    """

    kind: Literal["arc"]
    centre: Point2
    radius: Positive
    start: Finite = 0.0
    sweep: float = Field(strict=True, default=360.0, gt=0.0, le=360.0)

    @property
    def closed(self) -> bool:
        """Whether it is a circle."""
        return self.sweep == 360.0

    def vertices(self, spacing: float | None = None) -> Array:
        """Points (n, 2) on the arc, at most `spacing` apart (default: a 256th of a turn)."""
        (arc,) = self.pieces()
        step = spacing or 2 * np.pi * self.radius / 256
        n = max(4, int(np.ceil(arc.length / step)))
        ring = arc.point(np.arange(n + 1) / n)
        if self.closed:
            ring[-1] = ring[0]
        return ring

    def pieces(self) -> list[Piece]:
        """Return the arc itself, which is not cut into facets."""
        centre = np.array(self.centre, dtype=float)
        return [Arc(centre, self.radius, np.deg2rad(self.start), np.deg2rad(self.sweep))]


class _SpatialCut(_Fixed):
    """A cut in space.

    Attributes
    ----------
    expected
        how it meets the body: checked if given (through: its rim is nowhere inside the body; edge:
        partly; inner: everywhere)
    """

    expected: Literal["through", "edge", "inner"] | None = None

    dimension: ClassVar[int] = 3


class PolygonCut(_SpatialCut):
    """A plane polygon in space; its normal follows the right-hand rule.

    Attributes
    ----------
    points
        corners in order, m
    """

    kind: Literal["polygon"]
    points: list[Point3] = Field(min_length=3)

    faceted: ClassVar[bool] = True
    rules: ClassVar[Rules] = (("", lambda c: _defect_of_corners(c.points), "{}"),)

    def facets(self, spacing: float | None = None) -> Facets:
        """Triangulate the polygon; `spacing` does not matter to a plane."""
        corners = np.array(self.points, dtype=float)
        return corners, ear_clipping(corners)

    def pieces(self) -> list[Patch]:
        """Return it as one piece of a plane."""
        corners, triangles = self.facets()
        return [PlanePatch.of(corners[triangles], self.normal)]

    @property
    def normal(self) -> Array:
        """Unit normal (3,), to the positive side: that from which the corners run anticlockwise."""
        corners = np.array(self.points, dtype=float)
        area = np.sum(np.cross(corners, np.roll(corners, -1, axis=0)), axis=0)
        return np.asarray(area / np.linalg.norm(area))

    def edge_of(self, point: Array) -> tuple[Array, Array]:
        """Start and end (3,) of the edge nearest to a point (3,)."""
        corners = np.array(self.points, dtype=float)
        ends = np.roll(corners, -1, axis=0)
        nearest = int(np.argmin(np.linalg.norm(point - feet(point, corners, ends), axis=1)))
        return corners[nearest], ends[nearest]


class DiscCut(_SpatialCut):
    """A plane disc or ellipse in space.

    Attributes
    ----------
    centre
        m
    normal
        to the positive side; of any length
    radius
        of a circle, m
    radii
        semi-axes of an ellipse, m, the first along `axis`
    axis
        direction of the first semi-axis, projected onto the plane
    """

    kind: Literal["disc"]
    centre: Point3
    normal: Point3
    radius: Positive | None = None
    radii: tuple[Positive, Positive] | None = None
    axis: Point3 | None = None

    rules: ClassVar[Rules] = (
        ("", lambda c: not np.linalg.norm(c.normal), "the normal of the disc is zero"),
        ("", none_or_both("radius", "radii"), "a disc has either a radius or radii with an axis"),
        ("", one_alone("radii", "axis"), "radii and axis go together"),
        ("", lambda c: _along(c.axis, c.normal), "axis {} is zero or parallel to the normal"),
    )  # fmt: skip

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Both semi-axes, m; equal for a circle."""
        return self.radii or (self.radius or 0.0, self.radius or 0.0)

    def axes(self) -> Array:
        """First semi-axis, second semi-axis and normal, as rows (3, 3) of length one."""
        return frame(self.normal, self.axis)

    def facets(self, spacing: float | None = None) -> Facets:
        """Triangulate the disc as a fan about its centre."""
        count = _points_per_turn(max(self.semi_axes), spacing)
        i = np.arange(count)
        (disc,) = self.pieces()
        rim = disc.point(np.column_stack([np.ones(count), 2.0 * np.pi * i / count]))
        return np.vstack([self.centre, rim]), np.column_stack([0 * i, 1 + i, 1 + (i + 1) % count])

    def pieces(self) -> list[Patch]:
        """Return the disc itself."""
        return [DiscPatch(np.array(self.centre, dtype=float), self.axes(), self.semi_axes)]


class CylinderCut(_SpatialCut):
    """A part of a cylinder's mantle; its axis is on the positive side.

    Attributes
    ----------
    base
        point of the axis at the lower end, m
    axis
        direction of the axis, from the base; of any length
    radius
        m
    height
        along the axis, m
    towards
        direction of the angle 0, projected; needed for a sector
    start
        angle at which the sector starts, degrees
    sweep
        angle covered, degrees
    """

    kind: Literal["cylinder"]
    base: Point3
    axis: Point3
    radius: Positive
    height: Positive
    towards: Point3 | None = None
    start: Finite = 0.0
    sweep: float = Field(strict=True, default=360.0, gt=0.0, le=360.0)

    rules: ClassVar[Rules] = (
        ("", lambda c: not np.linalg.norm(c.axis), "the axis of the cylinder is zero"),
        ("", lambda c: _along(c.towards, c.axis), "towards {} is zero or parallel to the axis"),
        ("", lambda c: c.towards is None and not c.closed,
         "a sector needs the direction of its angle 0: towards = [x, y, z]"),
    )  # fmt: skip

    @property
    def closed(self) -> bool:
        """Whether it goes all around."""
        return self.sweep == 360.0

    def axes(self) -> Array:
        """Directions of the angles 0° and 90°, and of the axis, as rows (3, 3) of length one."""
        return frame(self.axis, self.towards)

    def facets(self, spacing: float | None = None) -> Facets:
        """Triangulate the sector in strips parallel to the axis."""
        count = max(2, int(np.ceil(_points_per_turn(self.radius, spacing) * self.sweep / 360.0)))
        steps = np.arange(count if self.closed else count + 1)
        (mantle,) = self.pieces()
        ring = mantle.point(np.column_stack([steps / count, 0.0 * steps]))
        # the axis is on the positive side: seen from there, the mantle is passed clockwise
        return _strips(ring, self.height * self.axes()[2], self.closed, inward=True)

    def pieces(self) -> list[Patch]:
        """Return the part of the mantle itself."""
        start, sweep = np.deg2rad(self.start), np.deg2rad(self.sweep)
        arc = Arc(np.zeros(2), self.radius, float(start), float(sweep))
        return [CylinderPatch(np.array(self.base, dtype=float), self.axes(), arc, self.height)]


class SphereCut(_SpatialCut):
    """A sphere or a cap of one; its centre is on the positive side.

    Attributes
    ----------
    centre
        m
    radius
        m
    towards
        direction of the cap's pole; of any length
    opening
        angle between the pole and the cap's rim, degrees; 180: the whole sphere
    """

    kind: Literal["sphere"]
    centre: Point3
    radius: Positive
    towards: Point3 = (0.0, 0.0, 1.0)
    opening: float = Field(strict=True, default=180.0, gt=0.0, le=180.0)

    rules: ClassVar[Rules] = (
        ("", lambda c: not np.linalg.norm(c.towards), "the direction of the cap's pole is zero"),
    )  # fmt: skip

    @property
    def closed(self) -> bool:
        """Whether it is the whole sphere."""
        return self.opening == 180.0

    def axes(self) -> Array:
        """Two directions across the pole's, and the pole's, as rows (3, 3) of length one."""
        return frame(self.towards)

    def facets(self, spacing: float | None = None) -> Facets:
        """Triangulate the cap in rings about its pole."""
        around = _points_per_turn(self.radius, spacing)
        steps = max(2, int(np.ceil(around * self.opening / 360.0)))
        polar = np.deg2rad(self.opening) * np.arange(1, steps + (not self.closed)) / steps
        turn = 2.0 * np.pi * np.arange(around) / around
        (cap,) = self.pieces()
        rings = [cap.point(np.column_stack([np.full(around, p), turn])) for p in polar]
        poles = cap.point(np.array([[0.0, 0.0], [np.pi, 0.0]] if self.closed else [[0.0, 0.0]]))
        points = np.concatenate([*rings, poles])
        # seen from the centre the rings are passed clockwise
        i, count = np.arange(around), len(polar)
        j = (i + 1) % around
        triangles = [np.column_stack([j, i, np.full(around, count * around)])]
        for k in range(count - 1):
            a, b = k * around, (k + 1) * around
            triangles += [np.column_stack([a + i, a + j, b + j])]
            triangles += [np.column_stack([a + i, b + j, b + i])]
        if self.closed:
            last = (count - 1) * around
            triangles += [np.column_stack([last + i, last + j, np.full(around, len(points) - 1)])]
        return points, np.concatenate(triangles)

    def pieces(self) -> list[Patch]:
        """Return the cap itself."""
        centre, opening = np.array(self.centre, dtype=float), float(np.deg2rad(self.opening))
        return [SpherePatch(centre, self.axes(), self.radius, opening)]


class SweptCut(_SpatialCut):
    """A polyline in space, swept along a vector; points × along is on its positive side.

    Attributes
    ----------
    points
        points in order, m; the last equal to the first closes it
    along
        from the polyline to the opposite rim, m
    """

    kind: Literal["swept"]
    points: list[Point3] = Field(min_length=2)
    along: Point3

    faceted: ClassVar[bool] = True
    rules: ClassVar[Rules] = (
        ("", lambda c: not np.linalg.norm(c.along), "along is zero: the polyline is not swept"),
        ("", lambda c: c._segments_along(),
         "segment {0[0]} is parallel to `along`: it sweeps no area"),
        ("", lambda c: polyline_defect(c._seen()), "the polyline, seen along the sweep, {}"),
    )  # fmt: skip

    def _seen(self) -> Array:
        """Points (n, 2) of the polyline as seen along the sweep."""
        return np.array(self.points, dtype=float) @ frame(self.along)[:2].T

    def _segments_along(self) -> list[int]:
        """Numbers of the segments that are parallel to the sweep."""
        steps = np.linalg.norm(np.diff(np.array(self.points, dtype=float), axis=0), axis=1)
        across = np.linalg.norm(np.diff(self._seen(), axis=0), axis=1)
        return np.flatnonzero(across <= 1e-9 * np.maximum(steps, 1e-300)).tolist()

    @property
    def closed(self) -> bool:
        """Whether it is swept into a tube."""
        return self.points[0] == self.points[-1]

    def facets(self, spacing: float | None = None) -> Facets:
        """Triangulate the sweep, two triangles per segment; `spacing` does not matter."""
        points = np.array(self.points, dtype=float)
        line = points[:-1] if self.closed else points
        return _strips(line, np.array(self.along), self.closed, inward=False)

    def pieces(self) -> list[Patch]:
        """Return a parallelogram per segment."""
        along = np.array(self.along, dtype=float)
        return [
            PlanePatch.of(
                np.array([[a, b, b + along], [a, b + along, a + along]]), np.cross(b - a, along)
            )
            for a, b in pairwise(np.array(self.points, dtype=float))
        ]


def _defect_of_corners(points: list[Point3]) -> str | None:
    """Why corners do not make a plane simple polygon, or None if they do."""
    corners = np.array(points, dtype=float)
    centred = corners - corners.mean(axis=0)
    _, sizes, axes = np.linalg.svd(centred)
    if sizes[1] <= 1e-9 * sizes[0]:
        return "the polygon has no area"
    if sizes[2] > 1e-9 * sizes[0]:
        return f"the polygon is not plane (off by {sizes[2]:.3g} m)"
    return polygon_defect(centred @ axes[:2].T)


def _along(axis: Point3 | None, normal: Point3) -> list[float] | None:
    """Return an axis, if there is one, that is zero or parallel to a normal."""
    if axis is None:
        return None
    size = float(np.linalg.norm(normal) * np.linalg.norm(axis))
    across = float(np.linalg.norm(np.cross(normal, axis)))
    return None if across > 1e-9 * size else list(axis)


def _points_per_turn(radius: float, spacing: float | None) -> int:
    if spacing is None:
        return _TURN
    return max(8, int(np.ceil(2.0 * np.pi * radius / spacing)))


def _strips(line: Array, along: Array, closed: bool, inward: bool) -> Facets:
    """Two triangles per segment of `line` (n, 3) swept along a vector."""
    n = len(line)
    i = np.arange(n if closed else n - 1)
    j = (i + 1) % n
    triangles = np.vstack([np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i])])
    return np.vstack([line, line + along]), triangles[:, ::-1] if inward else triangles


class Faces(NamedTuple):
    """The cut nearest to each of n points.

    Attributes
    ----------
    cut : (n,) int array
        Its number in the scene.
    normal : (n, d) array
        Unit normal of its nearest part, towards its positive side.
    """

    cut: NDArray[np.int64]
    normal: Array


def faces_of(cuts: Sequence[CutShape], points: Array) -> Faces:
    """Find the cut that each point (n, d) lies on: the nearest, of which curves are faceted."""
    away = np.full(len(points), np.inf)
    cut, normal = np.zeros(len(points), dtype=np.int64), np.zeros(points.shape)
    for k, one in enumerate(cuts):
        corners = _corners(one)
        distance, nearest = nearest_parts(points, corners)
        closer = distance < away
        away[closer], cut[closer] = distance[closer], k
        normal[closer] = unit_normals(corners)[nearest[closer]]
    return Faces(cut, normal)


def distance_to_cuts(cuts: Sequence[CutShape], points: Array) -> Array:
    """Distances (n, c) of points (n, d) to cuts, of which curves are faceted, m."""
    found = [nearest_parts(points, _corners(cut))[0] for cut in cuts]
    return np.array(found).reshape(len(cuts), len(points)).T


def _corners(cut: CutShape) -> Array:
    """Corners (m, d, d) of the facets of a cut."""
    points, facets = cut.facets()
    return points[facets]
