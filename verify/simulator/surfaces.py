"""Surfaces of a played body: of the material itself, one to see, one to touch.

Surfaces of a solid can be separate meshes. A plane body and a membrane are their own surface. A
tool touches each side of a cut; only facets whose boxes it comes near are looked at.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from verify.geometry.simplices import boundary_facets, nearest_parts
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
    lines : (l, 2) int array
        Edges along which cuts meet the surface that is seen, open or closed.
    """

    def __init__(
        self, points: Floats, material: Floats, triangles: Ints, inner: Bools, lines: Ints
    ) -> None:
        beyond = ((0, 0), (0, 3 - points.shape[1]))
        self.points, self.material = np.pad(points, beyond), np.pad(material, beyond)
        self.triangles, self.inner, self.lines = triangles, inner, lines


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
    shown, touchable : MovingSurface
        That which is seen, the faces of cuts apart, and that which tools collide with. Where the
        stage has separate ones they are parts of one: following a cut costs calls, not facets.
    """

    def __init__(self, stage: Stage, cutter: SemiProgressiveCutter) -> None:
        self.material = BodySurface(cutter.body)
        self._followers: list[BodySurface | EmbeddedSurface] = [self.material]
        found, given = [self.material.surface] * 2, (stage.visual, stage.collision)
        there = [(k, *one) for k, one in enumerate(given) if one is not None]
        if there:
            numbers, points, facets = zip(*there, strict=True)
            starts, begins = ([0, *np.cumsum([len(x) for x in rows])] for rows in (points, facets))
            shifted = [rows + start for rows, start in zip(facets, starts, strict=False)]
            embedded = EmbeddedSurface(cutter, np.concatenate(points), np.concatenate(shifted))
            self._followers.append(embedded)
            for k, begin, end in zip(numbers, begins, begins[1:], strict=False):
                found[k] = embedded.surface.of_owners(begin, end)
        self.shown, self.touchable = found
        if stage.mesh.space == 3:
            uncut = self.shown.facets.rows[self.shown.used]
            self._rim = self.shown.material.rows[boundary_facets(uncut)[0]]

    def update(self, increment: Increment) -> None:
        """Let them follow a cut."""
        for follower in self._followers:
            follower.update(increment)

    def move(self, displacement: Floats) -> None:
        """Compute the positions of all vertices for a displacement (N, s) of the unknowns."""
        self._positions = [follower.surface.positions(displacement) for follower in self._followers]

    @property
    def touchable_positions(self) -> Floats:
        """(v, s) vertices of that surface after the last `move`, m."""
        return self._positions[0 if self.touchable is self.material.surface else 1]

    def picture(self, phantom: PhantomMesh, displacement: Floats) -> Picture:
        """Draw the body as it is now: the visual surface with the faces of the cuts."""
        inside = self.material.surface
        if phantom.mesh.space == 2:
            cut = inside.facets.rows[inside.used[inside.inner.rows[inside.used]]]
            ends = cut.ravel()
            lines = inside.positions(displacement)[ends], inside.material.rows[ends]
            return _pieces(phantom, displacement, *lines)
        parts = [(inside, inside.used)]
        if self.shown is not inside:
            shown = inside.used[inside.inner.rows[inside.used]]
            parts = [(inside, shown), (self.shown, self.shown.used)]
        points, material, triangles, inner, begin = [], [], [], [], 0
        for number, (surface, used) in enumerate(parts):
            vertices, corners = np.unique(surface.facets.rows[used], return_inverse=True)
            points.append(surface.positions(displacement)[vertices])
            material.append(surface.material.rows[vertices])
            triangles.append(corners.reshape(-1, inside.facets.rows.shape[1]) + begin)
            inner.append(surface.inner.rows[used] & (number == 0))
            begin += len(vertices)
        at, before, corner, on_cut = map(np.concatenate, (points, material, triangles, inner))
        return Picture(at, before, corner, on_cut, self._lines(before, corner[~on_cut]))

    def _lines(self, material: Floats, skin: Ints) -> Ints:
        """Find edges (l, 2) along which cuts meet the skin: its borders that are not on its rim.

        Vertices are doubled where, and only where, the skin is parted.
        """
        edges = boundary_facets(skin)[0]
        if not len(edges) or not len(self._rim):
            return edges
        away = nearest_parts(material[edges].mean(axis=1), self._rim)[0]
        return np.asarray(edges[away > 1e-9 * np.ptp(material, axis=0).max()])


def _pieces(
    phantom: PhantomMesh, displacement: Floats, lines: Floats, lines_material: Floats
) -> Picture:
    """Draw a plane body: its whole triangles, the parts of the split ones, lines (2l, 2)."""
    piece, at, _ = phantom.solid_simplices
    corners = phantom.mesh.points[phantom.mesh.cells[phantom.parent[piece]]]
    turned = np.linalg.det(at) < 0.0  # sub-simplices come in the order of their numbers
    at = np.where(turned[:, None, None], at[:, ::-1], at)
    moved = corners + displacement[phantom.cells[piece]]
    now, before = (
        np.einsum("qki,qis->qks", at, x).reshape(-1, corners.shape[2]) for x in (moved, corners)
    )
    triangles = np.arange(len(now)).reshape(-1, 3)
    return Picture(
        np.concatenate([now, lines]), np.concatenate([before, lines_material]), triangles,
        np.zeros(len(triangles), dtype=bool), len(now) + np.arange(len(lines)).reshape(-1, 2),
    )  # fmt: skip


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

    def touched(self, start: ArrayLike, end: ArrayLike, radius: float) -> Contacts:
        """Find the facets within the radius of a tool's axis from start to end (a capsule).

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
        used = self.surface.used
        found, distance, at = used.copy(), np.empty(len(used)), np.empty((len(used), 3))
        count = _touched(
            axis[0], axis[1], self.positions, self.surface.facets.rows, reach, found, distance, at
        )
        return Contacts(found[:count], np.minimum(distance[:count], radius), at[:count])


