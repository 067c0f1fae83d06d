"""In which element a material point lies.

A point outside the mesh belongs to the element whose smallest barycentric coordinate at it is
largest, of those whose boxes are at most twice as far from it as the nearest box; on a common face
several elements tie.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from verify.simulator.cutting.bounding_tree import BoundingTree
from verify.xfem.arrays import Floats, Ints
from verify.xfem.mesh import SimplexMesh

_REACH = 1e-9  # of the mesh's extent: a place so near to a box is in it
_TIE = 1e-9  # barycentric coordinates: closer than that to a face is on it
_WIDER = 8.0  # how much farther is looked for a box where there is none


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
        """Barycentric coordinates (q, d + 1) of places (q, s), each in one cell."""
        mesh = self._mesh
        away = places - mesh.points[mesh.cells[cells, 0]]
        at = np.einsum("qai,qi->qa", mesh.gradients[cells], away)
        at[:, 0] += 1.0
        return at

    def gap(self, cells: Ints, places: Floats) -> Floats:
        """How far (q,) each place is beyond the box of a cell along some axis, or negative."""
        floor, ceiling = self._tree.floor[cells], self._tree.ceiling[cells]
        found: Floats = np.maximum(floor - places, places - ceiling).max(axis=1)
        return found

    def cells_of(
        self, places: Floats, near: tuple[Ints, Ints] | None = None
    ) -> tuple[Ints, Floats]:
        """Cell (q,) of each place and the barycentric coordinates (q, d + 1) there.

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
        """Cells to which each place may belong: bounds (q, 2) of each, and all of them."""
        reach = np.full((len(places), 1), self.reach)
        while True:
            starts, cells = self._tree.meeting(places - reach, places + reach)
            nowhere = starts[1:] == starts[:-1]
            if not nowhere.any():
                return np.stack([starts[:-1], starts[1:]], axis=1), cells
            reach[nowhere] *= _WIDER


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
