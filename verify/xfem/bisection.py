"""Bisection of simplices at points that lie on their edges but that they do not have.

Where a cut ends, the cells that it divides have points on faces and edges that their undivided
neighbours do not know of. Bisected at these, the neighbours match again.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.xfem.zero_points import ZeroPoints

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

    def take(self, rows: NDArray) -> "Simplices":
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
    nodes = len(zero.positions) - len(zero.ends)
    ends = np.zeros(len(zero.positions), dtype=bool)
    ends[zero.ends[numbers]] = True
    near = ends[simplices.points].sum(axis=1) >= 2
    rest, open_ = simplices.take(~near), simplices.take(near)
    edges = _edge_keys(open_.points)
    for point in zero.in_order(numbers):
        plus, minus = zero.ends[point]
        if (min(plus, minus) << 32 | max(plus, minus)) not in edges:
            continue
        has = (open_.points == plus).any(axis=1) & (open_.points == minus).any(axis=1)
        whole = open_.take(has)
        r, s = zero.shares(int(zero.cut[point]), np.array([plus]), np.array([minus]))
        row = np.arange(len(whole.points))
        at = whole.barycentric[row, (whole.points == plus).argmax(axis=1)]
        to = whole.barycentric[row, (whole.points == minus).argmax(axis=1)]
        halves = []
        for end, share in ((plus, s), (minus, r)):
            points, corners = whole.points.copy(), whole.barycentric.copy()
            local = (points == end).argmax(axis=1)
            points[row, local] = nodes + point
            corners[row, local] = s * at + r * to
            halves.append(Simplices(whole.source, points, corners, whole.fraction * share))
            edges |= _edge_keys(points)
        open_ = open_.take(~has).joined(*halves)
    return rest.joined(open_)


def _edge_keys(points: _Ints) -> set[int]:
    """Each edge of the simplices (q, c) as one number."""
    first, second = np.triu_indices(points.shape[1], 1)
    low = np.minimum(points[:, first], points[:, second])
    high = np.maximum(points[:, first], points[:, second])
    return set(np.unique(low << 32 | high).tolist())
