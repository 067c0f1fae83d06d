"""Points on edges, and facets bisected at them: no hanging vertex is left on a surface.

Where a cut ends, a facet beside the end has a point on its edge that is not a vertex of it. All
facets along an edge ask the same record of points, so that they are bisected alike. Edges on which
elements meet lie on an edge of the mesh, or on the line in which a cut crosses a face of it: the
record is by these.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.cutting.distinct import distinct
from verify.xfem.cutting.point_numbers import PointNumbers
from verify.xfem.growing_array import GrowingArray
from verify.xfem.row_numbers import RowNumbers, find_row, number_of_row

__all__ = ["EdgePoints"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_NODES, _CUTS = 4, 3  # as `PointNumbers.supports` lists them
_FACE = 3  # corners of a face
_WIDTH = _FACE + 1  # a line: the nodes of an edge or a face, and the cut that crosses it
_NONE = np.iinfo(np.int64).max
_ALIGNED = 1.0 - 1e-15  # squared cosine between an edge and the line on which it lies


class EdgePoints:
    """Which points lie inside which edges.

    Parameters
    ----------
    nodes : (n, s) float array
        Mesh nodes, in metres.
    points : PointNumbers
        Points where cuts meet that mesh.
    """

    def __init__(self, nodes: _Floats, points: PointNumbers) -> None:
        self._nodes, self._points = nodes, points
        self._lines = RowNumbers(_WIDTH)
        self._first = GrowingArray(np.empty(0, dtype=np.int64))
        self._directions = GrowingArray(np.empty((0, nodes.shape[1])))
        self._entries = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self._recorded = GrowingArray(np.empty(0, dtype=bool))

    def add(self, numbers: _Ints) -> None:
        """Record points (by number; mesh nodes are ignored) on the lines on which they lie."""
        fresh = self._recorded.extend(len(self._points.ends) - len(self._recorded))
        self._recorded.rows[fresh:] = False
        zero = numbers[numbers >= self._points.nodes] - self._points.nodes
        zero = distinct(zero[~self._recorded.rows[zero]])
        self._recorded.rows[zero] = True
        table, known, lines = self._lines.open_for(_CUTS * len(zero))
        begin = self._first.extend(_CUTS * len(zero))
        self._first.rows[begin:] = -1
        used = len(self._entries)
        self._entries.extend(_CUTS * len(zero))
        lines, used = _record(
            zero, self._points.supports, table, known, lines, self._first.rows,
            self._entries.rows, used,
        )  # fmt: skip
        self._lines.close(lines)
        self._first.rows = self._first.rows[:lines]
        known_lines = self._directions.extend(lines - len(self._directions))
        self._directions.rows[known_lines:] = 0.0
        self._entries.rows = self._entries.rows[:used]

    def bisect(self, facets: _Ints) -> tuple[_Ints, _Ints, _Floats]:
        """Bisect triangles at all recorded points on their edges; segments stay.

        Parameters
        ----------
        facets : (t, k) int array
            Numbers of points.

        Returns
        -------
        facets : (q, k) int array
        source : (q,) int array
            Given facet of which each is a part.
        weights : (q, k, k) float array
            Barycentric coordinates of its corners (second axis) in that facet.
        """
        if facets.shape[1] == 2 or len(self._lines) == 0 or len(facets) == 0:
            corners = facets.shape[1]
            eye = np.broadcast_to(np.eye(corners), (len(facets), corners, corners))
            return facets, np.arange(len(facets)), eye
        table, known, count = self._lines.open_for(0)
        self._lines.close(count)
        record = (
            self._points.nodes,
            self._nodes,
            self._points.positions.rows,
            self._points.supports,
            table,
            known,
            self._first.rows,
            self._entries.rows,
            self._directions.rows,
        )
        hanging = _hanging(facets, *record)
        rows, whole = np.flatnonzero(hanging), np.flatnonzero(~hanging)
        if len(rows) == 0:
            return facets, whole, np.broadcast_to(np.eye(3), (len(facets), 3, 3))
        parts, part_of, corners = _bisect(facets[rows], *record)
        source = np.concatenate([whole, rows[part_of]])
        order = np.argsort(source, kind="stable")
        weights = np.concatenate([np.broadcast_to(np.eye(3), (len(whole), 3, 3)), corners])
        return np.concatenate([facets[whole], parts])[order], source[order], weights[order]


@njit(cache=True)
def _record(zero, supports, table, known, lines, first, entries, used):
    """Enter points into the lists of their lines; the counts of lines and entries."""
    row = np.empty(_WIDTH, dtype=np.int64)
    for z in zero:
        if supports[z, _FACE] != _NONE:
            continue  # inside an element: nobody else meets it
        row[:_FACE] = supports[z, :_FACE]
        for k in range(_NODES, _NODES + _CUTS):
            if supports[z, k] == _NONE:
                continue
            # on an edge of the mesh the cut does not matter
            row[_FACE] = supports[z, k] if row[_FACE - 1] != _NONE else _NONE
            line, lines = number_of_row(row, table, known, lines)
            entries[used, 0], entries[used, 1] = z, first[line]
            first[line] = used
            used += 1
            if row[_FACE] == _NONE:
                break
    return lines, used


@njit(cache=True)
def _place(number, nodes, node_points, positions, out):
    for i in range(len(out)):
        out[i] = node_points[number, i] if number < nodes else positions[number - nodes, i]


@njit(cache=True)
def _join(number, nodes, supports, row):
    """Insert the mesh nodes of a point into the ascending row[:3]; False if there is no room."""
    for k in range(_NODES):
        value = number if number < nodes else supports[number - nodes, k]
        if value == _NONE:
            break
        for j in range(_FACE):
            if row[j] == value:
                value = _NONE
                break
            if row[j] > value:
                value, row[j] = row[j], value
        if value != _NONE:
            return False
        if number < nodes:
            break
    return True


@njit(cache=True)
def _after(at, number, than, other):
    """Whether a point comes after another on a line; equal places are ordered by number."""
    return at > than or (at == than and number > other)


@njit(cache=True)
def _between(x, y, nodes, node_points, positions, first, entries, directions, line, straight):
    """Give (a point of the line's list strictly between x and y or -1, its share from x to y).

    The order on a line is that of projections on one direction, taken when the line is first
    asked for: points that nearly coincide are in the same order for every facet.
    """
    space = node_points.shape[1]
    a, b, c = np.empty(space), np.empty(space), np.empty(space)
    _place(x, nodes, node_points, positions, a)
    _place(y, nodes, node_points, positions, b)
    direction, unset = directions[line], True
    for i in range(space):
        unset = unset and direction[i] == 0.0
    if unset and straight:
        for i in range(space):
            direction[i] = b[i] - a[i]
    total, length, aligned, start, end = 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(space):
        total += (b[i] - a[i]) ** 2
        length += direction[i] ** 2
        aligned += (b[i] - a[i]) * direction[i]
        start += a[i] * direction[i]
        end += b[i] * direction[i]
    if not straight and (unset or aligned**2 < _ALIGNED * length * total):
        return -1, 0.0
    forward = _after(end, y, start, x)
    entry = first[line]
    while entry >= 0:
        z = nodes + entries[entry, 0]
        entry = entries[entry, 1]
        if z in (x, y):
            continue
        _place(z, nodes, node_points, positions, c)
        at, along = 0.0, 0.0
        for i in range(space):
            at += c[i] * direction[i]
            along += (c[i] - a[i]) * (b[i] - a[i])
        if _after(at, z, start, x) != forward or _after(end, y, at, z) != forward:
            continue
        return z, min(max(along / total, 0.0), 1.0) if total > 0.0 else 0.5
    return -1, 0.0


@njit(cache=True)
def _inner_point(
    x, y, nodes, node_points, positions, supports, table, known, first, entries, directions
):
    """Give (a recorded point strictly between x and y or -1, its share from x to y)."""
    row = np.full(_WIDTH, _NONE, dtype=np.int64)
    if not (_join(x, nodes, supports, row) and _join(y, nodes, supports, row)):
        return -1, 0.0
    straight = row[_FACE - 1] == _NONE
    if straight:
        line = find_row(row, table, known)
        if line < 0:
            return -1, 0.0
        return _between(
            x, y, nodes, node_points, positions, first, entries, directions, line, straight
        )
    for number, other in ((x, y), (y, x)):
        if number < nodes:
            continue
        for k in range(_NODES, _NODES + _CUTS):
            row[_FACE] = supports[number - nodes, k]
            line = find_row(row, table, known) if row[_FACE] != _NONE else -1
            if line < 0:
                continue
            straight = False
            for j in range(_NODES, _NODES + _CUTS):
                if other >= nodes and supports[other - nodes, j] == row[_FACE]:
                    straight = True
            # a mesh node may lie on the line of a cut without being told so
            if not straight and other >= nodes:
                continue
            z, share = _between(
                x, y, nodes, node_points, positions, first, entries, directions, line, straight
            )
            if z >= 0:
                return z, share
    return -1, 0.0


@njit(cache=True)
def _hanging(
    facets, nodes, node_points, positions, supports, table, known, first, entries, directions
):
    """Whether each triangle has a recorded point on one of its edges."""
    found = np.zeros(len(facets), dtype=np.bool_)
    for t in range(len(facets)):
        for k in range(3):
            if not found[t]:
                at, _ = _inner_point(
                    facets[t, k], facets[t, (k + 1) % 3], nodes, node_points, positions, supports,
                    table, known, first, entries, directions,
                )  # fmt: skip
                found[t] = at >= 0
    return found


@njit(cache=True)
def _bisect(
    facets, nodes, node_points, positions, supports, table, known, first, entries, directions
):
    stack_ids = [facets[0].copy() for _ in range(0)]
    stack_weights = [np.eye(3) for _ in range(0)]
    ids, sources, weights = (
        [facets[0].copy() for _ in range(0)],
        [np.int64(0) for _ in range(0)],
        [np.eye(3) for _ in range(0)],
    )
    for t in range(len(facets)):
        stack_ids.append(facets[t].copy())
        stack_weights.append(np.eye(3))
        while len(stack_ids) > 0:
            facet, corner = stack_ids.pop(), stack_weights.pop()
            at, share, k = -1, 0.0, 0
            for j in range(3):
                at, share = _inner_point(
                    facet[j], facet[(j + 1) % 3], nodes, node_points, positions, supports,
                    table, known, first, entries, directions,
                )  # fmt: skip
                if at >= 0:
                    k = j
                    break
            if at < 0:
                ids.append(facet)
                sources.append(np.int64(t))
                weights.append(corner)
                continue
            middle = (1.0 - share) * corner[k] + share * corner[(k + 1) % 3]
            for end in (k, (k + 1) % 3):
                half, half_corner = facet.copy(), corner.copy()
                half[end] = at
                half_corner[end] = middle
                if half[0] == half[1] or half[1] == half[2] or half[2] == half[0]:
                    continue  # all three on one line: nothing is left of it
                stack_ids.append(half)
                stack_weights.append(half_corner)
    count = len(ids)
    out_ids, out_source = np.empty((count, 3), dtype=np.int64), np.empty(count, dtype=np.int64)
    out_weights = np.empty((count, 3, 3))
    for q in range(count):
        out_ids[q], out_source[q], out_weights[q] = ids[q], sources[q], weights[q]
    return out_ids, out_source, out_weights
