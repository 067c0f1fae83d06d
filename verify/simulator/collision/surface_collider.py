"""Collision of tools with a moving surface: contacts per piece, so that each side answers.

A tool is asked against all boxes at once; only facets whose boxes it comes near are looked at.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from verify.simulator.mapping.moving_surface import MovingSurface
from verify.xfem.arrays import Floats, Ints
from verify.xfem.errors import XfemError
from verify.xfem.faceted_cuts import nearest_on_facet

_ROUND_OFF = 16.0 * np.finfo(float).eps  # of positions: what touches exactly is touched


@dataclass(frozen=True)
class Contacts:
    """Points of a surface that answer a query, one a row.

    Attributes
    ----------
    facet : (q,) int array
        Facet of the moving surface; -1 where a query found none.
    piece : (q,) int array
        Piece to which the facet belongs, so that both sides of a cut answer for themselves.
    distance : (q,) float array
        From the tool to the point, in metres.
    at : (q, k) float array
        Barycentric coordinates of the point in the facet, for `MovingSurface.facet_force`.
    share : (q,) float array
        Place on the tool, from its start (0) to its end (1).
    """

    facet: Ints
    piece: Ints
    distance: Floats
    at: Floats
    share: Floats


class SurfaceCollider:
    """Queries of tools against the facets of a moving surface.

    Parameters
    ----------
    surface : MovingSurface

    Attributes
    ----------
    positions : (v, s) float array
        Of the vertices when last refitted, in metres.
    """

    def __init__(self, surface: MovingSurface) -> None:
        self.surface = surface
        self.follow(surface.material.rows.copy())

    def refit(self, displacement: Floats) -> None:
        """Move with the body, by the displacement (N, s) of the dof nodes, in metres."""
        self.follow(self.surface.positions(displacement))

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

    def nearest(self, points: ArrayLike, limit: float = np.inf) -> Contacts:
        """Nearest point of the surface to each point (q, s), if nearer than the limit.

        Parameters
        ----------
        points : (q, s) array_like
            In metres.
        limit : float
            In metres.

        Raises
        ------
        XfemError
            If points are not finite or of another shape, or the limit is negative.
        """
        queries = self._check(points)
        if not limit >= 0.0:
            raise XfemError(f"limit {limit} m of a distance; expected zero or more")
        numbers, corners, low, high = self._facets()
        facet, distance = np.full(len(queries), -1), np.full(len(queries), np.inf)
        at, weights = np.zeros((len(queries), corners.shape[1])), np.empty(corners.shape[1])
        for q, x in enumerate(queries):
            gap = np.linalg.norm(np.maximum(0.0, np.maximum(low - x, x - high)), axis=1)
            best = limit
            for f in np.argsort(gap):
                if gap[f] > best:
                    break
                nearest_on_facet(x, corners[f], weights)
                away = float(np.linalg.norm(weights @ corners[f] - x))
                if away < best or (away == best and facet[q] < 0):
                    best, facet[q], distance[q], at[q] = away, numbers[f], away, weights
        return self._contacts(facet, distance, at, np.zeros(len(facet)))

    def pierced(self, start: ArrayLike, end: ArrayLike) -> Contacts:
        """Facets that a segment pierces, in order along it."""
        begin, stop = self._check(np.array([start, end], dtype=float))
        facet, corners = self._near(begin, stop, 0.0)
        share, at = _pierced(begin, stop, corners)
        found = np.flatnonzero(share >= 0.0)
        found = found[np.argsort(share[found])]
        return self._contacts(facet[found], np.zeros(len(found)), at[found], share[found])

    def touched(self, start: ArrayLike, end: ArrayLike, radius: float) -> Contacts:
        """Facets within the radius of a tool's axis from start to end (a capsule)."""
        if not radius >= 0.0:
            raise XfemError(f"tool of radius {radius}; expected zero or more")
        begin, stop = self._check(np.array([start, end], dtype=float))
        reach = radius + _ROUND_OFF * float(np.abs([begin, stop]).max())
        facet, corners = self._near(begin, stop, reach)
        distance, share, at = _segment_to_facets(begin, stop, corners)
        found = np.flatnonzero(distance <= reach)
        return self._contacts(
            facet[found], np.minimum(distance[found], radius), at[found], share[found]
        )

    def _facets(self) -> tuple[Ints, Floats, Floats, Floats]:
        """Numbers of the facets in use, their corners, and the corners of their boxes."""
        if self._boxes is None:
            used = self.surface.used
            corners = self.positions[self.surface.facets.rows[used]]
            self._boxes = used, corners, corners.min(axis=1), corners.max(axis=1)
        return self._boxes

    def _near(self, start: Floats, end: Floats, reach: float) -> tuple[Ints, Floats]:
        """Facets whose box meets that of a segment, widened by a reach, and their corners."""
        numbers, corners, low, high = self._facets()
        beyond = (low > np.maximum(start, end) + reach) | (high < np.minimum(start, end) - reach)
        near = np.flatnonzero(~beyond.any(axis=1))
        return numbers[near], corners[near]

    def _contacts(self, facet: Ints, distance: Floats, at: Floats, share: Floats) -> Contacts:
        piece = np.full(len(facet), -1)
        piece[facet >= 0] = self.surface.facet_piece.rows[facet[facet >= 0]]
        return Contacts(facet, piece, distance, at, share)

    def _check(self, points: ArrayLike) -> Floats:
        queries = np.ascontiguousarray(points, dtype=float)
        space = self.positions.shape[1]
        if queries.ndim != 2 or queries.shape[1] != space or not np.isfinite(queries).all():
            raise XfemError(f"query points of shape {queries.shape}; expected finite (q, {space})")
        return queries


