"""Cuts: flat, along a polyline or a triangulated surface, or swept by a tool.

A cut is a geometric object in the material frame. The solver asks it two things only:

``level_set(points)``
    Signed distance φ in metres, positive on the side of the normal, extended past the ends of
    the cut along its tangent there.
``depth(points)``
    How far inside the ends of the cut a point of its (extended) zero set lies, in metres:
    positive inside, negative past an end, infinite where there is no end. Where it is positive
    lies the *extent* of the cut.

One nodal φ per cut, interpolated linearly, makes the realised cut planar in every element and the
same on shared faces. Cuts made of facets have a module of their own and are handed on here.

The blade of a tool is a polyline (in the plane: a point) with a position at each time. Between two
positions every point of it moves along a straight line; the sweep is made of the segments (2D) or
triangles (3D) in between. How far the blade has come is measured by the *travel*: the length of
the path, of the fastest point of the blade.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from verify.xfem.arrays import Floats, Ints, XfemError, finite_array
from verify.xfem.faceted_cuts import FacetArrays, FacetCut, check_triangles, facet_arrays
from verify.xfem.faceted_cuts import Polyline as Polyline
from verify.xfem.faceted_cuts import TriangulatedSurface as TriangulatedSurface
from verify.xfem.mesh import neighbours_across


class Cut(Protocol):
    """A surface (3D) or curve (2D) that separates material."""

    def level_set(self, points: Floats) -> Floats:
        """Compute the signed distance (n,) of points (n, d), in metres."""
        ...

    def depth(self, points: Floats) -> Floats:
        """Compute the distance (n,) to the nearest end of the cut, negative past it, in metres."""
        ...


@dataclass(frozen=True)
class Plane:
    """A plane (3D) or straight line (2D) without end.

    Parameters
    ----------
    point : (d,) array_like
        A point of the plane, in metres.
    normal : (d,) array_like
        Normal of any length; it points to the positive side.

    Raises
    ------
    XfemError
        If the normal vanishes, or shapes do not match.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> cut = xfem.Plane([0.5, 0.0], [1.0, 0.0])
    >>> cut.level_set([[0.75, 3.0], [0.25, 3.0]]).tolist()
    [0.25, -0.25]
    """

    point: Floats
    normal: Floats

    def __init__(self, point: ArrayLike, normal: ArrayLike) -> None:
        origin = finite_array(point, "plane at", (2,), (3,))
        direction = finite_array(normal, "plane with normal", origin.shape)
        length = np.linalg.norm(direction)
        if length == 0.0:
            raise XfemError(f"plane with normal {direction.tolist()}; expected a non-zero vector")
        object.__setattr__(self, "point", origin)
        object.__setattr__(self, "normal", direction / length)

    def level_set(self, points: Floats) -> Floats:
        """Compute the signed distance to the plane."""
        at = finite_array(points, "plane: points", (None, len(self.point)))
        distance: Floats = (at - self.point) @ self.normal
        return distance

    def depth(self, points: Floats) -> Floats:
        """Return infinity: a plane has no end."""
        return np.full(len(points), np.inf)


@dataclass(frozen=True)
class ImplicitCut:
    """A cut given by its level set, e.g. an exact circle.

    Parameters
    ----------
    function : callable
        Level set (n,) of points (n, d), in metres; near the cut it should be a distance.
    extent : callable, optional
        Depth (n,) of points (n, d), as `Cut.depth`; without it the cut has no end.
    """

    function: Callable[[Floats], Floats]
    extent: Callable[[Floats], Floats] | None = None

    def level_set(self, points: Floats) -> Floats:
        """Evaluate the given function."""
        return np.asarray(self.function(points), dtype=float)

    def depth(self, points: Floats) -> Floats:
        """Evaluate the given extent."""
        if self.extent is None:
            return np.full(len(points), np.inf)
        return np.asarray(self.extent(points), dtype=float)


@dataclass(frozen=True)
class PolygonPatch:
    """A flat polygon in space; its level set is the distance to its plane.

    Parameters
    ----------
    corners : (k, 3) array_like
        Corners in order, in metres; they turn anticlockwise seen from the positive side.

    Raises
    ------
    XfemError
        If there are fewer than three corners, no area, two neighbouring corners in one place, or
        the corners are not in one plane.
    """

    corners: Floats
    plane: Plane
    _axes: Floats
    _outline: Polyline

    def __init__(self, corners: ArrayLike) -> None:
        polygon = finite_array(corners, "polygon with corners", (None, 3))
        if len(polygon) < 3:
            raise XfemError(f"polygon of {len(polygon)} corners; expected three or more")
        sides = np.linalg.norm(np.roll(polygon, -1, axis=0) - polygon, axis=1)
        if not (sides > 0.0).all():
            one = int(sides.argmin())
            raise XfemError(
                f"corners {one} and {(one + 1) % len(polygon)} of the polygon are in one place; "
                "expected each once (the last is joined to the first)"
            )
        spokes = polygon - polygon[0]
        normal = np.cross(spokes[1:-1], spokes[2:]).sum(axis=0)
        size = np.linalg.norm(spokes, axis=1).max()
        if not np.linalg.norm(normal) > 1e-12 * size**2:
            raise XfemError("polygon without area")
        plane = Plane(polygon[0], normal)
        off = np.abs(plane.level_set(polygon)).max()
        if off > 1e-9 * size:
            raise XfemError(f"polygon is not flat: a corner is {off:.3g} m off its plane")
        object.__setattr__(self, "corners", polygon)
        object.__setattr__(self, "plane", plane)
        object.__setattr__(self, "_axes", np.stack(_tangents(plane.normal), axis=1))
        object.__setattr__(self, "_outline", Polyline(self._in_plane(polygon), closed=True))

    def level_set(self, points: Floats) -> Floats:
        """Compute the signed distance to the plane of the polygon."""
        return self.plane.level_set(points)

    def depth(self, points: Floats) -> Floats:
        """Compute the distance to the outline in the plane, negative outside."""
        return self._outline.level_set(
            self._in_plane(finite_array(points, "polygon: points", (None, 3)))
        )

    def _in_plane(self, points: Floats) -> Floats:
        return (points - self.plane.point) @ self._axes


def _tangents(normal: Floats) -> tuple[Floats, Floats]:
    helper = np.eye(3)[np.argmin(np.abs(normal))]
    first = np.cross(normal, helper)
    first /= np.linalg.norm(first)
    return first, np.cross(normal, first)


def boxes_of(cuts: Sequence[Cut], space: int) -> Floats:
    """Lower and upper corners (cuts, 2, space) of boxes around the extents of cuts, in metres.

    Boxes of cuts without an end, or whose end is not known, are infinite.
    """
    boxes = np.tile([[-np.inf], [np.inf]], (len(cuts), 1, space))
    for box, cut in zip(boxes, cuts, strict=True):
        if isinstance(cut, (Polyline, TriangulatedSurface)):
            corners = cut.arrays.corners.reshape(-1, space)
        elif isinstance(cut, PolygonPatch):
            corners = cut.corners
        else:
            continue
        box[:] = corners.min(axis=0), corners.max(axis=0)
    return boxes


_FLAT = 1e-12  # area over squared edge below which a swept triangle counts as not swept
_STILL = 1e-14  # of the length of the path: shorter moves are none
_TURNED_BACK = -1.0 + 1e-9  # cosine between the normals of neighbouring facets


class SweepSurface(NamedTuple):
    """Vertices (v, s), facets (t, k), and the arrays for kernels."""

    points: Floats
    facets: Ints
    arrays: FacetArrays


@dataclass(frozen=True)
class ToolPath:
    """Positions of a blade in time, in the material frame.

    Parameters
    ----------
    blades : (k, b, s) array_like
        Points of the blade at each time, in metres: b = 1 in the plane, b ≥ 2 in space.
    times : (k,) array_like
        In seconds, never decreasing.

    Raises
    ------
    XfemError
        If shapes do not match, a number is not finite or time runs backwards. If the blade turns
        back on its path, or its path or sweep intersects itself: begin a new stroke instead.
    """

    blades: Floats
    times: Floats

    def __init__(self, blades: ArrayLike, times: ArrayLike) -> None:
        positions = finite_array(blades, "blades", (None, None, 2), (None, None, 3))
        moments = finite_array(times, "times", positions.shape[:1])
        _check(positions, moments)
        object.__setattr__(self, "blades", positions)
        object.__setattr__(self, "times", moments)
        if self.length > 0.0:
            if positions.shape[2] == 2:
                moves = np.flatnonzero(np.diff(self.travel, prepend=-np.inf) > _STILL * self.length)
                Polyline(positions[moves, 0])  # raises if it turns back or intersects itself
            _ = self.surface  # raises if the blade turns back on its sweep

    @classmethod
    def of_tip(
        cls, tips: ArrayLike, times: ArrayLike, depth: ArrayLike | None = None
    ) -> "ToolPath":
        """Make the path of a straight blade by its tip and, in space, the vector to its other end.

        Parameters
        ----------
        tips : (k, s) array_like
            In metres.
        times : (k,) array_like
            In seconds.
        depth : (3,) or (k, 3) array_like, optional
            Vector from the tip to the other end of the blade, in metres; none in the plane.
        """
        points = finite_array(tips, "tip points", (None, 2), (None, 3))
        if depth is None:
            return cls(points[:, None], times)
        vector = finite_array(depth, "depth", points.shape[1:], points.shape)
        return cls(np.stack([points, points + vector], axis=1), times)

    @cached_property
    def travel(self) -> Floats:
        """(k,) length of the path up to each position, in metres."""
        steps = np.linalg.norm(np.diff(self.blades, axis=0), axis=2).max(axis=1, initial=0.0)
        return np.concatenate([[0.0], np.cumsum(steps)])

    @property
    def length(self) -> float:
        """Length of the whole path, in metres; zero if the blade does not move."""
        return float(self.travel[-1])

    @property
    def sweeps(self) -> bool:
        """Whether it sweeps anything: a blade may stay, or move along itself."""
        return self.length > 0.0 and len(self.surface.facets) > 0

    @cached_property
    def surface(self) -> SweepSurface:
        """The swept segments or triangles."""
        return _sweep_surface(self.blades, self.travel)

    @property
    def sweep(self) -> "Sweep":
        """The whole swept cut, as `verify.xfem.phantom.cut_mesh` takes it."""
        return Sweep(self)

    def travel_at(self, time: float) -> float:
        """Return the travel of the blade at a time, in metres; negative before the first."""
        if time < self.times[0]:
            return -1.0
        return float(np.interp(time, self.times, self.travel))

    def time_at(self, travel: ArrayLike) -> Floats:
        """Find the time at which the blade first reaches a travel, in seconds."""
        wanted = np.clip(np.asarray(travel, dtype=float), 0.0, self.length)
        at = np.searchsorted(self.travel, wanted)
        # a blade that waits has been there since it arrived
        between = np.interp(wanted, self.travel, self.times)
        return np.where(self.travel[at] == wanted, self.times[at], between)

    def extended(self, blades: ArrayLike, times: ArrayLike) -> "ToolPath":
        """Append positions (k, b, s) at times (k,): for a tool whose path is not known ahead."""
        more = finite_array(blades, "further blades", (None, *self.blades.shape[1:]))
        later = np.atleast_1d(finite_array(times, "further times", (), (None,)))
        return ToolPath(np.concatenate([self.blades, more]), np.concatenate([self.times, later]))


@dataclass(frozen=True)
class Sweep(FacetCut):
    """The surface swept by a path, as a cut.

    In the plane the positive side is on the left of the path. In space (direction of motion) ×
    (blade) points to it.
    """

    path: ToolPath
    _name = "sweep"

    @cached_property
    def arrays(self) -> FacetArrays:
        """Its facets, as kernels take them."""
        return self.path.surface.arrays

    def level_set(self, points: Floats) -> Floats:
        """Compute signed distance (n,) to the swept surface, to its tangent plane past the rim."""
        return super().level_set(points) if self.path.sweeps else self.probed(points)[:, 0]

    def probed(self, points: Floats) -> Floats:
        """Return (n, 3): level set, depth, and the travel of the blade as it passes, in metres."""
        if self.path.sweeps:
            return super().probed(points)
        # nothing is swept: one side everywhere, and no point of the cut anywhere
        at = finite_array(points, "sweep: points", (None, self.path.blades.shape[2]))
        return np.tile([1.0, -np.inf, 0.0], (len(at), 1))


def _check(blades: Floats, times: Floats) -> None:
    if len(blades) == 0:
        raise XfemError(f"blades of shape {blades.shape}; expected one position or more")
    if blades.shape[2] == 2 and blades.shape[1] != 1:
        raise XfemError(f"blade of {blades.shape[1]} points in the plane; expected one, its tip")
    if blades.shape[2] == 3 and blades.shape[1] < 2:
        raise XfemError("blade of one point in space; expected two or more (give its depth)")
    if (np.diff(times) < 0.0).any():
        raise XfemError(f"time runs backwards after position {int(np.diff(times).argmin())}")
    if (np.linalg.norm(np.diff(blades, axis=1), axis=2) == 0.0).any():
        raise XfemError("blade with two neighbouring points in one place; expected a length")


def _sweep_surface(blades: Floats, travel: Floats) -> SweepSurface:
    """Triangulate the sweep of blades (k, b, s) with the travel (k,) of each position."""
    points, lengths, facets = _facets(blades, travel)
    arrays = facet_arrays(points, facets, lengths)
    if facets.shape[1] == 3:
        across = neighbours_across(facets)
        cosine = (arrays.normals[:, None] * arrays.normals[np.maximum(across, 0)]).sum(axis=2)
        back = (across >= 0) & (cosine < _TURNED_BACK)
        if back.any():
            where = points[facets[back.any(axis=1)][0]].mean(axis=0)
            raise XfemError(f"the blade turns back on its own sweep near {where.tolist()}")
        check_triangles(points, facets, "sweep of the blade")
    return SweepSurface(points, facets, arrays)


def _facets(blades: Floats, travel: Floats) -> tuple[Floats, Floats, Ints]:
    """Make vertices, their travel, and the facets that have a length or an area."""
    count, width, space = blades.shape
    ids = np.arange(count * width).reshape(count, width)
    for k in range(1, count):
        # a point of the blade that stays, up to round-off of the path, is one vertex: the facets
        # that turn around it are connected
        still = np.linalg.norm(blades[k] - blades[k - 1], axis=1) <= _STILL * travel[-1]
        ids[k, still] = ids[k - 1, still]
    points = blades.reshape(-1, space)
    lengths = np.repeat(travel, width)
    if width == 1:
        facets = np.stack([ids[:-1, 0], ids[1:, 0]], axis=1)
        return points, lengths, facets[facets[:, 0] != facets[:, 1]]
    a, b, c, d = ids[:-1, :-1], ids[1:, :-1], ids[1:, 1:], ids[:-1, 1:]
    both = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], axis=2).reshape(-1, 3)
    edges = points[both][:, [1, 2, 0]] - points[both]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    return points, lengths, both[area > _FLAT * (edges**2).sum(axis=2).max(axis=1)]
