"""A tree of bounding boxes over facets or cells: build once, refit when points move."""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.collision.tree_kernels import (
    boxes_of_facets,
    items_near_plane,
    merge_boxes,
    morton_codes,
)
from verify.xfem.errors import XfemError

__all__ = ["BoundingTree"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class BoundingTree:
    """Axis-aligned boxes of simplices (segments, triangles, tetrahedra) in a heap.

    Parameters
    ----------
    points : (v, s) float array
        In metres.
    simplices : (n, k) int array
        May be empty.
    in_order : bool
        Whether neighbours in the list are near each other, so that it need not be sorted.

    Attributes
    ----------
    low, high : (2 n, s) float array
        Corners of the boxes by node of the heap; node 0 is not used.
    order : (n,) int array
        Simplex of each leaf.
    """

    def __init__(self, points: _Floats, simplices: _Ints, in_order: bool = False) -> None:
        count, space = len(simplices), points.shape[1]
        self.simplices = np.ascontiguousarray(simplices)
        self.low, self.high = np.zeros((2 * count, space)), np.zeros((2 * count, space))
        self.order = np.arange(count)
        self.refit(points)
        if count > 1 and not in_order:
            codes = morton_codes(self.low[count:], self.high[count:])
            self.order = np.argsort(codes, kind="stable")
            self.refit(points)

    def refit(self, points: _Floats) -> None:
        """Move the boxes with the points (v, s): one sweep, no allocation.

        Raises
        ------
        XfemError
            If a simplex has a vertex that is not given.
        """
        if len(self.simplices) and len(points) <= self._largest:
            raise XfemError(f"{len(points)} points; expected more than {self._largest}")
        boxes_of_facets(points, self.simplices, self.order, self.low, self.high)
        merge_boxes(self.low, self.high)

    @property
    def _largest(self) -> int:
        if not hasattr(self, "_largest_vertex"):
            self._largest_vertex = int(self.simplices.max(initial=-1))
        return self._largest_vertex

    def meeting_box(self, low: _Floats, high: _Floats) -> _Ints:
        """Simplices whose boxes meet a box, in no particular order."""
        nowhere = np.zeros(len(low))
        return items_near_plane(self.low, self.high, self.order, low, high, nowhere, nowhere, 0.0)
