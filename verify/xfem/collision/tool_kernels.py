"""A tool against facets: where a segment pierces them, and how near it comes to them."""

import numpy as np
from numba import njit

from verify.xfem.collision.simplex_kernels import (
    foot_on_facet,
    nearest_on_facet,
    squared_distance,
)

__all__ = ["capsule_contacts", "segment_hits"]

_DEEP = 128  # twice the height of any heap of boxes


@njit(cache=True)
def _facets_in_box(box_low, box_high, low, high, order):
    found, stack = [np.int64(0) for _ in range(0)], np.empty(_DEEP, dtype=np.int64)
    stack[0], top = 1, 1
    while top > 0 and len(order) > 0:
        top -= 1
        node, apart = stack[top], False
        for i in range(len(box_low)):
            apart = apart or low[node, i] > box_high[i] or high[node, i] < box_low[i]
        if apart:
            continue
        if node >= len(order):
            found.append(order[node - len(order)])
        else:
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
    return found


@njit(cache=True)
def _pierce(start, along, corners, weights):
    """Share of the segment at which it pierces a facet, weights written; -1 if it does not."""
    space = len(start)
    matrix, right = np.empty((space, space)), np.empty(space)
    for i in range(space):
        matrix[i, 0] = -along[i]
        right[i] = start[i] - corners[0, i]
        for k in range(1, space):
            matrix[i, k] = corners[k, i] - corners[0, i]
    if space == 2:
        determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    else:
        determinant = np.linalg.det(matrix)
    if determinant == 0.0:
        return -1.0
    solution = np.linalg.solve(matrix, right)
    weights[0] = 1.0
    for k in range(1, space):
        weights[k] = solution[k]
        weights[0] -= solution[k]
    for k in range(space):
        if weights[k] < 0.0:
            return -1.0
    return solution[0] if 0.0 <= solution[0] <= 1.0 else -1.0


@njit(cache=True)
def segment_hits(start, end, points, facets, low, high, order):
    """Facets (q,) that a segment pierces, the share (q,) of it at each, and weights (q, k)."""
    size, space = facets.shape[1], len(start)
    corners, weights = np.empty((size, space)), np.empty(size)
    about = _facets_in_box(np.minimum(start, end), np.maximum(start, end), low, high, order)
    found, count = np.empty(len(about), dtype=np.int64), 0
    share, at = np.empty(len(about)), np.empty((len(about), size))
    for facet in about:
        for k in range(size):
            corners[k] = points[facets[facet, k]]
        where = _pierce(start, end - start, corners, weights)
        if where >= 0.0:
            found[count], share[count] = facet, where
            at[count] = weights
            count += 1
    order_along = np.argsort(share[:count])
    return found[:count][order_along], share[:count][order_along], at[:count][order_along]


@njit(cache=True)
def _nearest_of_segments(p, q, a, b):
    """Shares (s on pq, t on ab) of the nearest points of two segments.

    Ericson, Real-Time Collision Detection, section 5.1.9.
    """
    u, v, w = q - p, b - a, p - a
    uu, vv, uv, uw, vw = (u * u).sum(), (v * v).sum(), (u * v).sum(), (u * w).sum(), (v * w).sum()
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
    share = _pierce(start, end - start, corners, weights)
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
            weights[:] = trial
    for k in range(size if size == 3 else 1):
        j = (k + 1) % size
        s, t = _nearest_of_segments(start, end, corners[k], corners[j])
        distance = squared_distance(
            start + s * (end - start), corners[k] + t * (corners[j] - corners[k])
        )
        if distance < best:
            best, share = distance, s
            weights[:] = 0.0
            weights[k], weights[j] = 1.0 - t, t
    return np.sqrt(best), share


@njit(cache=True)
def capsule_contacts(start, end, radius, points, facets, low, high, order):
    """Facets (q,) within a radius of a segment: distance (q,), share (q,), weights (q, k)."""
    size, space = facets.shape[1], len(start)
    corners, weights = np.empty((size, space)), np.empty(size)
    about = _facets_in_box(
        np.minimum(start, end) - radius, np.maximum(start, end) + radius, low, high, order
    )
    found, count = np.empty(len(about), dtype=np.int64), 0
    distance, share = np.empty(len(about)), np.empty(len(about))
    at = np.empty((len(about), size))
    for facet in about:
        for k in range(size):
            corners[k] = points[facets[facet, k]]
        gap, where = _segment_to_facet(start, end, corners, weights)
        if gap <= radius:
            found[count], distance[count], share[count] = facet, gap, where
            at[count] = weights
            count += 1
    return found[:count], distance[:count], share[:count], at[:count]