def _volumes(edges: Floats) -> Floats:
    """Find the determinants (q,) of rows (q, s, s)."""
    if edges.shape[2] == 2:
        return edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return np.einsum("qi,qi->q", edges[:, 0], np.cross(edges[:, 1], edges[:, 2]))


def _pierced(start: Floats, end: Floats, corners: Floats) -> tuple[Floats, Floats]:
    """Share (q,) of a segment at which it pierces each facet, -1 if it does not, and weights."""
    before, behind = _volumes(corners - start), _volumes(corners - end)
    apart = ((before > 0.0) == (behind > 0.0)) & (before != 0.0) & (behind != 0.0)
    weights = np.empty(corners.shape[:2])
    for k in range(corners.shape[1]):
        # each corner's weight is the volume that the segment spans with the others
        edges = corners - start
        edges[:, k] = end - start
        weights[:, k] = _volumes(edges)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = before / (before - behind)
        weights /= weights.sum(axis=1)[:, None]
        inside = (weights >= 0.0).all(axis=1)  # never where a facet lies along the segment: NaN
    return np.where(inside & ~apart & (before != behind), share, -1.0), weights


def _segment_to_facets(
    start: Floats, end: Floats, corners: Floats
) -> tuple[Floats, Floats, Floats]:
    """Distance (q,) of a segment from each facet, share of the segment, weights on the facet."""
    count, size, _ = corners.shape
    best, share, weights = np.full(count, np.inf), np.zeros(count), np.empty((count, size))

    def take(distance: Floats, at: Floats | float, on_facet: Floats) -> None:
        nearer = distance < best
        best[nearer], weights[nearer] = distance[nearer], on_facet[nearer]
        share[nearer] = np.broadcast_to(at, count)[nearer]

    through, on_facet = _pierced(start, end, corners)
    take(np.where(through >= 0.0, 0.0, np.inf), through, on_facet)
    for tip, x in ((0.0, start), (1.0, end)):
        on_facet = np.empty((count, size))
        for facet, at in zip(corners, on_facet, strict=True):
            nearest_on_facet(x, facet, at)
        foot = np.einsum("qk,qki->qi", on_facet, corners)
        take(np.linalg.norm(foot - x, axis=1), tip, on_facet)
    for k in range(size if size == 3 else 1):
        j = (k + 1) % size
        s, t = _nearest_of_segments(start, end, corners[:, k], corners[:, j])
        on_facet = np.zeros((count, size))
        on_facet[:, k], on_facet[:, j] = 1.0 - t, t
        there = corners[:, k] + t[:, None] * (corners[:, j] - corners[:, k])
        here = start + s[:, None] * (end - start)
        take(np.linalg.norm(here - there, axis=1), s, on_facet)
    return best, share, weights


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
