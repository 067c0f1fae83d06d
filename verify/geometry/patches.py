"""Pieces of cuts in space: plane polygons, discs, parts of cylinders and spheres.

Each is a chart: parameters (n, 2) to points (n, 3), with normals into the positive side. A
cylinder stays a cylinder and a disc a disc; they are not cut into facets.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.geometry.curves import Arc
from verify.geometry.simplices import feet, frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class _Surface:
    """A surface about an origin (3,), with the rows of `axes` (3, 3) as its directions."""

    origin: Array
    axes: Array

    def nearest(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3), and whether they lie on the rim (n,)."""
        raise NotImplementedError

    def foot(self, x: Array) -> Array:
        """Nearest points (n, 3)."""
        return self.nearest(x)[0]

    def facing(self, x: Array) -> Array:
        """Return unit normals (n, 3), to the positive side, at points (n, 3) of it."""
        raise NotImplementedError

    def depth(self, x: Array) -> Array:
        """Distance (n,) to the rim along the surface, m, negative beyond it."""
        raise NotImplementedError


class _Flat(_Surface):
    """A part of a plane, whose normal is the third direction."""

    curvature = 0.0
    closed = False

    def normal(self, uv: Array) -> Array:
        """Return unit normals (n, 3)."""
        return np.tile(self.axes[2], (len(uv), 1))

    def facing(self, x: Array) -> Array:
        """Return unit normals (n, 3) at points (n, 3) of it."""
        return self.normal(x)

    def level(self, x: Array) -> Array:
        """Distance (n,) from the plane, positive on the positive side."""
        height: Array = (x - self.origin) @ self.axes[2]
        return height


@dataclass(frozen=True)
class PlanePatch(_Flat):
    """Triangles in a plane.

    Parameters
    ----------
    origin : (3,) array
    axes : (3, 3) array
        Rows: two directions in the plane, and the normal into the positive side.
    cells : (m, 3, 2) array
        Corners of the triangles in the two directions, relative to the origin.
    """

    cells: Array
    plane = True

    @classmethod
    def of(cls, triangles: Array, normal: Array) -> "PlanePatch":
        """Make it of triangles (m, 3, 3) in a plane with the given normal."""
        axes = frame(normal)
        origin = triangles[0, 0]
        return cls(origin, axes, (triangles - origin) @ axes[:2].T)

    def point(self, uv: Array) -> Array:
        """Points (n, 3)."""
        return self.origin + uv @ self.axes[:2]

    def stretch(self, uv: Array) -> Array:
        """Area (n,) per area of parameters."""
        return np.ones(len(uv))

    def nearest(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3), and whether they lie on the rim (n,)."""
        uv = (x - self.origin) @ self.axes[:2].T
        foot, best = np.zeros_like(uv), np.full(len(uv), np.inf)
        rim = np.ones(len(uv), dtype=bool)
        for triangle in self.cells:
            inside = np.ones(len(uv), dtype=bool)
            turn = np.sign(np.linalg.det(triangle[1:] - triangle[0]))
            for a, b in zip(triangle, np.roll(triangle, -1, axis=0), strict=True):
                edge, off = b - a, uv - a
                inside &= turn * (edge[0] * off[:, 1] - edge[1] * off[:, 0]) >= 0.0
                candidate = feet(uv, a, b)
                away = np.linalg.norm(uv - candidate, axis=1)
                closer = away < best
                foot[closer], best[closer] = candidate[closer], away[closer]
            foot[inside], best[inside], rim[inside] = uv[inside], 0.0, False
        return self.point(foot), rim

    def rim(self) -> tuple[Array, Array]:
        """Middles (k, 3) of the edges around it, and unit vectors (k, 3) that leave it there."""
        edges = self.cells[:, [[0, 1], [1, 2], [2, 0]]]
        outward = (edges[:, :, 1] - edges[:, :, 0])[:, :, ::-1] * [1.0, -1.0]
        outward *= np.sign(np.linalg.det(self.cells[:, 1:] - self.cells[:, :1]))[:, None, None]
        outward /= np.linalg.norm(outward, axis=2, keepdims=True)
        middles = edges.mean(axis=2).reshape(-1, 2)
        apart = np.linalg.norm(middles[:, None] - middles, axis=2)
        own = (apart <= 1e-9 * np.ptp(middles)).sum(axis=1) == 1  # another triangle has it not
        return self.point(middles[own]), outward.reshape(-1, 2)[own] @ self.axes[:2]

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the bounding box."""
        corners = self.point(self.cells.reshape(-1, 2))
        return corners.min(axis=0), corners.max(axis=0)


