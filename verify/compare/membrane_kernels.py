"""Kernel: the triangle in space that is nearest to a point, on the wanted side of cuts."""

import numpy as np
from numba import njit

from verify.compare.locate_kernels import allowed, box_distance2, segment_distance2


@njit(cache=True)
def nearest_triangles(points, directions, wanted, searched, across, sides, tolerance):
    """Triangle (n,) nearest to each of `points` (n, 3), and its distance (n,).

    Of those that are equally near within `tolerance` it is the one whose centre lies in the
    direction (n, 3) that is given, if there is one, then the one whose edges are farthest.

    `wanted` (n, p) is the side of p planes, −1, 1 or 0 (either), that the triangle must lie on,
    and `sides` (m, p) the one that each triangle lies on, 0 if on both. A point whose wish no
    triangle fulfils gets the nearest of all. `searched` is as `SearchedCells`, with the normals of
    the edges, `across` (m, 3) are those of the triangles. `directions` has no rows if none is
    wanted.
    """
    n = points.shape[0]
    found = np.empty(n, dtype=np.int64)
    distance = np.empty(n)
    sided = directions.shape[0] == n
    nowhere, either = np.zeros(3), np.zeros(wanted.shape[1], dtype=wanted.dtype)
    for i in range(n):
        direction = directions[i] if sided else nowhere
        wish = wanted[i]
        for _ in range(2):
            found[i], distance[i] = _nearest(
                points[i], direction, sided, wish, searched, across, sides, tolerance
            )
            if found[i] >= 0:
                break
            wish = either
    return found, distance


@njit(cache=True)
def _nearest(x, direction, sided, wish, searched, across, sides, tolerance):
    lower, upper, cells, corners, normals, centres = searched
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    stack, gaps = np.empty(64, dtype=np.int64), np.empty(64)  # nodes and their distances
    stack[0], gaps[0], top = 1, 0.0, 1
    best, nearest, best_depth, best_side = -1, np.inf, -np.inf, False
    while top > 0:
        top -= 1
        node = stack[top]
        if gaps[top] > nearest + tolerance:
            continue
        if node < leaves:
            left, right = 2 * node, 2 * node + 1
            left_gap = np.sqrt(box_distance2(x, lower[left], upper[left]))
            right_gap = np.sqrt(box_distance2(x, lower[right], upper[right]))
            if left_gap < right_gap:  # the nearer child is taken first
                left, right, left_gap, right_gap = right, left, right_gap, left_gap
            for child, gap in ((left, left_gap), (right, right_gap)):
                if gap <= nearest + tolerance:
                    stack[top], gaps[top] = child, gap
                    top += 1
            continue
        for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
            cell = cells[k]
            if cell < 0:
                break
            if not allowed(wish, sides[cell]):
                continue
            away, depth = _distance_and_depth(x, normals[cell], across[cell], corners[cell])
            if away > nearest + tolerance:
                continue
            if away <= tolerance < depth:  # inside: there is no other
                return cell, away
            towards = 0.0
            if sided:
                for a in range(3):
                    towards += direction[a] * (centres[cell, a] - x[a])
            on_side = not sided or towards > 0.0
            if (
                away < nearest - tolerance
                or (on_side and not best_side)
                or (on_side == best_side and depth > best_depth)
            ):
                best, best_depth, best_side = cell, depth, on_side
            nearest = min(nearest, away)
    return best, nearest


@njit(cache=True)
def _distance_and_depth(x, normals, across, corners):
    """Distance of `x` to a triangle, and of its foot in the plane to the nearest edge, inwards."""
    depth, height = np.inf, 0.0
    for k in range(3):
        inwards = 0.0
        for a in range(3):
            inwards += normals[k, a] * (x[a] - corners[(k + 1) % 3, a])
        depth = min(depth, inwards)
        height += across[k] * (x[k] - corners[0, k])
    if depth >= 0.0:
        return abs(height), depth
    away2 = np.inf
    for k in range(3):
        away2 = min(away2, segment_distance2(x, corners[k], corners[(k + 1) % 3]))
    return np.sqrt(away2), depth
