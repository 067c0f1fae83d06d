"""A walk through a mesh to the cell that holds a point, in numpy for all points at once.

Points follow each other closely: some begin in the cell with the nearest centre, the others where
the one before them has ended. Each goes on across the facet that it is farthest behind (Devillers,
Pion and Teillaud, Walking in a triangulation, 2002). A walk that ends at the surface of the body
has found nothing.
"""

from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.geometry.simplices import cell_facets

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_APART, _MOST_STEPS = 8, 40  # every so many points begin on their own
# Nodes are told apart by one number: in no direction of a structured mesh are two equal
_SKEWED = np.array([1.0, 2**0.5, 3**0.5])


class Walk:
    """Walk through simplices.

    Parameters
    ----------
    corners, normals : (m, d + 1, d) arrays
        Of each cell; unit normals of the facets opposite to the corners, inwards.
    """

    def __init__(self, corners: Floats, normals: Floats) -> None:
        self._normals = np.ascontiguousarray(np.moveaxis(normals, 0, -1))
        ends = np.roll(corners, -1, axis=1)
        self._offsets = np.ascontiguousarray(np.einsum("mka,mka->km", normals, ends))
        self._corners = corners

    @cached_property
    def _beside(self) -> Ints:
        return _neighbours(self._corners)

    def _depths(self, columns: Floats, cells: Ints) -> Iterator[Floats]:
        """Yield distances (n,) to each facet plane, m, positive inside."""
        for normal, offset in zip(self._normals, self._offsets, strict=True):
            along = -offset[cells]
            for own, x in zip(normal, columns, strict=True):
                along += own[cells] * x
            yield along

    def depth(self, columns: Floats, cells: Ints) -> tuple[Floats, Ints]:
        """Compute distances (n,) to the nearest facet planes of cells, m, and which facets (n,).

        Points are the columns (d, n), in cells (n,); the distance is positive inside.
        """
        depth, nearest = np.full(len(cells), np.inf), np.zeros(len(cells), dtype=np.int64)
        for k, along in enumerate(self._depths(columns, cells)):
            nearest[along < depth] = k
            np.minimum(depth, along, out=depth)
        return depth, nearest

    def to(
        self,
        points: Floats,
        begin: Ints,
        fits: Callable[[Ints, Ints], NDArray[np.bool_]],
        tolerance: float,
    ) -> tuple[Ints, Ints]:
        """Find the cells (n,) that hold points (n, d) more than a `tolerance` deep, or −1.

        A walk begins in one of the cells `begin`. ``fits(points, cells)`` tells by their numbers
        in which cells it may end. Also returned are the cells (n,) where points on a facet have
        ended, or −1.
        """
        found, columns = np.full(len(points), -1), np.ascontiguousarray(points.T)
        on_facet = found.copy()
        centres = self._corners[begin].mean(axis=1)
        tree = cKDTree(centres, balanced_tree=False, compact_nodes=False)
        first = begin[tree.query(points[::_APART])[1]]
        for rows in (np.arange(0, len(points), _APART), np.arange(len(points))):
            before = found[rows // _APART * _APART]
            cells = np.where(before < 0, first[rows // _APART], before)
            for _ in range(_MOST_STEPS):
                depth, nearest = self.depth(columns[:, rows], cells)
                there = (depth > tolerance) & fits(rows, cells)
                found[rows[there]] = cells[there]
                beside = np.abs(depth) <= tolerance
                on_facet[rows[beside]] = cells[beside]
                cells, on = self._beside[cells, nearest], depth < -tolerance
                on &= cells >= 0
                rows, cells = rows[on], cells[on]
                if not len(rows):
                    break
        return found, on_facet

    def across(self, points: Floats, cells: Ints, tolerance: float) -> Ints:
        """Find the cells (n,) across the facets that points (n, d) of `cells` (n,) lie on.

        −1 where others than these two may hold the point within the `tolerance`: at an edge, and
        where nothing lies across.
        """
        columns = np.ascontiguousarray(points.T)
        other = self._beside[cells, self.depth(columns, cells)[1]]
        alone = other >= 0
        for one in (cells, other):
            alone &= sum(~(along > tolerance) for along in self._depths(columns, one)) == 1
        return np.where(alone, other, -1)


def _neighbours(corners: Floats) -> Ints:
    """Find the cell (m, k) across the facet opposite to each corner of cells (m, k, d), or −1.

    By place, so that both faces of a cut are one.
    """
    m, k, d = corners.shape
    _, node = np.unique((corners @ _SKEWED[:d]).ravel(), return_inverse=True)
    facets = cell_facets(node.reshape(m, k))
    key = facets[:, 0]
    for column in facets.T[1:]:
        key = key * (int(node.max()) + 1) + column
    order = np.argsort(key, kind="stable")
    (same,) = np.nonzero(np.diff(key[order]) == 0)
    one, other = order[same], order[same + 1]
    found = np.full(m * k, -1)
    found[one], found[other] = other // k, one // k
    return found.reshape(m, k)
