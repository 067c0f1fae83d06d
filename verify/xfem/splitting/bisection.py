"""Bisection of simplices at points that lie on their edges but that they do not have.

Where a cut ends, the cells that it divides have points on faces and edges that their undivided
neighbours do not know of. Bisected at these, the neighbours match again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.xfem.splitting.bisection_kernels import bisect_along
from verify.xfem.splitting.zero_points import ZeroPoints

__all__ = ["Simplices", "bisect_at"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Simplices:
    """Simplices inside cells.

    Attributes
    ----------
    source : (q,) int array
        Anything that the parts of a simplex shall inherit.
    points : (q, c) int array
        Numbers of the vertices.
    barycentric : (q, c, c) float array
    fraction : (q,) float array
        Share in the volume of the cell.
    """

    source: _Ints
    points: _Ints
    barycentric: _Floats
    fraction: _Floats

    def take(self, rows: NDArray | slice) -> "Simplices":
        """Return some of them."""
        return Simplices(
            self.source[rows], self.points[rows], self.barycentric[rows], self.fraction[rows]
        )

    def joined(self, *others: "Simplices") -> "Simplices":
        """Return them and others."""
        parts = (self, *others)
        return Simplices(
            np.concatenate([x.source for x in parts]),
            np.concatenate([x.points for x in parts]),
            np.concatenate([x.barycentric for x in parts]),
            np.concatenate([x.fraction for x in parts]),
        )


def bisect_at(zero: ZeroPoints, numbers: _Ints, simplices: Simplices) -> Simplices:
    """Bisect at every one of the given points that lies on an edge.

    Parameters
    ----------
    zero : ZeroPoints
    numbers : (k,) int array
        Places of the points in `zero.ends`.
    simplices : Simplices
    """
    order = zero.in_order(numbers)
    ends = zero.ends[order]
    above, below = (zero.values[ends[:, k], zero.cut[order]] for k in range(2))
    share = above / (above - below), -below / (above - below)
    near = np.zeros(len(zero.positions), dtype=bool)
    near[ends] = True
    rows = np.flatnonzero(near[simplices.points].sum(axis=1) >= 2)
    if len(rows) == 0:
        return simplices
    room = 4 * len(rows)
    while True:
        open_ = simplices.take(np.resize(rows, room))
        first = np.full(len(zero.positions), -1)
        count = bisect_along(
            len(rows), zero.nodes + order, ends, *share, open_.points, open_.barycentric,
            open_.fraction, open_.source, first,
        )  # fmt: skip
        if count >= 0:
            break
        room *= 2
    rest = np.ones(len(simplices.points), dtype=bool)
    rest[rows] = False
    return simplices.take(rest).joined(open_.take(slice(0, count)))
