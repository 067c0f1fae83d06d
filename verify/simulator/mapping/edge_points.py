"""Points on edges, and facets bisected at them: no hanging vertex is left on a surface.

Where a cut ends, a facet beside the end has a point on its edge that is not a vertex of it. All
facets along an edge ask the same record of points, so that they are bisected alike. Edges on which
elements meet lie on an edge of the mesh, or on the line in which a cut crosses a face of it: the
record is by these.
"""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.arrays.distinct import distinct
from verify.simulator.arrays.growing_array import GrowingArray
from verify.simulator.arrays.row_numbers import RowNumbers
from verify.simulator.cutting.point_numbers import CUTS, PointNumbers
from verify.simulator.mapping.edge_kernels import LINE, EdgeRecord, bisect_facets, record_points
from verify.xfem.errors import XfemError

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
        self._crossed, self._faced = (np.zeros(len(nodes), dtype=bool) for _ in range(2))
        self._edge_line = GrowingArray(np.empty(0, dtype=np.int64))
        self._lines = RowNumbers(LINE)
        self._tally = GrowingArray(np.empty(0, dtype=np.int64))
        self._first = GrowingArray(np.empty(0, dtype=np.int64))
        self._directions = GrowingArray(np.empty((0, nodes.shape[1])))
        self._entries = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self._recorded = GrowingArray(np.empty(0, dtype=bool))

    def add(self, numbers: _Ints) -> None:
        """Record points (by number; mesh nodes are ignored) on the lines on which they lie."""
        fresh = self._recorded.extend(len(self._points.ends) - len(self._recorded))
        self._recorded.rows[fresh:] = False
        self._edge_line.extend(len(self._recorded) - fresh)
        self._edge_line.rows[fresh:] = -1
        zero = distinct(numbers[numbers >= self._points.nodes] - self._points.nodes)
        zero = zero[~self._recorded.rows[zero]]
        self._recorded.rows[zero] = True
        table, known, lines = self._lines.open_for((CUTS + 1) * len(zero))
        begin = self._first.extend((CUTS + 1) * len(zero))
        self._first.rows[begin:] = -1
        self._tally.extend((CUTS + 1) * len(zero))
        self._tally.rows[begin:] = 0
        used = len(self._entries)
        self._entries.extend((CUTS + 1) * len(zero))
        lines, used = record_points(
            zero, self._points.ends.rows, self._record(table, known), lines, used
        )
        self._lines.close(lines)
        self._first.rows = self._first.rows[:lines]
        self._tally.rows = self._tally.rows[:lines]
        known_lines = self._directions.extend(lines - len(self._directions))
        self._directions.rows[known_lines:] = 0.0
        self._entries.rows = self._entries.rows[:used]

    def bisect(self, facets: _Ints, at: _Floats) -> tuple[_Ints, _Floats, _Ints]:
        """Bisect triangles at all recorded points on their edges; segments stay.

        Parameters
        ----------
        facets : (t, k) int array
            Numbers of points.
        at : (t, k, c) float array
            Coordinates of their corners, of any kind that is linear in a facet.

        Returns
        -------
        facets, at : (q, k), (q, k, c) arrays
        source : (q,) int array
            Given facet of which each is a part, ascending.
        """
        if facets.shape[1] == 2 or len(self._lines) == 0 or len(facets) == 0:
            return facets, at, np.arange(len(facets))
        record = self._record(self._lines.table, self._lines.rows)
        room = len(facets) + len(facets) // 4 + 64
        # each point bisects a few facets, those around its edge
        while room < 64 * (len(facets) + len(self._entries) + 64):
            record.turned[0] = 0
            *parts, enough = bisect_facets(facets, at, record, room)
            if enough and record.turned[0] == 0:
                return tuple(parts)
            room *= 1 if enough else 2
        raise XfemError(f"points on the edges of {len(facets)} facets are in no order")

    def _record(self, table: _Ints, known: _Ints) -> EdgeRecord:
        return EdgeRecord(
            self._nodes, self._crossed, self._faced, self._edge_line.rows,
            self._points.positions.rows, self._points.supports, table, known, self._first.rows,
            self._tally.rows, self._entries.rows, self._directions.rows,
            np.zeros(1, dtype=np.int64), self._points.met,
        )  # fmt: skip
