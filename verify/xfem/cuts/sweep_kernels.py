"""Level set, depth and travel of a sweep at a point, and at many."""

import numpy as np
from numba import njit

from verify.xfem.cuts.simplex_kernels import (
    foot_on_facet,
    nearest_on_facet,
    squared_distance,
)

__all__ = ["probe", "probe_points"]


@njit(cache=True)
def probe(x, sweep, room):
    """Give (level set, distance past the rim or 0, travel of the nearest point) at x (s,).

    `room` (4, 3) is written: a walk asks this thousands of times and allocates nothing.
    """
    count, size, space = sweep.corners.shape
    weights, best_weights = room[0, :size], room[1, :size]
    foot, best_foot = room[2, :space], room[3, :space]
    best, nearest = np.inf, 0
    for t in range(count):
        nearest_on_facet(x, sweep.corners[t], weights)
        foot_on_facet(sweep.corners[t], weights, foot)
        distance = squared_distance(x, foot)
        if distance < best:
            best, nearest = distance, t
            for k in range(size):
                best_weights[k] = weights[k]
            for i in range(space):
                best_foot[i] = foot[i]
    zeros, last, only, travel = 0, 0, 0, 0.0
    for k in range(size):
        if best_weights[k] == 0.0:
            zeros, last = zeros + 1, k
        else:
            only = k
        travel += best_weights[k] * sweep.travel[nearest, k]
    normal, rim = sweep.normals[nearest], False
    if zeros == size - 1:
        normal, rim = sweep.vertex_normals[nearest, only], sweep.vertex_rim[nearest, only]
    elif zeros == 1:
        rim = sweep.edge_rim[nearest, last]
        if not rim:
            normal = sweep.edge_normals[nearest, last]
    along = 0.0
    for i in range(space):
        along += (x[i] - best_foot[i]) * normal[i]
    if zeros == 0:
        return along, 0.0, travel
    if rim:
        beyond = 0.0
        for i in range(space):
            beyond += (x[i] - best_foot[i] - along * normal[i]) ** 2
        return along, np.sqrt(beyond), travel
    return (np.sqrt(best) if along >= 0.0 else -np.sqrt(best)), 0.0, travel


@njit(cache=True)
def probe_points(points, sweep):
    """(n, 3): level set, depth (distance to the rim, negative past it), travel."""
    found = np.empty((len(points), 3))
    space = points.shape[1]
    size = sweep.rim.shape[1]
    weights, corner, room = np.empty(size), np.empty(space), np.empty((4, 3))
    for n in range(len(points)):
        x = points[n]
        level, beyond, travel = probe(x, sweep, room)
        if beyond > 0.0:
            depth = -beyond
        else:
            gap = np.inf
            for r in range(len(sweep.rim)):
                if size == 1:
                    for i in range(space):
                        corner[i] = sweep.rim[r, 0, i]
                else:
                    nearest_on_facet(x, sweep.rim[r], weights)
                    foot_on_facet(sweep.rim[r], weights, corner)
                gap = min(gap, squared_distance(x, corner))
            # measured along the sweep: without the part across it
            depth = np.sqrt(max(gap - level * level, 0.0))
        found[n, 0], found[n, 1], found[n, 2] = level, depth, travel
    return found
