"""A tree of bounding boxes over the elements of a mesh at rest.

A heap: node 1 is the root, node i has the children 2i and 2i + 1. With n items the leaves are
nodes n to 2n − 1, in the order of a curve that fills space.
"""

import numpy as np
from numba import njit

from verify.xfem.arrays import Floats, Ints

_BITS = 10  # of each coordinate on the curve
_DEEP = 128  # deeper than any heap: twice its height is what a depth-first stack needs


class BoundingTree:
    """Axis-aligned boxes of simplices (segments, triangles, tetrahedra) in a heap.

    Parameters
    ----------
    points : (v, s) float array
        In metres.
    simplices : (n, k) int array

    Attributes
    ----------
    floor, ceiling : (n, s) float array
        Corners of the box of each simplex.
    """

    def __init__(self, points: Floats, simplices: Ints) -> None:
        corners, count = points[simplices], len(simplices)
        self.floor, self.ceiling = corners.min(axis=1), corners.max(axis=1)
        self._order = np.argsort(_places_on_curve(self.floor + self.ceiling), kind="stable")
        self._low, self._high = (
            np.concatenate([np.empty_like(box), box[self._order]])
            for box in (self.floor, self.ceiling)
        )
        end = count
        while end > 1:  # nodes whose children are all known
            level = np.arange((end + 1) // 2, end)
            self._low[level] = np.minimum(self._low[2 * level], self._low[2 * level + 1])
            self._high[level] = np.maximum(self._high[2 * level], self._high[2 * level + 1])
            end = int(level[0])

    def meeting(self, floor: Floats, ceiling: Floats) -> tuple[Ints, Ints]:
        """Simplices whose boxes meet those from `floor` (q, s) to `ceiling`.

        Returns the first of each box (q + 1,), and all of them one after the other.
        """
        return _meeting(self._low, self._high, self._order, floor, ceiling)


def _places_on_curve(centres: Floats) -> Ints:
    """Places (n,) on the Z-order curve of the box around all centres (n, s)."""
    low, widest = centres.min(axis=0), float(np.ptp(centres, axis=0).max())
    places = ((centres - low) * ((2**_BITS - 1) / widest if widest > 0.0 else 0.0)).astype(int)
    codes, space = np.zeros(len(centres), dtype=np.int64), centres.shape[1]
    for bit in range(_BITS):
        for i in range(space):
            codes |= ((places[:, i] >> bit) & 1) << (space * bit + i)
    return codes


@njit(cache=True)
def _meeting(low, high, order, floor, ceiling):
    """Items whose boxes meet those from `floor` (q, s) to `ceiling`: first of each, and all."""
    queries, space = floor.shape
    starts, stack = np.empty(queries + 1, dtype=np.int64), np.empty(_DEEP, dtype=np.int64)
    found, total = np.empty(64 + 8 * queries, dtype=np.int64), 0
    starts[0] = 0
    for q in range(queries):
        stack[0], top = 1, min(1, len(order))
        while top > 0:
            top -= 1
            node, apart = stack[top], False
            for i in range(space):
                apart = apart or low[node, i] > ceiling[q, i] or high[node, i] < floor[q, i]
            if apart:
                continue
            if node < len(order):
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
                continue
            if total == len(found):
                more = np.empty(2 * total, dtype=np.int64)
                for k in range(total):
                    more[k] = found[k]
                found = more
            found[total] = order[node - len(order)]
            total += 1
        starts[q + 1] = total
    return starts, found[:total]
