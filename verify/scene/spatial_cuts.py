"""Cuts in space: plane polygons, discs, parts of cylinders and spheres, swept polylines."""

from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from verify.geometry.curves import Arc
from verify.geometry.nearest import feet
from verify.geometry.patches import CylinderPatch, DiscPatch, Patch, PlanePatch, SpherePatch
from verify.geometry.planar import polygon_defect, polyline_defect
from verify.geometry.spatial import ear_clipping, frame
from verify.scene.strict import Finite, Line, NonNegative, Point3, Positive, Strict

Array = NDArray[np.float64]
Surface = tuple[Array, NDArray[np.int64]]

_TURN = 64  # points on a full circle, where no spacing is asked for


class _SpatialCut(Strict):
    name: Line = "cut"
    expected: Literal["through", "edge", "inner"] | None = Field(
        default=None,
        description="how it meets the body: checked if given (through: its rim is nowhere inside "
        "the body; edge: partly; inner: everywhere)",
    )
    opens_at: NonNegative = Field(default=0.0, description="time at which it opens, s")

    @property
    def dimension(self) -> int:
        """Space dimension."""
        return 3

    def surface(self, spacing: float | None = None) -> Surface:
        """Triangulate the cut.

        Parameters
        ----------
        spacing : float, optional
            Largest distance of vertices along curved directions, m; default a 64th of a turn.

        Returns
        -------
        points : (n, 3) array
            On the cut.
        triangles : (m, 3) int array
            Anticlockwise seen from the positive side.
        """
        raise NotImplementedError

    def pieces(self) -> list[Patch]:
        """Return its parts as they are, not cut into facets; normals into the positive side."""
        raise NotImplementedError


class PolygonCut(_SpatialCut):
    """A plane polygon in space; its normal follows the right-hand rule."""

    kind: Literal["polygon"]
    points: list[Point3] = Field(min_length=3, description="corners in order, m")

    @model_validator(mode="after")
    def _is_plane(self) -> "PolygonCut":
        corners = np.array(self.points, dtype=float)
        centred = corners - corners.mean(axis=0)
        _, sizes, axes = np.linalg.svd(centred)
        if sizes[1] <= 1e-9 * sizes[0]:
            raise ValueError("the polygon has no area")
        if sizes[2] > 1e-9 * sizes[0]:
            raise ValueError(f"the polygon is not plane (off by {sizes[2]:.3g} m)")
        if defect := polygon_defect(centred @ axes[:2].T):
            raise ValueError(defect)
        return self

    def surface(self, spacing: float | None = None) -> Surface:
        """Triangulate the polygon; `spacing` does not matter to what is plane."""
        corners = np.array(self.points, dtype=float)
        return corners, ear_clipping(corners)

    def pieces(self) -> list[Patch]:
        """Return it as one piece of a plane."""
        corners, triangles = self.surface()
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
    """A plane disc or ellipse in space."""

    kind: Literal["disc"]
    centre: Point3 = Field(description="m")
    normal: Point3 = Field(description="to the positive side; of any length")
    radius: Positive | None = Field(default=None, description="of a circle, m")
    radii: tuple[Positive, Positive] | None = Field(
        default=None, description="semi-axes of an ellipse, m, the first along `axis`"
    )
    axis: Point3 | None = Field(
        default=None, description="direction of the first semi-axis, projected onto the plane"
    )

    @model_validator(mode="after")
    def _is_disc(self) -> "DiscCut":
        if not np.linalg.norm(self.normal) > 0.0:
            raise ValueError("the normal of the disc is zero")
        if (self.radius is None) == (self.radii is None):
            raise ValueError("a disc has either a radius or radii with an axis")
        if (self.radii is None) != (self.axis is None):
            raise ValueError("radii and axis go together")
        if self.axis is not None:
            _check_direction(self.normal, self.axis, "axis", "the normal")
        return self

    @property
    def semi_axes(self) -> tuple[float, float]:
        """Both semi-axes, m; equal for a circle."""
        return self.radii or (self.radius or 0.0, self.radius or 0.0)

    def axes(self) -> Array:
        """First semi-axis, second semi-axis and normal, as rows (3, 3) of length one."""
        return frame(self.normal, self.axis)

    def surface(self, spacing: float | None = None) -> Surface:
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
    """A part of a cylinder's mantle; its axis is on the positive side."""

    kind: Literal["cylinder"]
    base: Point3 = Field(description="point of the axis at the lower end, m")
    axis: Point3 = Field(description="direction of the axis, from the base; of any length")
    radius: Positive = Field(description="m")
    height: Positive = Field(description="along the axis, m")
    towards: Point3 | None = Field(
        default=None, description="direction of the angle 0, projected; needed for a sector"
    )
    start: Finite = Field(default=0.0, description="angle at which the sector starts, degrees")
    sweep: float = Field(
        strict=True, default=360.0, gt=0.0, le=360.0, description="angle covered, degrees"
    )

    @model_validator(mode="after")
    def _is_cylinder(self) -> "CylinderCut":
        if not np.linalg.norm(self.axis) > 0.0:
            raise ValueError("the axis of the cylinder is zero")
        if self.towards is not None:
            _check_direction(self.axis, self.towards, "towards", "the axis")
        elif self.sweep < 360.0:
            raise ValueError("a sector needs the direction of its angle 0: towards = [x, y, z]")
        return self

    def axes(self) -> Array:
        """Directions of the angles 0° and 90°, and of the axis, as rows (3, 3) of length one."""
        return frame(self.axis, self.towards)

    def surface(self, spacing: float | None = None) -> Surface:
        """Triangulate the sector in strips parallel to the axis."""
        closed = self.sweep == 360.0
        count = max(2, int(np.ceil(_points_per_turn(self.radius, spacing) * self.sweep / 360.0)))
        steps = np.arange(count if closed else count + 1)
        (mantle,) = self.pieces()
        ring = mantle.point(np.column_stack([steps / count, 0.0 * steps]))
        # the axis is on the positive side: seen from there, the mantle is passed clockwise
        return _strips(ring, self.height * self.axes()[2], closed, inward=True)

    def pieces(self) -> list[Patch]:
        """Return the part of the mantle itself."""
        start, sweep = np.deg2rad(self.start), np.deg2rad(self.sweep)
        arc = Arc(np.zeros(2), self.radius, float(start), float(sweep))
        return [CylinderPatch(np.array(self.base, dtype=float), self.axes(), arc, self.height)]


