"""A few cells of a mesh as a mesh of its own, so that work on them costs what they are."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.simulator.arrays.distinct import distinct_in_lists, distinct_in_rows
from verify.xfem.mesh import SimplexMesh

__all__ = ["MeshPatch", "PatchCutter"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


class MeshPatch(SimplexMesh):
    """Some cells of a mesh, with nodes and cells numbered in the order of the whole.

    Attributes
    ----------
    whole_cells, whole_nodes : int array
        Their numbers in the whole mesh, ascending.
    """

    whole_cells: _Ints
    whole_nodes: _Ints

    def __init__(
        self,
        points: _Floats,
        extent: float,
        cells: _Ints,
        nodes: _Ints,
        local: _Ints,
        across: _Ints,
    ) -> None:
        # the whole mesh has been checked; its scale of round-off holds here too
        for name, value in (
            ("points", points[nodes]),
            ("cells", local),
            ("neighbours", across),
            ("extent", extent),
            ("whole_cells", cells),
            ("whole_nodes", nodes),
        ):
            self.__dict__[name] = value


class PatchCutter:
    """Makes patches of a mesh without touching what lies outside them."""

    def __init__(self, mesh: SimplexMesh) -> None:
        self.mesh = mesh
        self._starts, self._around = mesh.node_cells
        self._node_place = np.full(len(mesh.points), -1, dtype=np.int64)
        self._cell_place = np.full(len(mesh.cells), -1, dtype=np.int64)

    def nodes_of(self, cells: _Ints) -> _Ints:
        """Nodes of some cells, ascending."""
        return np.sort(distinct_in_rows(self.mesh.cells, cells, self._node_place))

    def cells_around(self, nodes: _Ints) -> _Ints:
        """Cells that have one of the nodes, ascending."""
        return np.sort(distinct_in_lists(self._starts, self._around, nodes, self._cell_place))

    def patch(self, cells: _Ints) -> MeshPatch:
        """Make the patch of these cells, given ascending."""
        nodes = self.nodes_of(cells)
        local, across = _local(
            self.mesh.cells,
            self.mesh.neighbours,
            cells,
            nodes,
            self._cell_place,
            self._node_place,
        )
        return MeshPatch(self.mesh.points, self.mesh.extent, cells, nodes, local, across)


@njit(cache=True)
def _local(mesh_cells, neighbours, cells, nodes, cell_place, node_place):
    local = np.empty((len(cells), mesh_cells.shape[1]), dtype=np.int64)
    across = np.empty_like(local)
    for k in range(len(nodes)):
        node_place[nodes[k]] = k
    for k in range(len(cells)):
        cell_place[cells[k]] = k
    for k in range(len(cells)):
        for a in range(local.shape[1]):
            local[k, a] = node_place[mesh_cells[cells[k], a]]
            other = neighbours[cells[k], a]
            across[k, a] = cell_place[other] if other >= 0 else -1
    for node in nodes:
        node_place[node] = -1
    for cell in cells:
        cell_place[cell] = -1
    return local, across
