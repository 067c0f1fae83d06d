"""Search for the element that holds a material point, in a tree of boxes of elements.

The tree is over the elements of a mesh at rest. It is a heap: node 1 is the root, node i has the
children 2i and 2i + 1. With n items the leaves are nodes n to 2n − 1, in the order of a curve that
fills space.

A point outside the mesh belongs to the element whose smallest barycentric coordinate at it is
largest. Only elements with boxes within twice the distance of the nearest box count; on a common
face several elements tie.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from verify.compare.cell_tree import morton_order
from verify.xfem.arrays import Floats, Ints
from verify.xfem.mesh import SimplexMesh

_DEEP = 128  # deeper than any heap: twice its height is what a depth-first stack needs
_REACH = 1e-9  # of the mesh's extent: a place so near to a box is in it
_TIE = 1e-9  # barycentric coordinates: closer than that to a face is on it
_WIDER = 8.0  # how much farther is looked for a box where there is none


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
        self._order = morton_order(self.floor + self.ceiling)
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

    def meeting(self, floor: Floats, ceiling: Floats, reach: float = 0.0) -> tuple[Ints, Ints]:
        """Find simplices whose boxes meet those from `floor` (q, s) to `ceiling`.

        Returns the first of each box (q + 1,), and all of them one after the other. Boxes are
        widened by a `reach`; one that is not zero grows for each box until that meets something.
        """
        return _meeting(self._low, self._high, self._order, floor, ceiling, reach)


@njit(cache=True)
def _meeting(low, high, order, floor, ceiling, reach):
    """Items whose boxes meet those from `floor` (q, s) to `ceiling`: first of each, and all."""
    queries, space = floor.shape
    starts, stack = np.empty(queries + 1, dtype=np.int64), np.empty(_DEEP, dtype=np.int64)
    found, total = np.empty(64 + 8 * queries, dtype=np.int64), 0
    starts[0] = 0
    for q in range(queries):
        wide = reach
        stack[0], top = 1, min(1, len(order))
        while top > 0:
            top -= 1
            node, apart = stack[top], False
            for i in range(space):
                beyond = low[node, i] > ceiling[q, i] + wide or high[node, i] < floor[q, i] - wide
                apart = apart or beyond
            if not apart and node < len(order):
                stack[top], stack[top + 1] = 2 * node, 2 * node + 1
                top += 2
            elif not apart:
                if total == len(found):
                    more = np.empty(2 * total, dtype=np.int64)
                    for k in range(total):
                        more[k] = found[k]
                    found = more
                found[total] = order[node - len(order)]
                total += 1
            if top == 0 and total == starts[q] and wide > 0.0:
                stack[0], top, wide = 1, 1, _WIDER * wide
        starts[q + 1] = total
    return starts, found[:total]


class _Elements(NamedTuple):
    """Elements (m, d + 1) of a mesh, gradients of their shape functions, and their boxes (m, s)."""

    cells: Ints
    points: Floats
    gradients: Floats
    floor: Floats
    ceiling: Floats


class MaterialPlaces:
    """Elements of a mesh at places in the material frame.

    Parameters
    ----------
    mesh : SimplexMesh
    tree : BoundingTree
        Of its cells.
    """

    def __init__(self, mesh: SimplexMesh, tree: BoundingTree) -> None:
        self._mesh, self._tree = mesh, tree
        self.reach = _REACH * mesh.extent
        self._elements = _Elements(
            mesh.cells, mesh.points, np.ascontiguousarray(mesh.gradients), tree.floor, tree.ceiling
        )

    def barycentric(self, cells: Ints, places: Floats) -> Floats:
        """Compute barycentric coordinates (q, d + 1) of places (q, s), each in one cell."""
        mesh = self._mesh
        away = places - mesh.points[mesh.cells[cells, 0]]
        at = np.einsum("qai,qi->qa", mesh.gradients[cells], away)
        at[:, 0] += 1.0
        return at

    def gap(self, cells: Ints, places: Floats) -> Floats:
        """Measure by how much (q,) places are beyond the box of a cell along some axis."""
        floor, ceiling = self._tree.floor[cells], self._tree.ceiling[cells]
        found: Floats = np.maximum(floor - places, places - ceiling).max(axis=1)
        return found

    def cells_of(
        self, places: Floats, near: tuple[Ints, Ints] | None = None
    ) -> tuple[Ints, Floats]:
        """Find the cell (q,) of each place and the barycentric coordinates (q, d + 1) there.

        `near` are the cells to try, if they are known: the first of each place and one past its
        last (q, 2), and all of them.
        """
        bounds, cells = self._near(places) if near is None else near
        found, at, _ = _cells_of(places, bounds, cells, self._elements, self.reach)
        return found, at

    def holding(self, places: Floats) -> tuple[Ints, Ints]:
        """Place and cell of all pairs where the cell holds the place; on a face several do."""
        bounds, cells = self._near(places)
        _, at, least = _cells_of(places, bounds, cells, self._elements, self.reach)
        place = np.repeat(np.arange(len(places)), bounds[:, 1] - bounds[:, 0])
        holds = least >= np.minimum(at.min(axis=1), 0.0)[place] - _TIE
        return place[holds], cells[holds]

    def _near(self, places: Floats) -> tuple[Ints, Ints]:
        """Find cells to which each place may belong: bounds (q, 2) of each, and all of them."""
        starts, cells = self._tree.meeting(places, places, self.reach)
        return np.stack([starts[:-1], starts[1:]], axis=1), cells


@njit(cache=True)
def _cells_of(places, bounds, near, elements, reach):
    """Cell (q,), coordinates (q, d + 1) there, and the smallest one in each cell that is near."""
    cells, points, gradients, floor, ceiling = elements
    corners, space = cells.shape[1], places.shape[1]
    found, at = np.empty(len(places), dtype=np.int64), np.empty((len(places), corners))
    smallest, trial = np.empty(len(near)), np.empty(corners)
    for q in range(len(places)):
        nearest = np.inf
        for n in range(bounds[q, 0], bounds[q, 1]):
            gap = -np.inf
            for i in range(space):
                gap = max(gap, floor[near[n], i] - places[q, i], places[q, i] - ceiling[near[n], i])
            smallest[n] = gap
            nearest = min(nearest, gap)
        limit, best = max(reach, 2.0 * nearest), -np.inf
        for n in range(bounds[q, 0], bounds[q, 1]):
            least, cell = np.inf, near[n]
            if smallest[n] > limit:
                smallest[n] = -np.inf
                continue
            for a in range(corners):
                value = 1.0 if a == 0 else 0.0
                for i in range(space):
                    value += gradients[cell, a, i] * (places[q, i] - points[cells[cell, 0], i])
                trial[a] = value
                least = min(least, value)
            smallest[n] = least
            if least > best:
                best, found[q] = least, cell
                for a in range(corners):
                    at[q, a] = trial[a]
    return found, at, smallest