@njit(cache=True)
def _touched(start, end, positions, facets, reach, found, distance, at):
    """Keep of the `found` facets those within `reach` of a segment; how many there are.

    Writes their distances and the weights (q, 3) of the nearest points.

    Take a triangle that a segment does not pierce. Their nearest points are an end of the segment
    and a point of the triangle, or lie on an edge of the triangle.
    """
    corners, ends = np.empty((3, 3)), np.stack((start, end))
    weights, count = np.empty(3), 0
    for n in range(len(found)):
        f, apart = found[n], False
        for i in range(3):
            low = high = positions[facets[f, 0], i]
            for k in range(3):
                x = positions[facets[f, k], i]
                corners[k, i] = x
                low, high = min(low, x), max(high, x)
            apart |= low > max(start[i], end[i]) + reach or high < min(start[i], end[i]) - reach
        if apart:
            continue
        best = _pierced(start, end, corners, weights)
        at[count] = weights
        for k in range(5):
            if best == 0.0:
                break
            if k < 2:
                nearest_on_facet(ends[k], corners, weights)
                off = ends[k] - weights[0] * corners[0]
                off -= weights[1] * corners[1] + weights[2] * corners[2]
                away = np.sqrt(_dot(off, off))
            else:
                away = _from_edge(start, end, corners, k - 2, weights)
            if away < best:
                best = away
                at[count] = weights
        if best <= reach:
            found[count], distance[count] = f, best
            count += 1
    return count


@njit(inline="always")
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(inline="always")
def _volume(a, b, c):
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


@njit(cache=True)
def _pierced(start, end, corners, weights):
    """Return 0 and weights if a segment pierces a facet, else an infinite distance."""
    before = _volume(corners[0] - start, corners[1] - start, corners[2] - start)
    behind = _volume(corners[0] - end, corners[1] - end, corners[2] - end)
    if before == behind or (before != 0.0 and behind != 0.0 and (before > 0.0) == (behind > 0.0)):
        return np.inf
    total, along = 0.0, end - start
    for k in range(3):  # each corner's weight is the volume that the segment spans with the others
        one, other = corners[(k + 1) % 3] - start, corners[(k + 2) % 3] - start
        weights[k] = _volume(along, one, other)
        total += weights[k]
    if total == 0.0:  # the facet lies along the segment
        return np.inf
    for k in range(3):
        weights[k] /= total
    return 0.0 if weights.min() >= 0.0 else np.inf


@njit(cache=True)
def _from_edge(p, q, corners, k, weights):
    """Compute distance of a segment pq from an edge of a facet, and the weights of the point there.

    Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    j = (k + 1) % 3
    u, v, w = q - p, corners[j] - corners[k], p - corners[k]
    uu, vv, uv, uw, vw = _dot(u, u), _dot(v, v), _dot(u, v), _dot(u, w), _dot(v, w)
    s, bottom = 0.0, uu * vv - uv * uv
    if bottom > 0.0:
        s = min(max((uv * vw - uw * vv) / bottom, 0.0), 1.0)
    t = (uv * s + vw) / vv if vv > 0.0 else 0.0
    if not 0.0 <= t <= 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - uw) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    weights[:] = 0.0
    weights[k], weights[j] = 1.0 - t, t
    w = w + s * u - t * v
    return np.sqrt(_dot(w, w))
