"""Surfaces of a played body: that of the material itself, one to see, one to touch.

Those of a solid can be separate meshes. A plane body and a membrane are their own surface.
A tool is asked against the boxes of all facets at once, and touches each side of a cut; only
facets whose boxes it comes near are looked at.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.simulator.embedded_surface import EmbeddedSurface
from verify.simulator.growing_body import Increment
from verify.simulator.moving_surface import BodySurface, MovingSurface
from verify.simulator.semi_progressive import SemiProgressiveCutter
from verify.simulator.stage import Stage
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.faceted_cuts import nearest_on_facet
from verify.xfem.phantom import PhantomMesh


class Picture:
    """Triangles to be drawn.

    Attributes
    ----------
    points, material : (q, 3) float array
        Corners as they are now, and in the uncut body, m.
    triangles : (f, 3) int array
    inner : (f,) bool array
        Whether a triangle lies on a cut.
    """

    def __init__(self, points: Floats, material: Floats, triangles: Ints, inner: Bools) -> None:
        beyond = ((0, 0), (0, 3 - points.shape[1]))
        self.points, self.material = np.pad(points, beyond), np.pad(material, beyond)
        self.triangles, self.inner = triangles, inner


class Surfaces:
    """All surfaces of a body under the knife.

    Parameters
    ----------
    stage : Stage
    cutter : SemiProgressiveCutter

    Attributes
    ----------
    material : BodySurface
        Closed around the material; of a membrane, its triangles.
    visual, collision : EmbeddedSurface or None
        Where the stage has separate ones.
    """

    def __init__(self, stage: Stage, cutter: SemiProgressiveCutter) -> None:
        self.material = BodySurface(cutter.body)
        self.visual, self.collision = (
            EmbeddedSurface(cutter, *given) if given is not None else None
            for given in (stage.visual, stage.collision)
        )
        followers = (self.material, self.visual, self.collision)
        self._followers = [surface for surface in followers if surface is not None]

    def update(self, increment: Increment) -> None:
        """Let them follow a cut."""
        for follower in self._followers:
            follower.update(increment)

    def move(self, displacement: Floats) -> None:
        """Compute the positions of all vertices for a displacement (N, s) of the unknowns."""
        self._positions = [follower.surface.positions(displacement) for follower in self._followers]

    @property
    def shown(self) -> MovingSurface:
        """The surface that is seen, the faces of cuts apart."""
        return (self.visual or self.material).surface

    @property
    def touchable(self) -> MovingSurface:
        """The surface that tools collide with."""
        return (self.collision or self.material).surface

    @property
    def touchable_positions(self) -> Floats:
        """(v, s) vertices of that surface after the last `move`, m."""
        return self._positions[-1 if self.collision else 0]

    def picture(self, phantom: PhantomMesh, displacement: Floats) -> Picture:
        """Draw the body as it is now: the visual surface with the faces of the cuts."""
        if phantom.mesh.space == 2:
            return _pieces(phantom, displacement)
        inside = self.material.surface
        parts = [(inside, inside.used)]
        if self.visual is not None:
            shown = inside.used[inside.inner.rows[inside.used]]
            parts = [(inside, shown), (self.shown, self.shown.used)]
        points, material, triangles, inner, begin = [], [], [], [], 0
        for number, (surface, used) in enumerate(parts):
            points.append(surface.positions(displacement))
            material.append(surface.material.rows)
            triangles.append(surface.facets.rows[used] + begin)
            inner.append(surface.inner.rows[used] & (number == 0))
            begin += len(points[-1])
        return Picture(*(np.concatenate(rows) for rows in (points, material, triangles, inner)))


def _pieces(phantom: PhantomMesh, displacement: Floats) -> Picture:
    """Draw a plane body: its whole triangles and the parts of the split ones."""
    piece, at, _ = phantom.solid_simplices
    corners = phantom.mesh.points[phantom.mesh.cells[phantom.parent[piece]]]
    turned = np.linalg.det(at) < 0.0  # sub-simplices come in the order of their numbers
    at = np.where(turned[:, None, None], at[:, ::-1], at)
    moved = corners + displacement[phantom.cells[piece]]
    now, before = (
        np.einsum("qki,qis->qks", at, x).reshape(-1, corners.shape[2]) for x in (moved, corners)
    )
    triangles = np.arange(len(now)).reshape(-1, 3)
    return Picture(now, before, triangles, np.zeros(len(triangles), dtype=bool))


_ROUND_OFF = 16.0 * np.finfo(float).eps  # of positions: what touches exactly is touched


class Contacts(NamedTuple):
    """Points of a surface that a tool touches, one a row.

    Attributes
    ----------
    facet : (q,) int array
        Facet of the moving surface.
    distance : (q,) float array
        From the axis of the tool to the point, in metres.
    at : (q, 3) float array
        Barycentric coordinates of the point in the facet, for `MovingSurface.add_forces`.
    """

    facet: Ints
    distance: Floats
    at: Floats


class SurfaceCollider:
    """Queries of tools against the facets of a moving surface.

    Parameters
    ----------
    surface : MovingSurface

    Attributes
    ----------
    positions : (v, s) float array
        Of the vertices, in metres.
    """

    def __init__(self, surface: MovingSurface) -> None:
        self.surface = surface
        self.follow(surface.material.rows.copy())

    def follow(self, positions: Floats) -> None:
        """Move to positions (v, s) of all vertices that are known already, kept by reference, m.

        Raises
        ------
        XfemError
            If there are not as many as vertices, or one is not finite.
        """
        if positions.shape != self.surface.material.rows.shape:
            raise XfemError(
                f"positions of shape {positions.shape}; expected {self.surface.material.rows.shape}"
            )
        if not np.isfinite(positions).all():
            raise XfemError("positions of a surface that are not finite")
        self.positions = positions
        self._boxes: tuple[Ints, Floats, Floats, Floats] | None = None

    def touched(self, start: ArrayLike, end: ArrayLike, radius: float) -> Contacts:
        """Facets within the radius of a tool's axis from start to end (a capsule).

        Raises
        ------
        XfemError
            If the radius is negative, or an end not finite or not in space.
        """
        if not radius >= 0.0:
            raise XfemError(f"tool of radius {radius}; expected zero or more")
        axis = np.array([start, end], dtype=float)
        if axis.shape != (2, 3) or not np.isfinite(axis).all():
            raise XfemError(f"axis of a tool {axis.tolist()}; expected two finite points in space")
        reach = radius + _ROUND_OFF * float(np.abs(axis).max())
        numbers, corners, low, high = self._facets()
        beyond = (low > axis.max(axis=0) + reach) | (high < axis.min(axis=0) - reach)
        near = np.flatnonzero(~beyond.any(axis=1))
        distance, at = _segment_to_facets(axis[0], axis[1], corners[near])
        found = np.flatnonzero(distance <= reach)
        return Contacts(numbers[near[found]], np.minimum(distance[found], radius), at[found])

    def _facets(self) -> tuple[Ints, Floats, Floats, Floats]:
        """Numbers of the facets in use, their corners, and the corners of their boxes."""
        if self._boxes is None:
            used = self.surface.used
            corners = self.positions[self.surface.facets.rows[used]]
            self._boxes = used, corners, corners.min(axis=1), corners.max(axis=1)
        return self._boxes


def _volumes(edges: Floats) -> Floats:
    """Find the determinants (q,) of rows (q, 3, 3)."""
    return np.einsum("qi,qi->q", edges[:, 0], np.cross(edges[:, 1], edges[:, 2]))


def _pierced(start: Floats, end: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Distance (q,) of a segment from each facet that it pierces, that is 0, else ∞; weights."""
    before, behind = _volumes(corners - start), _volumes(corners - end)
    apart = ((before > 0.0) == (behind > 0.0)) & (before != 0.0) & (behind != 0.0)
    weights = np.empty(corners.shape[:2])
    for k in range(3):
        # each corner's weight is the volume that the segment spans with the others
        edges = corners - start
        edges[:, k] = end - start
        weights[:, k] = _volumes(edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights /= weights.sum(axis=1)[:, None]
        inside = (weights >= 0.0).all(axis=1)  # never where a facet lies along the segment: NaN
    return np.where(inside & ~apart & (before != behind), 0.0, np.inf), weights


def _segment_to_facets(start: Floats, end: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Distance (q,) of a segment from each facet (q, 3, 3), weights (q, 3) of the nearest point."""
    found = [_pierced(start, end, corners)]
    for x in (start, end):
        at = np.empty(corners.shape[:2])
        for facet, weights in zip(corners, at, strict=True):
            nearest_on_facet(x, facet, weights)
        foot = np.einsum("qk,qki->qi", at, corners)
        found.append((np.linalg.norm(foot - x, axis=1), at))
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        s, t = _nearest_of_segments(start, end, a, b)
        at = np.zeros(corners.shape[:2])
        at[:, k], at[:, (k + 1) % 3] = 1.0 - t, t
        away = start + s[:, None] * (end - start) - a - t[:, None] * (b - a)
        found.append((np.linalg.norm(away, axis=1), at))
    distance, weights = (np.array(rows) for rows in zip(*found, strict=True))
    best, every = distance.argmin(axis=0), np.arange(len(corners))
    return distance[best, every], weights[best, every]


def _nearest_of_segments(p: Floats, q: Floats, a: Floats, b: Floats) -> tuple[Floats, Floats]:
    """Shares (s on pq, t on each ab) of the nearest points of a segment and some others.

    Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, w = q - p, b - a, p - a
    uu, vv, uv = float(u @ u), (v * v).sum(axis=1), v @ u
    uw, vw = w @ u, (v * w).sum(axis=1)

    def share(top: Floats, bottom: Floats | float) -> Floats:
        bottom = np.broadcast_to(bottom, top.shape)
        return np.divide(top, bottom, out=np.zeros_like(top), where=bottom > 0.0)

    s = np.clip(share(uv * vw - uw * vv, uu * vv - uv * uv), 0.0, 1.0)
    t = share(uv * s + vw, vv)
    held = np.clip(t, 0.0, 1.0)
    return np.where(held != t, np.clip(share(uv * held - uw, uu), 0.0, 1.0), s), held
