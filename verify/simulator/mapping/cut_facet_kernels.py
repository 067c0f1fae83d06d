"""Triangles of a surface divided by one cut, wherever the body beneath is split.

What `verify.xfem.pieces` does for any number of cuts, for the one that is under way: at a step a
blade meets a hundred facets, and with so few only the number of calls costs.
"""

import numpy as np
from numba import njit

from verify.simulator.arrays.row_numbers import number_of_row
from verify.simulator.mapping.locate_kernels import cut_at

__all__ = ["divide_facets"]


@njit(cache=True)
def _crossed_edges(facets, values):
    """Give ends (z, 2), plus first, of edges that the cut crosses, and those (f, 3) of each facet.

    Edge k of a facet is that opposite to its corner k; -1 where the cut does not cross it.
    """
    count = len(facets)
    size = 64
    while size < 8 * count:
        size *= 2
    table, known = np.empty(size, dtype=np.int64), np.empty((2 * count, 2), dtype=np.int64)
    for place in range(size):
        table[place] = -1
    of_facet, row = np.empty((count, 3), dtype=np.int64), np.empty(2, dtype=np.int64)
    found = np.int64(0)
    for f in range(count):
        for k in range(3):
            of_facet[f, k] = -1
            a, b = facets[f, (k + 1) % 3], facets[f, (k + 2) % 3]
            if (values[a] >= 0.0) == (values[b] >= 0.0):
                continue
            row[0], row[1] = (a, b) if values[a] >= 0.0 else (b, a)
            of_facet[f, k], found = number_of_row(row, table, known, found)
    return known[:found], of_facet


@njit(cache=True)
def _points_on_edges(ends, values, points):
    """Positions (z, 3) where the level set is zero, and shares (z, 2) of both ends."""
    share, at = np.empty((len(ends), 2)), np.empty((len(ends), points.shape[1]))
    for z in range(len(ends)):
        plus, minus = ends[z, 0], ends[z, 1]
        above, below = values[plus], values[minus]
        r, s = above / (above - below), -below / (above - below)
        share[z, 0], share[z, 1] = s, r
        for i in range(points.shape[1]):
            at[z, i] = s * points[plus, i] + r * points[minus, i]
    return at, share


@njit(cache=True)
def _write(end, out, f, corners, a, b, c, at, side):
    """Write a part of facet f unless it has a corner twice; give the end.

    Its corners are three of those given, and `at` are the barycentric coordinates of all.
    """
    ids, where, source, sides = out
    if corners[a] == corners[b] or corners[b] == corners[c] or corners[c] == corners[a]:
        return end
    ids[end, 0], ids[end, 1], ids[end, 2] = corners[a], corners[b], corners[c]
    for j in range(3):
        where[end, 0, j], where[end, 1, j], where[end, 2, j] = at[a, j], at[b, j], at[c, j]
    source[end], sides[end] = f, side
    return end + 1


@njit(cache=True)
def _number_points(edges, place, share, known):
    """Give the points on edges their numbers (z,), new ones from `known` on, and count these.

    Edges and places of the new ones come first afterwards.
    """
    number, count = np.empty(len(edges), dtype=np.int64), 0
    for z in range(len(edges)):
        number[z] = edges[z, 0]  # where the level set is zero at an end, the point is that end
        if share[z, 1] > 0.0:
            number[z] = known + count
            for i in range(2):
                edges[count, i] = edges[z, i]
            for i in range(place.shape[1]):
                place[count, i] = place[z, i]
            count += 1
    return number, count


@njit(cache=True)
def _take_corners(f, facets, of_facet, inside, corners, where):
    """Write the corners of a facet; which edge is not crossed, and whether the others are split."""
    alone, through, crossed = np.int64(0), True, False
    for k in range(3):
        corners[k] = facets[f, k]
        for j in range(3):
            where[k, j] = 1.0 if j == k else 0.0
        if of_facet[f, k] < 0:
            alone = np.int64(k)
        else:
            crossed, through = True, through and inside[of_facet[f, k]]
    return alone, crossed and through


@njit(cache=True)
def divide_facets(facets, values, points, cut, tree, body):
    """Divide triangles by a cut where both places in which it crosses their edges are split.

    Parameters
    ----------
    facets : (f, 3) int array
        Places of their corners in `points`.
    values : (n,) float array
        Level set at the points, exactly zero within round-off.
    points : (n, 3) float array
    cut : int
    tree : ElementTree
    body : CutElements

    Returns
    -------
    ends : (z, 2) int array
        Ends of the edges with a new point, that above the cut first.
    positions : (z, 3) float array
    ids : (q, 3) int array
        Corners of the parts, in the direction of their facet: new points count from n on.
    at : (q, 3, 3) float array
        Barycentric coordinates of these corners in the facet.
    source : (q,) int array
        Facet of each part, ascending.
    side : (q,) int8 array
        Side of the cut; 0 of a facet that is not divided.
    """
    edges, of_facet = _crossed_edges(facets, values)
    place, share = _points_on_edges(edges, values, points)
    inside = cut_at(place, cut, tree, body)
    number, count = _number_points(edges, place, share, len(points))
    room = 3 * len(facets)
    ids, at = np.empty((room, 3), dtype=np.int64), np.empty((room, 3, 3))
    source, side = np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int8)
    # typed: a literal 0 would be a type of its own to compile for
    zero, u, v = np.int64(0), np.int64(3), np.int64(4)
    out, end = (ids, at, source, side), zero
    # the corners of a facet and two new points on its edges
    corners, where = np.empty(5, dtype=np.int64), np.empty((5, 3))
    for f in range(len(facets)):
        alone, divided = _take_corners(f, facets, of_facet, inside, corners, where)
        if not divided:
            end = _write(end, out, f, corners, zero, zero + 1, zero + 2, where, np.int8(0))
            continue
        # the corner alone on its side is opposite to the edge that is not crossed
        a, b, c = alone, (alone + 1) % 3, (alone + 2) % 3
        first, second = of_facet[f, c], of_facet[f, b]  # edges a-b and a-c
        mine = np.int8(1) if values[corners[a]] >= 0.0 else np.int8(-1)
        near, far = (0, 1) if mine > 0 else (1, 0)
        corners[u], corners[v] = number[first], number[second]
        for j in range(3):
            where[u, j] = share[first, near] * where[a, j] + share[first, far] * where[b, j]
            where[v, j] = share[second, near] * where[a, j] + share[second, far] * where[c, j]
        end = _write(end, out, f, corners, a, u, v, where, mine)
        # as in `verify.xfem.clip`: the diagonal begins at the corner with the lower number
        third, start = (v, b) if corners[b] < corners[c] else (c, u)
        end = _write(end, out, f, corners, u, b, third, where, -mine)
        end = _write(end, out, f, corners, start, c, v, where, -mine)
    return edges[:count], place[:count], ids[:end], at[:end], source[:end], side[:end]
