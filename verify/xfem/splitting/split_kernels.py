"""Division of simplices by a cut: edges that it crosses, and the parts on its two sides."""

import numpy as np
from numba import njit

from verify.xfem.arrays.row_numbers import number_of_row, point_on_edge

__all__ = [
    "crossed_cells",
    "crossed_edges",
    "divide_simplices",
    "edges_of_cells",
    "first_divided",
    "gone_through",
    "points_of_edges",
    "points_on_edges",
    "two_sides",
    "whole_simplices",
]


@njit(cache=True)
def crossed_cells(cells, values):
    """Cells that have corners on both sides of the only cut there is, given (n, 1) level sets."""
    found, count = np.empty(len(cells), dtype=np.int64), 0
    for cell in range(len(cells)):
        above = 0
        for a in range(cells.shape[1]):
            above += values[cells[cell, a], 0] >= 0.0
        if 0 < above < cells.shape[1]:
            found[count] = cell
            count += 1
    return found[:count].copy()


@njit(cache=True)
def edges_of_cells(chosen, cells, points, values, table, known, edges, size):
    """Give numbers to the edges of cells that the only cut crosses, rows (0, plus, minus).

    Returns their count. Writes the numbers of those of each cell (q, e), -1 where it has no more,
    and the length (q,) of its longest edge.
    """
    count, row, corners = np.int64(0), np.zeros(3, dtype=np.int64), cells.shape[1]
    for q in range(len(chosen)):
        cell, own, longest = chosen[q], 0, 0.0
        for a in range(corners):
            for b in range(a):
                length = 0.0
                for i in range(points.shape[1]):
                    length += (points[cells[cell, a], i] - points[cells[cell, b], i]) ** 2
                longest = max(longest, length)
            if values[cells[cell, a], 0] < 0.0:
                continue
            for b in range(corners):
                if values[cells[cell, b], 0] < 0.0:
                    row[1], row[2] = cells[cell, a], cells[cell, b]
                    edges[q, own], count = number_of_row(row, table, known, count)
                    own += 1
        for k in range(own, edges.shape[1]):
            edges[q, k] = -1
        size[q] = np.sqrt(longest)
    return count


@njit(cache=True)
def points_on_edges(edges, points, values):
    """Where the only cut crosses edges, rows (0, plus, minus), and the share of each plus end."""
    places, share = np.empty((len(edges), points.shape[1])), np.empty(len(edges))
    for k in range(len(edges)):
        plus, minus = edges[k, 1], edges[k, 2]
        above, below = values[plus, 0], values[minus, 0]
        r, s = above / (above - below), -below / (above - below)
        for i in range(points.shape[1]):
            places[k, i] = s * points[plus, i] + r * points[minus, i]
        share[k] = r
    return places, share


@njit(cache=True)
def points_of_edges(edges, order, share, places, count):
    """Give points to edges in some order: the plus end where that is on the cut, else a new one.

    Returns the point (k,) of each edge, and ends and places of the new ones, from `count` on.
    """
    point = np.empty(len(edges), dtype=np.int64)
    ends = np.empty((len(edges), 2), dtype=np.int64)
    new_places, new = np.empty_like(places), 0
    for k in order:
        point[k] = edges[k, 1]
        if share[k] > 0.0:
            point[k] = count + new
            for e in range(2):
                ends[new, e] = edges[k, 1 + e]
            for i in range(places.shape[1]):
                new_places[new, i] = places[k, i]
            new += 1
    return point, ends[:new], new_places[:new]


@njit(cache=True)
def gone_through(edges, level, depth, size, reach, at_end, some):
    """Whether the only cut goes through cells, at all of their `edges` (q, e) or at `some`.

    Parameters
    ----------
    edges : (q, e) int array
        -1 where a cell has no more.
    level, depth : (k,) float array
        Of the cut where it crosses each edge.
    size : (q,) float array
        Of the cells.
    reach, at_end : float
        How far off the cut, and how deep within it, a place must be, in sizes of the cell.
    some : bool
    """
    found = np.empty(len(edges), dtype=np.bool_)
    for q in range(len(edges)):
        every, one = True, False
        for edge in edges[q]:
            if edge < 0:
                continue
            inside = abs(level[edge]) <= reach * size[q] and depth[edge] >= at_end * size[q]
            every, one = every and inside, one or inside
        found[q] = one if some else every
    return found


@njit(cache=True)
def whole_simplices(chosen, cells):
    """Simplices that are whole cells, as `divide_simplices` takes them, and who is below each."""
    count, corners = len(chosen), cells.shape[1]
    piece, below = np.arange(count), np.arange(count, 2 * count)
    points, barycentric = (
        np.empty((count, corners), dtype=np.int64),
        np.zeros((count, corners, corners)),
    )
    for q in range(count):
        for k in range(corners):
            points[q, k], barycentric[q, k, k] = cells[chosen[q], k], 1.0
    sign, active = np.ones(count, dtype=np.int8), np.ones(count, dtype=np.bool_)
    return (piece, points, barycentric, np.ones(count), sign), active, below