@dataclass(frozen=True)
class DiscPatch(_Flat):
    """An elliptical disc; parameters are the share of the radius and the angle.

    Parameters
    ----------
    origin : (3,) array
        Centre.
    axes : (3, 3) array
        Rows: directions of the semi-axes, and the normal into the positive side.
    semi_axes : (float, float)
    """

    semi_axes: tuple[float, float]
    plane = False  # in its parameters: straight lines in space are not straight there

    @property
    def cells(self) -> Array:
        """Triangles (m, 3, 2) of the parameters."""
        return _rectangle(1.0, 0.0, 2 * np.pi, 8)

    def point(self, uv: Array) -> Array:
        """Points (n, 3)."""
        share, angle = uv.T
        a, b = self.semi_axes
        flat = np.column_stack([a * share * np.cos(angle), b * share * np.sin(angle)])
        return self.origin + flat @ self.axes[:2]

    def stretch(self, uv: Array) -> Array:
        """Area (n,) per area of parameters."""
        return self.semi_axes[0] * self.semi_axes[1] * np.abs(uv[:, 0])

    def nearest(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3), and whether they lie on the rim (n,)."""
        flat = (x - self.origin) @ self.axes[:2].T
        squares = np.square(self.semi_axes)
        outside = np.sum(flat**2 / squares, axis=1) >= 1.0
        # the foot p_i a_i² / (t + a_i²) lies on the ellipse for one t ≥ 0 only
        low = np.zeros(len(x))
        high = np.linalg.norm(flat, axis=1) * max(self.semi_axes)
        for _ in range(60):
            t = 0.5 * (low + high)
            reach = np.sum((flat / (t[:, None] + squares)) ** 2 * squares, axis=1)
            low, high = np.where(reach > 1, t, low), np.where(reach > 1, high, t)
        on_rim = flat * squares / (0.5 * (low + high)[:, None] + squares)
        foot = np.where(outside[:, None], on_rim, flat)
        return self.origin + foot @ self.axes[:2], outside

    def depth(self, x: Array) -> Array:
        """Distance (n,) to the rim in the plane: exact for a circle, else of first order in it."""
        flat = (x - self.origin) @ self.axes[:2].T
        share = np.linalg.norm(flat / self.semi_axes, axis=1)
        steepness = np.linalg.norm(flat / np.square(self.semi_axes), axis=1)
        inner = share > 1e-12
        off = np.divide((1.0 - share) * share, steepness, where=inner, out=np.zeros_like(share))
        return np.where(inner, off, min(self.semi_axes))

    def rim(self) -> tuple[Array, Array]:
        """Eight points (8, 3) of the rim, and unit vectors (8, 3) that leave the disc there."""
        angle = np.linspace(0.3, 0.3 + 2 * np.pi, 8, endpoint=False)
        outward = np.column_stack([np.cos(angle), np.sin(angle)]) / self.semi_axes
        outward /= np.linalg.norm(outward, axis=1)[:, None]
        return self.point(np.column_stack([np.ones(8), angle])), outward @ self.axes[:2]

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the bounding box."""
        half = np.linalg.norm(np.array(self.semi_axes)[:, None] * self.axes[:2], axis=0)
        return self.origin - half, self.origin + half


@dataclass(frozen=True)
class CylinderPatch(_Surface):
    """A part of a cylinder's mantle; its axis is on the positive side.

    Parameters
    ----------
    origin : (3,) array
        Point of the axis at the lower end.
    axes : (3, 3) array
        Rows: directions of the angles 0° and 90°, and of the axis.
    arc : Arc
        Its cross-section; parameters are the share of the arc and the height.
    height : float
    """

    arc: Arc
    height: float
    plane = False
    closed = False

    @property
    def curvature(self) -> float:
        """One over the radius, 1/m."""
        return 1.0 / self.arc.radius

    @property
    def cells(self) -> Array:
        """Triangles (m, 3, 2) of the parameters."""
        return _rectangle(1.0, 0.0, self.height, 4)

    def point(self, uv: Array) -> Array:
        """Points (n, 3)."""
        return self.origin + np.column_stack([self.arc.point(uv[:, 0]), uv[:, 1]]) @ self.axes

    def normal(self, uv: Array) -> Array:
        """Return unit normals (n, 3)."""
        inward = (self.arc.centre - self.arc.point(uv[:, 0])) / self.arc.radius
        return np.asarray(inward @ self.axes[:2])

    def facing(self, x: Array) -> Array:
        """Return unit normals (n, 3), to the axis, at points (n, 3) of it."""
        return np.asarray(self.arc.facing((x - self.origin) @ self.axes[:2].T) @ self.axes[:2])

    def stretch(self, uv: Array) -> Array:
        """Area (n,) per area of parameters."""
        return np.full(len(uv), self.arc.length)

    def level(self, x: Array) -> Array:
        """Distance (n,) from the mantle, positive on the side of the axis."""
        flat = (x - self.origin) @ self.axes[:2].T
        inside: Array = self.arc.radius - np.linalg.norm(flat, axis=1)
        return inside

    def nearest(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3), and whether they lie on the rim (n,)."""
        local = (x - self.origin) @ self.axes.T
        share, along = self.arc.nearest(local[:, :2]), np.clip(local[:, 2], 0.0, self.height)
        rim = along != local[:, 2]
        if not self.arc.closed:
            rim |= (share == 0.0) | (share == 1.0)
        return self.point(np.column_stack([share, along])), rim

    def depth(self, x: Array) -> Array:
        """Distance (n,) to the rim along the mantle: the nearer of its ends and of its sides."""
        flat, along = (x - self.origin) @ self.axes[:2].T, (x - self.origin) @ self.axes[2]
        depth: Array = np.minimum(along, self.height - along)
        return depth if self.arc.closed else np.minimum(depth, self.arc.depth(flat))

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner of a box around it."""
        half = self.arc.radius * np.linalg.norm(self.axes[:2], axis=0)
        ends = self.origin + np.array([[0.0], [self.height]]) * self.axes[2]
        return ends.min(axis=0) - half, ends.max(axis=0) + half


