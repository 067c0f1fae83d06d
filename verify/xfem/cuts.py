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
same on shared faces. Cuts made of facets and tool paths have modules of their own and are handed
on here.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from verify.xfem.arrays import Floats, finite_array
from verify.xfem.errors import XfemError
from verify.xfem.faceted_cuts import Polyline as Polyline
from verify.xfem.faceted_cuts import TriangulatedSurface as TriangulatedSurface
from verify.xfem.tool_path import ToolPath as ToolPath


class Cut(Protocol):
    """A surface (3D) or curve (2D) that separates material."""

    def level_set(self, points: Floats) -> Floats:
        """Signed distance (n,) of points (n, d), in metres."""
        ...

    def depth(self, points: Floats) -> Floats:
        """Distance (n,) to the nearest end of the cut, negative past it, in metres."""
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
        """Signed distance to the plane."""
        at = finite_array(points, "plane: points", (None, len(self.point)))
        distance: Floats = (at - self.point) @ self.normal
        return distance

    def depth(self, points: Floats) -> Floats:
        """Infinite: a plane has no end."""
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
    """A flat polygon in space; its level set is that of its plane.

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
        """Signed distance to the plane of the polygon."""
        return self.plane.level_set(points)

    def depth(self, points: Floats) -> Floats:
        """Distance to the outline in the plane, negative outside."""
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

    Of what is not known to have an end they are infinite.
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