@njit(cache=True)
def two_sides(cells, piece):
    """Write numbers of the parts of divided cells into `piece`: two by two, that above first.

    Returns the cell and the label (2q, 1) of each part.
    """
    count = len(cells)
    for k in range(len(piece)):
        piece[k] = 2 * piece[k] if piece[k] < count else 2 * (piece[k] - count) + 1
    parent, label = np.empty(2 * count, dtype=np.int64), np.empty((2 * count, 1), dtype=np.int8)
    for q in range(2 * count):
        parent[q], label[q, 0] = cells[q // 2], 1 - 2 * (q % 2)
    return parent, label


@njit(cache=True)
def first_divided(points, nodes, turn, now):
    """Note at which turn points of simplices that are no nodes were first used."""
    for s in range(points.shape[0]):
        for k in range(points.shape[1]):
            zero = points[s, k] - nodes
            if zero >= 0:
                turn[zero] = min(turn[zero], now)


@njit(cache=True)
def crossed_edges(points, piece, label, values, cut):
    """Edges (q, 2) from plus to minus, and the piece (q,) of the simplex, where a cut crosses one.

    Of pieces that the cut has divided already none are given.
    """
    corners = points.shape[1]
    most = (corners // 2) * (corners - corners // 2)
    ends = np.empty((most * len(points), 2), dtype=np.int64)
    owner = np.empty(most * len(points), dtype=np.int64)
    count = 0
    for s in range(len(points)):
        if label[piece[s], cut] != 0:
            continue
        for a in range(corners):
            if values[points[s, a], cut] < 0.0:
                continue
            for b in range(corners):
                if values[points[s, b], cut] < 0.0:
                    ends[count, 0], ends[count, 1] = points[s, a], points[s, b]
                    owner[count] = piece[s]
                    count += 1
    return ends[:count], owner[:count]


@njit(cache=True)
def _pattern(row, values, cut):
    """Sum of 2^k over the corners k on the plus side, as `Staircase` counts."""
    found = 0
    for k in range(len(row)):
        if values[row[k], cut] >= 0.0:
            found |= 1 << k
    return found


@njit(cache=True)
def _in_order(row, order):
    """Write the order in which a row ascends; return the sign of that permutation."""
    sign = 1
    for i in range(len(row)):
        k = i
        while k > 0 and row[order[k - 1]] > row[i]:
            order[k] = order[k - 1]
            k, sign = k - 1, -sign
        order[k] = i
    return sign


@njit(cache=True)
def divide_simplices(simplices, values, cut, active, below, stairs, edges):
    """Divide the simplices of active pieces by a cut.

    Parameters
    ----------
    simplices : tuple of arrays
        Piece (k,), points (k, c), barycentric corners (k, c, c), share (k,) and sign (k,).
    values : (n, cuts) float array
        Level sets at the points.
    active : (p,) bool array
        Pieces that the cut divides.
    below : (p,) int array
        Piece that takes what is below in each of these.
    stairs : Staircase
    edges : EdgeTable

    Returns
    -------
    simplices : tuple of arrays
        The same, those that are not clipped first.
    kept : int
        How many these are.
    """
    piece, points, barycentric, fraction, sign = simplices
    count, corners = points.shape
    whole = (1 << corners) - 1
    kept, total = np.int64(0), np.int64(0)
    for s in range(count):
        parts = 0
        if active[piece[s]]:
            pattern = _pattern(points[s], values, cut)
            parts = stairs.start[pattern + 1] - stairs.start[pattern]
        kept += parts == 0
        total += max(parts, 1)
    new_piece = np.empty(total, dtype=np.int64)
    new_points = np.empty((total, corners), dtype=np.int64)
    new_barycentric = np.empty((total, corners, corners))
    new_fraction, new_sign = np.empty(total), np.empty(total, dtype=np.int8)
    new = (new_piece, new_points, new_barycentric, new_fraction, new_sign)
    order, row = np.empty(corners, dtype=np.int64), np.empty(3, dtype=np.int64)
    # of the points on the edges: number, and the shares (r, s) of their ends
    number = np.empty((corners, corners), dtype=np.int64)
    share = np.empty((2, corners, corners))
    at, end = np.int64(0), kept
    for s in range(count):
        pattern = _pattern(points[s], values, cut) if active[piece[s]] else whole
        if pattern == 0 or pattern == whole:
            new_piece[at] = piece[s] if pattern == whole else below[piece[s]]
            for k in range(corners):
                new_points[at, k] = points[s, k]
                for j in range(corners):
                    new_barycentric[at, k, j] = barycentric[s, k, j]
            new_fraction[at], new_sign[at] = fraction[s], sign[s]
            at += 1
            continue
        turned, pattern = _in_order(points[s], order), 0
        for k in range(corners):
            plus = points[s, order[k]]
            number[k, k], share[0, k, k], share[1, k, k] = plus, 0.0, 1.0
            above = values[plus, cut]
            if above < 0.0:
                continue
            pattern |= 1 << k
            for j in range(corners):
                minus = points[s, order[j]]
                beneath = values[minus, cut]
                if beneath < 0.0:
                    number[k, j] = point_on_edge(cut, plus, minus, edges, row)
                    share[0, k, j] = above / (above - beneath)
                    share[1, k, j] = -beneath / (above - beneath)
        for entry in range(stairs.start[pattern], stairs.start[pattern + 1]):
            new_piece[end] = piece[s] if stairs.side[entry] > 0 else below[piece[s]]
            new_sign[end] = turned * sign[s] * stairs.sign[entry]
            volume = 1.0
            for k in range(corners):
                a, b = stairs.factors[entry, k, 1], stairs.factors[entry, k, 2]
                volume *= share[stairs.factors[entry, k, 0], a, b]
                a, b = stairs.plus[entry, k], stairs.minus[entry, k]
                new_points[end, k] = number[a, b]
                for j in range(corners):
                    new_barycentric[end, k, j] = (
                        share[1, a, b] * barycentric[s, order[a], j]
                        + share[0, a, b] * barycentric[s, order[b], j]
                    )
            new_fraction[end] = fraction[s] * volume
            end += 1
    return new, kept
