"""The finite element space of a conforming mesh: nodes, cells and boundary as arrays."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.dolfinx_versions import create_triangle_mesh
from reference.meshing import ConformingMesh

__all__ = ["ConformingSpace", "conforming_space"]

# basix numbers the mid-nodes by the opposite corner, VTK along the outline
_TO_VTK = {1: [0, 1, 2], 2: [0, 1, 2, 5, 3, 4]}


@dataclass(frozen=True)
class ConformingSpace:
    """Vector Lagrange elements on a conforming mesh.

    Attributes
    ----------
    mesh : ConformingMesh
    degree : int
    function_space : dolfinx.fem.FunctionSpace
    cell_nodes : (m, k) int array
        Nodes of each cell of `mesh` in VTK's order.
    node_points : (n, 2) float array
        Nodes of the space, m.
    dolfinx_cell : (m,) int array
        DOLFINx's number of each cell of `mesh`.
    """

    mesh: ConformingMesh
    degree: int
    function_space: Any
    cell_nodes: NDArray[np.int64]
    node_points: NDArray[np.float64]
    dolfinx_cell: NDArray[np.int64]

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """(m, 2) centroids of the cells, m."""
        points: NDArray[np.float64] = self.mesh.points[self.mesh.cells].mean(axis=1)
        return points

    def boundary_nodes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Nodes (b,) on the outer boundary (not on the faces of the cut), and a cell of each."""
        cell, opposite = self.mesh.boundary.T
        on_facet = {
            1: np.array([[1, 2], [2, 0], [0, 1]]),
            2: np.array([[1, 2, 4], [2, 0, 5], [0, 1, 3]]),
        }[self.degree][opposite]
        nodes = np.take_along_axis(self.cell_nodes[cell], on_facet, axis=1)
        found, first = np.unique(nodes, return_index=True)
        return found, np.repeat(cell, nodes.shape[1])[first]


def conforming_space(mesh: ConformingMesh, degree: int) -> ConformingSpace:
    """Build the vector space of polynomials of `degree` (1 or 2) on `mesh`."""
    domain = create_triangle_mesh(mesh.points, mesh.cells)
    from dolfinx import fem

    space = fem.functionspace(domain, ("Lagrange", degree, (2,)))
    original = np.asarray(domain.topology.original_cell_index, dtype=np.int64)
    dolfinx_cell = np.empty(len(original), dtype=np.int64)
    dolfinx_cell[original] = np.arange(len(original))
    dofs = np.asarray(space.dofmap.list, dtype=np.int64)[dolfinx_cell]
    points = space.tabulate_dof_coordinates()[:, :2]
    return ConformingSpace(
        mesh, degree, space, dofs[:, _TO_VTK[degree]], np.ascontiguousarray(points), dolfinx_cell
    )
