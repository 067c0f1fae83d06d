"""Distances to cuts, and the sides of the cuts as asked on which points lie."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.cell_tree import axes_of
from verify.compiled import COMPILED, njit
from verify.geometry.curves import Piece
from verify.geometry.patches import Patch
from verify.geometry.simplices import feet, nearest_parts

Array = NDArray[np.float64]
Sides = NDArray[np.int8]
AskedCut = Sequence[Piece | Patch]


_Floats = NDArray[np.float64]
_FEW = 8  # segments: each point is sooner held against all of them than asked whether it is near


def distance_to_segments(points: _Floats, segments: _Floats, within: float) -> _Floats:
    """Measure distances (n,) of points (n, d) to the nearest segment (k, 2, d), m.

    Of points farther than `within` m it may be infinite: most are far from all, and left out.
    """
    if 0 < len(segments) <= _FEW:
        return nearest_segments(points, segments)[0]
    distance = np.full(len(points), np.inf)
    if len(segments):
        longest = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1).max()
        reach = (within + 0.5 * longest) * (1.0 + 1e-9)
        middles = cKDTree(segments.mean(axis=1))
        rows = np.isfinite(middles.query(points, distance_upper_bound=reach)[0])
        distance[rows] = nearest_segments(points[rows], segments)[0]
    return distance


def nearest_segments(
    points: _Floats, segments: _Floats
) -> tuple[_Floats, _Floats, NDArray[np.int64]]:
    """Find the nearest segment of points (n, d): distance (n,), foot (n, d), number (n,).

    Without any segment the distance is infinite, the foot the point, and the segment −1.
    """
    starts, ends = (np.ascontiguousarray(segments[:, k]) for k in (0, 1))
    if not COMPILED and len(segments):
        distance, which = nearest_parts(points, segments)
        return distance, feet(points, starts[which], ends[which]), which
    distance, foot = np.empty(len(points)), np.array(points, dtype=float)
    which = np.empty(len(points), dtype=np.int64)
    axes = axes_of(points.shape[1])
    _nearest(np.ascontiguousarray(points), starts, ends, axes, distance, foot, which)
    return distance, foot, which


@njit(cache=True)
def _nearest(points, starts, ends, axes, distance, foot, which):
    d = len(axes)
    for i in range(points.shape[0]):
        best, share, which[i] = np.inf, 0.0, -1
        for k in range(starts.shape[0]):
            along, length2 = 0.0, 0.0
            for c in range(d):
                edge = ends[k, c] - starts[k, c]
                along += (points[i, c] - starts[k, c]) * edge
                length2 += edge * edge
            t = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
            away2 = 0.0
            for c in range(d):
                away2 += (points[i, c] - (1 - t) * starts[k, c] - t * ends[k, c]) ** 2
            if away2 < best:
                best, which[i], share = away2, k, t
        distance[i], k = np.sqrt(best), which[i]
        if k >= 0:
            for c in range(d):
                foot[i, c] = (1 - share) * starts[k, c] + share * ends[k, c]


# Of the body's size: feet on two pieces of a cut that are equally far within it are one corner.
_SAME = 1e-12
# A point is beside a piece if the way to its foot is normal to the piece, up to this angle².
_NORMAL = 1e-9


def asked_sides(cuts: Sequence[AskedCut], points: Array, reach: Array, size: float) -> Sides:
    """Compute the side (n, c) of each of c cuts on which points (n, d) lie: 1, −1, or 0.

    It is 0 of points farther from the cut than their `reach` (n,) in m, and of points beyond an
    end. At a corner the piece whose plane is farther gives the side: the nearer plane is continued
    into the other side. Points on the cut to the last bit are on the positive side. `size` is the
    size of the body, m.
    """
    sides = np.zeros((len(points), len(cuts)), dtype=np.int8)
    for k, pieces in enumerate(cuts):
        sides[:, k] = _sides_of(pieces, points, reach, size)
    return sides


def distance_to_cut(pieces: AskedCut, points: Array) -> tuple[Array, Array, NDArray[np.int64]]:
    """Find the distance (n,) of points to a cut as asked, m, feet (n, d), nearest pieces (n,)."""
    feet = np.array([piece.foot(points) for piece in pieces])
    away = np.linalg.norm(points - feet, axis=2)
    nearest, rows = away.argmin(axis=0), np.arange(len(points))
    return away[nearest, rows], feet[nearest, rows], np.asarray(nearest)


def _sides_of(pieces: AskedCut, points: Array, reach: Array, size: float) -> Sides:
    near = np.zeros(len(points), dtype=bool)  # no foot is nearer than its level
    for piece in pieces:
        near |= np.abs(piece.level(points)) <= reach
    rows, sides = np.flatnonzero(near), np.zeros(len(points), dtype=np.int8)
    points, reach = points[rows], reach[rows]
    found, nearest = [], np.full(len(rows), np.inf)
    for piece in pieces:
        level = piece.level(points)
        at = np.flatnonzero(np.abs(level) <= reach)
        away = np.linalg.norm(points[at] - piece.foot(points[at]), axis=1)
        found.append((at, level[at], away))
        nearest[at] = np.minimum(nearest[at], away)
    met, height = np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows))
    for at, level, away in found:
        tied = away <= nearest[at] + _SAME * size
        met[at[tied]] += 1
        higher = tied & (np.abs(level) > np.abs(height[at]))
        height[at[higher]] = level[higher]
    with np.errstate(invalid="ignore"):
        beyond = (met == 1) & (np.abs(height) < (1 - _NORMAL) * nearest - _SAME * size)
    sides[rows] = np.where(height >= 0.0, 1, -1)
    sides[rows[(met == 0) | (nearest > reach) | beyond]] = 0
    return sides