class SphereCut(_SpatialCut):
    """A sphere or a cap of one; its centre is on the positive side."""

    kind: Literal["sphere"]
    centre: Point3 = Field(description="m")
    radius: Positive = Field(description="m")
    towards: Point3 = Field(
        default=(0.0, 0.0, 1.0), description="direction of the cap's pole; of any length"
    )
    opening: float = Field(
        strict=True,
        default=180.0,
        gt=0.0,
        le=180.0,
        description="angle between the pole and the cap's rim, degrees; 180: the whole sphere",
    )

    @model_validator(mode="after")
    def _has_a_pole(self) -> "SphereCut":
        if not np.linalg.norm(self.towards) > 0.0:
            raise ValueError("the direction of the cap's pole is zero")
        return self

    @property
    def closed(self) -> bool:
        """Whether it is the whole sphere."""
        return self.opening == 180.0

    def axes(self) -> Array:
        """Two directions across the pole's, and the pole's, as rows (3, 3) of length one."""
        return frame(self.towards)

    def surface(self, spacing: float | None = None) -> Surface:
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
    """A polyline in space, swept along a vector; its positive side is that of points × along."""

    kind: Literal["swept"]
    points: list[Point3] = Field(
        min_length=2, description="points in order, m; the last equal to the first closes it"
    )
    along: Point3 = Field(description="from the polyline to the opposite rim, m")

    @model_validator(mode="after")
    def _is_simple(self) -> "SweptCut":
        if not np.linalg.norm(self.along) > 0.0:
            raise ValueError("along is zero: the polyline is not swept")
        points = np.array(self.points, dtype=float)
        seen = points @ frame(self.along)[:2].T
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        across = np.linalg.norm(np.diff(seen, axis=0), axis=1)
        flat = np.flatnonzero(across <= 1e-9 * np.maximum(steps, 1e-300))
        if flat.size:
            raise ValueError(f"segment {flat[0]} is parallel to `along`: it sweeps no area")
        if defect := polyline_defect(seen):
            raise ValueError(f"the polyline, seen along the sweep, {defect}")
        return self

    @property
    def closed(self) -> bool:
        """Whether it is swept into a tube."""
        return self.points[0] == self.points[-1]

    def surface(self, spacing: float | None = None) -> Surface:
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


SpatialCut = PolygonCut | DiscCut | CylinderCut | SphereCut | SweptCut


def _check_direction(normal: Point3, axis: Point3, name: str, other: str) -> None:
    size = float(np.linalg.norm(normal) * np.linalg.norm(axis))
    if not float(np.linalg.norm(np.cross(normal, axis))) > 1e-9 * size:
        raise ValueError(f"{name} {list(axis)} is zero or parallel to {other}")


def _points_per_turn(radius: float, spacing: float | None) -> int:
    if spacing is None:
        return _TURN
    return max(8, int(np.ceil(2.0 * np.pi * radius / spacing)))


def _strips(line: Array, along: Array, closed: bool, inward: bool) -> Surface:
    """Two triangles per segment of `line` (n, 3) swept along a vector."""
    n = len(line)
    i = np.arange(n if closed else n - 1)
    j = (i + 1) % n
    triangles = np.vstack([np.column_stack([i, j, n + j]), np.column_stack([i, n + j, n + i])])
    return np.vstack([line, line + along]), triangles[:, ::-1] if inward else triangles
