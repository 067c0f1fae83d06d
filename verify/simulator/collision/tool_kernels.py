"""A tool against facets: where a segment pierces them, and how near it comes to them.

In numbers, not rows: sums and copies of rows take numba five times as long to compile.
"""

import numpy as np
from numba import njit

from verify.simulator.simplex_kernels import signed_volume
from verify.xfem.nearest_points import foot_on_facet, nearest_on_facet, squared_distance

__all__ = ["capsule_contacts", "segment_hits"]

_DEEP = 128  # twice the height of any heap of boxes
_ROUND_OFF = 16.0 * np.finfo(float).eps  # of positions: what touches exactly is touched


@njit(cache=True)
def _facets_near(start, end, radius, low, high, order):
    """Facets whose box meets that of a segment, widened by a radius."""
    found, stack = [np.int64(0) for _ in range(0)], np.empty(_DEEP, dtype=np.int64)
    stack[0], top = 1, 1
    while top > 0 and len(order) > 0:
        top -= 1
        node, apart = stack[top], False
        for i in range(len(start)):
            apart = apart or low[node, i] > max(start[i], end[i]) + radius
            apart = apart or high[node, i] < min(start[i], end[i]) - radius
        if apart:
            continue
        if node >= len(order):
            found.append(order[node - len(order)])
        else:
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
    return found


@njit(cache=True)
def _write(x, row, into):
    for i in range(len(x)):
        into[row, i] = x[i]


@njit(cache=True)
def _pierce(start, end, corners, weights):
    """Share of the segment at which it pierces a facet, weights written; -1 if it does not."""
    size = len(corners)
    simplex = np.empty((size + 1, size))
    for k in range(size):
        _write(corners[k], k + 1, simplex)
    _write(start, 0, simplex)
    before = signed_volume(simplex)
    _write(end, 0, simplex)
    behind = signed_volume(simplex)
    if (before > 0.0) == (behind > 0.0) and before != 0.0 and behind != 0.0:
        return -1.0
    if before == behind:
        return -1.0  # in the plane of the facet
    # each corner's weight is the volume that the segment spans with the others
    share, total = before / (before - behind), 0.0
    _write(start, 0, simplex)
    for k in range(size):
        _write(end, k + 1, simplex)
        weights[k] = signed_volume(simplex)
        _write(corners[k], k + 1, simplex)
        total += weights[k]
    if total == 0.0:
        return -1.0
    for k in range(size):
        weights[k] /= total
        if weights[k] < 0.0:
            return -1.0
    return share


@njit(cache=True)
def segment_hits(start, end, points, facets, low, high, order):
    """Facets (q,) that a segment pierces, the share (q,) of it at each, and weights (q, k)."""
    size, space = facets.shape[1], len(start)
    corners, weights = np.empty((size, space)), np.empty(size)
    about = _facets_near(start, end, 0.0, low, high, order)
    found, count = np.empty(len(about), dtype=np.int64), 0
    share, at = np.empty(len(about)), np.empty((len(about), size))
    for facet in about:
        for k in range(size):
            _write(points[facets[facet, k]], k, corners)
        where = _pierce(start, end, corners, weights)
        if where >= 0.0:
            found[count], share[count] = facet, where
            _write(weights, count, at)
            count += 1
    return found[:count], share[:count], at[:count]


@njit(cache=True)
def _nearest_of_segments(p, q, a, b):
    """Shares (s on pq, t on ab) of the nearest points of two segments.

    Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    uu = vv = uv = uw = vw = 0.0
    for i in range(len(p)):
        u, v, w = q[i] - p[i], b[i] - a[i], p[i] - a[i]
        uu, vv, uv, uw, vw = uu + u * u, vv + v * v, uv + u * v, uw + u * w, vw + v * w
    s, denominator = 0.0, uu * vv - uv * uv
    if uu > 0.0 and denominator > 0.0:
        s = min(max((uv * vw - uw * vv) / denominator, 0.0), 1.0)
    t = (uv * s + vw) / vv if vv > 0.0 else 0.0
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - uw) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
    return s, t


@njit(cache=True)
def _segment_to_facet(start, end, corners, weights):
    """(distance, share of the segment) of the nearest points; weights on the facet written."""
    size, space = corners.shape
    share = _pierce(start, end, corners, weights)
    if share >= 0.0:
        return 0.0, share
    trial, foot = np.empty(size), np.empty(space)
    best, share = np.inf, 0.0
    for tip in range(2):
        x = start if tip == 0 else end
        nearest_on_facet(x, corners, trial)
        foot_on_facet(corners, trial, foot)
        distance = squared_distance(x, foot)
        if distance < best:
            best, share = distance, float(tip)
            for k in range(size):
                weights[k] = trial[k]
    for k in range(size if size == 3 else 1):
        j = (k + 1) % size
        s, t = _nearest_of_segments(start, end, corners[k], corners[j])
        distance = 0.0
        for i in range(space):
            there = corners[k, i] + t * (corners[j, i] - corners[k, i])
            distance += (start[i] + s * (end[i] - start[i]) - there) ** 2
        if distance < best:
            best, share = distance, s
            for l in range(size):
                weights[l] = 0.0
            weights[k], weights[j] = 1.0 - t, t
    return np.sqrt(best), share


@njit(cache=True)
def capsule_contacts(start, end, radius, points, facets, low, high, order):
    """Facets (q,) within a radius of a segment: distance (q,), share (q,), weights (q, k)."""
    size, space = facets.shape[1], len(start)
    corners, weights = np.empty((size, space)), np.empty(size)
    reach = 0.0
    for i in range(space):
        reach = max(reach, abs(start[i]), abs(end[i]))
    reach = radius + _ROUND_OFF * reach
    about = _facets_near(start, end, reach, low, high, order)
    found, count = np.empty(len(about), dtype=np.int64), 0
    distance, share = np.empty(len(about)), np.empty(len(about))
    at = np.empty((len(about), size))
    for facet in about:
        for k in range(size):
            _write(points[facets[facet, k]], k, corners)
        gap, where = _segment_to_facet(start, end, corners, weights)
        if gap <= reach:
            found[count], distance[count], share[count] = facet, min(gap, radius), where
            _write(weights, count, at)
            count += 1
    return found[:count], distance[:count], share[:count], at[:count]
