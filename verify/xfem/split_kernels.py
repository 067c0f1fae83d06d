"""Division of simplices by a cut: edges that it crosses, and the parts on its two sides."""

import numpy as np
from numba import njit

from verify.xfem.row_numbers import number_of_row, point_on_edge

__all__ = ["crossed_cells", "crossed_edges", "divide_simplices", "edges_of_cells"]


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
    and the length (q,) of the longest edge from its first corner.
    """
    count, row, corners = np.int64(0), np.zeros(3, dtype=np.int64), cells.shape[1]
    for q in range(len(chosen)):
        cell, own, longest = chosen[q], 0, 0.0
        for a in range(corners):
            length = 0.0
            for i in range(points.shape[1]):
                length += (points[cells[cell, a], i] - points[cells[cell, 0], i]) ** 2
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
