"""Distances to cuts, and the sides of the cuts as asked on which points lie."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from verify.compiled import COMPILED, njit
from verify.geometry.curves import Piece
from verify.geometry.patches import Patch

Array = NDArray[np.float64]
Sides = NDArray[np.int8]
AskedCut = Sequence[Piece | Patch]


_Floats = NDArray[np.float64]


def distance_to_segments(points: _Floats, segments: _Floats) -> _Floats:
    """Measure distances (n,) of points (n, d) to the nearest segment (k, 2, d)."""
    return nearest_segments(points, segments)[0]


def nearest_segments(
    points: _Floats, segments: _Floats
) -> tuple[_Floats, _Floats, NDArray[np.int64]]:
    """Find the nearest segment of points (n, d): distance (n,), foot (n, d), number (n,).

    Without any segment the distance is infinite, the foot the point, and the segment −1.
    """
    distance, foot = np.empty(len(points)), np.array(points, dtype=float)
    which = np.empty(len(points), dtype=np.int64)
    starts, ends = (np.ascontiguousarray(segments[:, k]) for k in (0, 1))
    if not COMPILED:
        return _nearest_in_numpy(points, starts, ends)
    axes = tuple(range(points.shape[1]))  # a loop over a tuple is unrolled
    _nearest(np.ascontiguousarray(points), starts, ends, axes, distance, foot, which)
    return distance, foot, which


def _nearest_in_numpy(
    points: _Floats, starts: _Floats, ends: _Floats
) -> tuple[_Floats, _Floats, NDArray[np.int64]]:
    distance, foot = np.full(len(points), np.inf), np.array(points, dtype=float)
    which = np.full(len(points), -1)
    for k, (start, end) in enumerate(zip(starts, ends, strict=True)):
        length2 = float((end - start) @ (end - start))
        t = ((points - start) @ (end - start) / (length2 or 1.0)).clip(0.0, 1.0)[:, None]
        on_it = (1 - t) * start + t * end
        away = np.linalg.norm(points - on_it, axis=1)
        nearer = away < distance
        distance[nearer], foot[nearer], which[nearer] = away[nearer], on_it[nearer], k
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


def _distance(piece: Piece | Patch, points: Array) -> Array:
    return np.asarray(np.linalg.norm(points - piece.foot(points), axis=1))


def _sides_of(pieces: AskedCut, points: Array, reach: Array, size: float) -> Sides:
    levels = [piece.level(points) for piece in pieces]
    within = [np.abs(level) <= reach for level in levels]  # no foot is nearer than its level
    rows = np.flatnonzero(np.any(within, axis=0))
    sides = np.zeros(len(points), dtype=np.int8)
    close = [level[rows] for level in levels]
    sides[rows] = _sides_beside(pieces, close, points[rows], reach[rows], size)
    return sides


def _sides_beside(
    pieces: AskedCut, levels: Sequence[Array], points: Array, reach: Array, size: float
) -> Sides:
    found = []
    nearest = np.full(len(points), np.inf)
    for piece, level in zip(pieces, levels, strict=True):
        at = np.flatnonzero(np.abs(level) <= reach)
        away = _distance(piece, points[at])
        found.append((at, level[at], away))
        nearest[at] = np.minimum(nearest[at], away)
    met = np.zeros(len(points), dtype=np.int64)
    height = np.zeros(len(points))
    for at, level, away in found:
        tied = away <= nearest[at] + _SAME * size
        met[at[tied]] += 1
        higher = tied & (np.abs(level) > np.abs(height[at]))
        height[at[higher]] = level[higher]
    with np.errstate(invalid="ignore"):
        beyond = (met == 1) & (np.abs(height) < (1 - _NORMAL) * nearest - _SAME * size)
    sides: Sides = np.where(height >= 0.0, 1, -1).astype(np.int8)
    sides[(met == 0) | (nearest > reach) | beyond] = 0
    return sides
