"""A few cells of a mesh as a mesh of its own, so that work on them costs what they are."""

import numpy as np
from numpy.typing import NDArray

from verify.simulator.arrays.distinct import distinct, of_lists
from verify.xfem.mesh import SimplexMesh

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

    def nodes_of(self, cells: _Ints) -> _Ints:
        """Nodes of some cells, ascending."""
        return distinct(self.mesh.cells[cells])

    def cells_around(self, nodes: _Ints) -> _Ints:
        """Cells that have one of the nodes, ascending."""
        return distinct(of_lists(self._starts, self._around, nodes))

    def patch(self, cells: _Ints) -> MeshPatch:
        """Make the patch of these cells, given ascending."""
        mesh, nodes = self.mesh, self.nodes_of(cells)
        local, others = np.searchsorted(nodes, mesh.cells[cells]), mesh.neighbours[cells]
        place = np.minimum(np.searchsorted(cells, others), len(cells) - 1)
        across = np.where(cells[place] == others, place, -1)
        return MeshPatch(mesh.points, mesh.extent, cells, nodes, local, across)
