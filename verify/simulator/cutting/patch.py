"""A few cells of a mesh as a mesh of its own, so that work on them costs what they are."""

import numpy as np

from verify.simulator.arrays import distinct, of_lists
from verify.xfem.arrays import Floats, Ints
from verify.xfem.mesh import SimplexMesh


class MeshPatch(SimplexMesh):
    """Some cells of a mesh, with nodes and cells numbered in the order of the whole.

    Attributes
    ----------
    whole_cells, whole_nodes : int array
        Their numbers in the whole mesh, ascending.
    """

    whole_cells: Ints
    whole_nodes: Ints

    def __init__(
        self,
        points: Floats,
        extent: float,
        cells: Ints,
        nodes: Ints,
        local: Ints,
        across: Ints,
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

    def nodes_of(self, cells: Ints) -> Ints:
        """Nodes of some cells, ascending."""
        return distinct(self.mesh.cells[cells])

    def cells_around(self, nodes: Ints) -> Ints:
        """Cells that have one of the nodes, ascending."""
        return distinct(of_lists(self._starts, self._around, nodes))

    def patch(self, cells: Ints) -> MeshPatch:
        """Make the patch of these cells, given ascending."""
        mesh, nodes = self.mesh, self.nodes_of(cells)
        local, others = np.searchsorted(nodes, mesh.cells[cells]), mesh.neighbours[cells]
        place = np.minimum(np.searchsorted(cells, others), len(cells) - 1)
        across = np.where(cells[place] == others, place, -1)
        return MeshPatch(mesh.points, mesh.extent, cells, nodes, local, across)