@dataclass(frozen=True)
class SpherePatch(_Surface):
    """A cap of a sphere, or all of it; its centre is on the positive side.

    Parameters
    ----------
    origin : (3,) array
        Centre.
    axes : (3, 3) array
        Rows: two directions across the pole's, and the pole's; parameters are the angle from the
        pole and the angle around it.
    radius : float
    opening : float
        Angle between the pole and the rim, radians; π for the whole sphere.
    """

    radius: float
    opening: float
    plane = False

    @property
    def closed(self) -> bool:
        """Whether it has no rim."""
        return self.opening >= np.pi

    @property
    def curvature(self) -> float:
        """One over the radius, 1/m."""
        return 1.0 / self.radius

    @property
    def cells(self) -> Array:
        """Triangles (m, 3, 2) of the parameters."""
        return _rectangle(self.opening, 0.0, 2 * np.pi, 8)

    def _outward(self, uv: Array) -> Array:
        polar, turn = uv.T
        local = [np.sin(polar) * np.cos(turn), np.sin(polar) * np.sin(turn), np.cos(polar)]
        return np.asarray(np.column_stack(local) @ self.axes)

    def point(self, uv: Array) -> Array:
        """Points (n, 3)."""
        return self.origin + self.radius * self._outward(uv)

    def normal(self, uv: Array) -> Array:
        """Return unit normals (n, 3)."""
        return -self._outward(uv)

    def facing(self, x: Array) -> Array:
        """Return unit normals (n, 3), to the centre, at points (n, 3) of it."""
        return np.asarray((self.origin - x) / self.radius)

    def stretch(self, uv: Array) -> Array:
        """Area (n,) per area of parameters."""
        return np.asarray(self.radius**2 * np.abs(np.sin(uv[:, 0])))

    def level(self, x: Array) -> Array:
        """Distance (n,) from the sphere, positive on the side of its centre."""
        inside: Array = self.radius - np.linalg.norm(x - self.origin, axis=1)
        return inside

    def nearest(self, x: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Nearest points (n, 3), and whether they lie on the rim (n,)."""
        first, second, along = self.axes @ (x - self.origin).T
        polar = np.arctan2(np.hypot(first, second), along)
        rim = (polar >= self.opening) & (not self.closed)
        uv = np.column_stack([np.minimum(polar, self.opening), np.arctan2(second, first)])
        return self.point(uv), rim

    def depth(self, x: Array) -> Array:
        """Distance (n,) to the rim along the sphere."""
        first, second, along = self.axes @ (x - self.origin).T
        return np.asarray(self.radius * (self.opening - np.arctan2(np.hypot(first, second), along)))

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest corner of the bounding box."""
        from_pole = np.arccos(np.clip(self.axes[2], -1.0, 1.0))
        highest = np.cos(np.maximum(from_pole - self.opening, 0.0))
        lowest = -np.cos(np.maximum(np.pi - from_pole - self.opening, 0.0))
        return self.origin + self.radius * lowest, self.origin + self.radius * highest


Patch = PlanePatch | DiscPatch | CylinderPatch | SpherePatch


def _rectangle(width: float, low: float, high: float, strips: int) -> Array:
    """Triangles (2 strips, 3, 2) of the rectangle [0, width] × [low, high]."""
    v = np.linspace(low, high, strips + 1)
    o, w = np.zeros(strips), np.full(strips, width)
    a, b = np.column_stack([o, v[:-1]]), np.column_stack([w, v[:-1]])
    c, d = np.column_stack([w, v[1:]]), np.column_stack([o, v[1:]])
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
