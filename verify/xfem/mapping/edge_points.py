"""Points on edges, and facets bisected at them: no hanging vertex is left on a surface.

Where a cut ends, a facet beside the end has a point on its edge that is not a vertex of it. All
facets along an edge ask the same record of points, so that they are bisected alike.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.cutting.growing_array import GrowingArray
from verify.xfem.cutting.point_numbers import PointNumbers
from verify.xfem.cutting.row_numbers import RowNumbers, find_row, number_of_row

__all__ = ["EdgePoints"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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
        self._edges = RowNumbers(2)
        self._first = GrowingArray(np.empty(0, dtype=np.int64))
        self._next = GrowingArray(np.empty(0, dtype=np.int64))

    def add(self, numbers: _Ints) -> None:
        """Record points (by number; mesh nodes are ignored) on the edges on which they lie."""
        count = len(self._points.ends)
        fresh = self._next.extend(count - len(self._next))
        self._next.rows[fresh:] = -2  # not recorded
        table, known, edges = self._edges.open_for(len(numbers))
        begin = self._first.extend(len(numbers))
        self._first.rows[begin:] = -1
        after = _record(
            numbers,
            self._points.nodes,
            self._points.ends.rows,
            self._points.supports,
            table,
            known,
            edges,
            self._first.rows,
            self._next.rows,
        )
        self._edges.close(after)
        self._first.rows = self._first.rows[:after]

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
        if facets.shape[1] == 2 or len(self._edges) == 0:
            corners = facets.shape[1]
            eye = np.broadcast_to(np.eye(corners), (len(facets), corners, corners))
            return facets, np.arange(len(facets)), eye
        table, known, count = self._edges.open_for(0)
        self._edges.close(count)
        return _bisect(
            facets,
            self._points.nodes,
            self._nodes,
            self._points.positions.rows,
            self._points.supports,
            table,
            known,
            self._first.rows,
            self._next.rows,
        )


@njit(cache=True)
def _record(numbers, nodes, ends, supports, table, known, edges, first, following):
    none = np.iinfo(np.int64).max
    row = np.empty(2, dtype=np.int64)
    for number in numbers:
        z = number - nodes
        if z < 0 or following[z] != -2:
            continue
        if supports[z, 2] == none:
            row[0], row[1] = supports[z, 0], supports[z, 1]
        else:
            row[0], row[1] = min(ends[z, 0], ends[z, 1]), max(ends[z, 0], ends[z, 1])
        edge, edges = number_of_row(row, table, known, edges)
        following[z] = first[edge]
        first[edge] = z
    return edges


@njit(cache=True)
def _place(number, nodes, node_points, positions, out):
    for i in range(len(out)):
        out[i] = node_points[number, i] if number < nodes else positions[number - nodes, i]


@njit(cache=True)
def _edge_of(x, y, nodes, supports, row):
    """Write the mesh edge that holds both points, or else the edge between them."""
    none = np.iinfo(np.int64).max
    row[0] = row[1] = none
    for number in (x, y):
        for k in range(3):
            if number < nodes:
                support = number if k == 0 else none
            else:
                support = supports[number - nodes, k]
            if support == none or support == row[0] or support == row[1]:
                continue
            if row[1] != none:
                row[0], row[1] = min(x, y), max(x, y)
                return
            row[1] = support
            if row[0] > row[1]:
                row[0], row[1] = row[1], row[0]


@njit(cache=True)
def _inner_point(x, y, nodes, node_points, positions, supports, table, known, first, following):
    """(a recorded point strictly between x and y or -1, its share from x to y)."""
    row = np.empty(2, dtype=np.int64)
    _edge_of(x, y, nodes, supports, row)
    edge = find_row(row, table, known)
    if edge < 0:
        return -1, 0.0
    space = node_points.shape[1]
    a, b, c = np.empty(space), np.empty(space), np.empty(space)
    _place(x, nodes, node_points, positions, a)
    _place(y, nodes, node_points, positions, b)
    z = first[edge]
    while z >= 0:
        if nodes + z != x and nodes + z != y:
            _place(nodes + z, nodes, node_points, positions, c)
            along, total = 0.0, 0.0
            for i in range(space):
                along += (c[i] - a[i]) * (b[i] - a[i])
                total += (b[i] - a[i]) ** 2
            if 0.0 < along < total:
                return nodes + z, along / total
        z = following[z]
    return -1, 0.0


@njit(cache=True)
def _bisect(facets, nodes, node_points, positions, supports, table, known, first, following):
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
                    table, known, first, following,
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
                stack_ids.append(half)
                stack_weights.append(half_corner)
    count = len(ids)
    out_ids, out_source = np.empty((count, 3), dtype=np.int64), np.empty(count, dtype=np.int64)
    out_weights = np.empty((count, 3, 3))
    for q in range(count):
        out_ids[q], out_source[q], out_weights[q] = ids[q], sources[q], weights[q]
    return out_ids, out_source, out_weights
