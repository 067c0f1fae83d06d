"""The finite element space of a conforming mesh: nodes, cells and boundary as arrays."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.dolfinx_versions import create_simplex_mesh
from reference.meshing import ConformingMesh
from reference.meshing.edge_splitting import mesh_edges
from reference.meshing.opening import measures
from reference.unknowns import Unknowns

# basix numbers the mid-nodes by the opposite edge, VTK along the outline
_TO_VTK = {
    (2, 1): [0, 1, 2],
    (2, 2): [0, 1, 2, 5, 3, 4],
    (3, 1): [0, 1, 2, 3],
    (3, 2): [0, 1, 2, 3, 9, 6, 8, 7, 5, 4],
}
_VTK_EDGES = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]  # the first three in the plane


@dataclass(eq=False)
class ConformingSpace(Unknowns):
    """Vector Lagrange elements on a conforming mesh.

    Every rank of a parallel run knows the whole mesh and all its nodes; DOLFINx holds a part.

    Attributes
    ----------
    mesh : ConformingMesh
    degree : int
    cell_nodes : (m, k) int array
        Nodes of each cell of `mesh` in VTK's order.
    node_points : (n, d) float array
        Nodes of the space, m.
    dolfinx_cell : (m,) int array
        DOLFINx's number of each cell of `mesh` on this rank; −1 where it has none.
    node_of_dof : (l,) int array
        Node of each (vector) unknown of this rank, those of other ranks last. Serial: 0, 1, 2, …
    """

    mesh: ConformingMesh
    degree: int
    cell_nodes: NDArray[np.int64]
    node_points: NDArray[np.float64]
    dolfinx_cell: NDArray[np.int64]
    node_of_dof: NDArray[np.int64]

    @property
    def dimension(self) -> int:
        """Space dimension, 2 or 3."""
        return self.mesh.dimension

    @cached_property
    def measures(self) -> NDArray[np.float64]:
        """(m,) areas or volumes of the cells, m² or m³."""
        return measures(self.mesh.points[self.mesh.cells])

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """(m, d) centroids of the cells, m."""
        points: NDArray[np.float64] = self.mesh.points[self.mesh.cells].mean(axis=1)
        return points

    def facet_nodes(
        self, cell: NDArray[np.int64], opposite: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Nodes (f, q) of facets, each of a cell (f,) and opposite one of its corners (f,)."""
        on_facet = _facet_nodes(self.mesh.cell_dimension, self.degree)[opposite]
        return np.take_along_axis(self.cell_nodes[cell], on_facet, axis=1)

    def edges_of_facet(self, opposite: int) -> list[tuple[int, int]]:
        """Edges with a node in their middle of the facet opposite a corner, in order of nodes.

        By the numbers of their ends among the corners of the facet; none of linear elements.
        """
        if self.degree == 1:
            return []
        edges = _VTK_EDGES[: 3 * (self.mesh.cell_dimension - 1)]
        number = [corner - (corner > opposite) for corner in range(4)]
        return [(number[i], number[j]) for i, j in edges if opposite not in (i, j)]

    def broken_facet_dofs(
        self, broken: Any, cell: NDArray[np.int64], opposite: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Unknowns (f, q) of a discontinuous space of this degree at the nodes of facets.

        They are in the order of `facet_nodes`; the cells must be this rank's.
        """
        dofs = np.asarray(broken.dofmap.list, dtype=np.int64)[self.dolfinx_cell[cell]]
        dofs = dofs[:, _TO_VTK[self.mesh.cell_dimension, self.degree]]
        on_facet = _facet_nodes(self.mesh.cell_dimension, self.degree)[opposite]
        return np.take_along_axis(dofs, on_facet, axis=1)

    def outward_normals(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Outward unit normals (f, d) of facets of the boundary, by their rows (f,) there."""
        cell, opposite = self.mesh.boundary[rows].T
        corners = self.boundary_facets[1][rows]
        inward = self.mesh.points[self.mesh.cells[cell, opposite]] - corners[:, 0]
        along = np.linalg.qr(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))[0]
        inward -= np.einsum("fik,fjk,fj->fi", along, along, inward)
        normals: NDArray[np.float64] = -inward / np.linalg.norm(inward, axis=1)[:, None]
        return normals

    def boundary_nodes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Nodes (b,) on the outer boundary (not on the faces of the cut), and a cell of each."""
        cell, opposite = self.mesh.boundary.T
        nodes = self.facet_nodes(cell, opposite)
        found, first = np.unique(nodes, return_index=True)
        return found, np.repeat(cell, nodes.shape[1])[first]

    @cached_property
    def piece_of_node(self) -> NDArray[np.int64]:
        """(n,) number of the connected piece of material that each node belongs to."""
        owner = np.zeros(len(self.node_points), dtype=np.int64)
        owner[self.cell_nodes] = self.mesh.pieces[:, None]
        return owner

    def beside_nodes(self) -> NDArray[np.float64]:
        """Centroid (n, d) of a cell of each node, m: on which side of a cut the node is."""
        beside = np.empty_like(self.node_points)
        beside[self.cell_nodes] = self.centroids[:, None]
        return beside

    @cached_property
    def boundary_facets(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Nodes (b, q) of all facets of the outer boundary, and their corners (b, k, d), m."""
        nodes = self.facet_nodes(*self.mesh.boundary.T)
        return nodes, self.node_points[nodes[:, : self.mesh.cell_dimension]]

    @property
    def owned(self) -> int:
        """Number of (vector) unknowns that this rank owns."""
        return int(self.function_space.dofmap.index_map.size_local)


def conforming_space(mesh: ConformingMesh, degree: int, comm: Any = None) -> ConformingSpace:
    """Build the vector space of polynomials of `degree` (1 or 2) on `mesh`.

    Parameters
    ----------
    mesh : ConformingMesh
        The same on every rank, with its cut open: the nodes are doubled before the mesh is
        distributed.
    degree : {1, 2}
    comm : MPI communicator, optional
        Default: each rank by itself.

    Raises
    ------
    RuntimeError
        If DOLFINx did not make one unknown per node, as an open cut has them.
    """
    domain = create_simplex_mesh(mesh.points, mesh.cells, comm)
    from dolfinx import fem

    d, k = mesh.dimension, mesh.cell_dimension
    space = fem.functionspace(domain, ("Lagrange", degree, (d,)))
    cell_nodes, node_points = _nodes(mesh, degree)
    original = np.asarray(domain.topology.original_cell_index, dtype=np.int64)
    dolfinx_cell = np.full(len(mesh.cells), -1, dtype=np.int64)
    dolfinx_cell[original] = np.arange(len(original))
    dofs = np.asarray(space.dofmap.list, dtype=np.int64)[:, _TO_VTK[k, degree]]
    index_map = space.dofmap.index_map
    node_of_dof = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int64)
    node_of_dof[dofs] = cell_nodes[original]
    alike = (node_of_dof[dofs] == cell_nodes[original]).all() and (node_of_dof >= 0).all()
    if not alike or index_map.size_global != len(node_points):
        raise RuntimeError(
            f"DOLFINx made {index_map.size_global} unknowns for {len(node_points)} nodes of the "
            "opened mesh: it does not keep the faces of the cut apart"
        )
    if domain.comm.size == 1:  # number the nodes as DOLFINx does its unknowns
        number = np.argsort(node_of_dof)
        cell_nodes, node_points = number[cell_nodes], node_points[node_of_dof]
        node_of_dof = np.arange(len(node_points))
    nodal = node_of_dof[: index_map.size_local, None] * d + np.arange(d)
    return ConformingSpace(
        space, node_points.shape, nodal.ravel(), mesh, degree, cell_nodes, node_points,
        dolfinx_cell, node_of_dof,
    )  # fmt: skip


def mixed_unknowns(space: ConformingSpace) -> Unknowns:
    """Add a pressure to quadratic displacements: continuous, linear (Taylor–Hood).

    Both jump across the cut, whose nodes are doubled. On every rank its pressures are own unknowns
    that are no nodal displacements.
    """
    import basix.ufl
    from dolfinx import fem

    V, d = space.function_space, space.dimension
    cell = "triangle" if d == 2 else "tetrahedron"
    pair = [
        basix.ufl.element("Lagrange", cell, 2, shape=(d,)),
        basix.ufl.element("Lagrange", cell, 1),
    ]
    both = fem.functionspace(V.mesh, basix.ufl.mixed_element(pair))
    index_map = both.dofmap.index_map
    nodal = np.full(index_map.size_local + index_map.num_ghosts, -1, dtype=np.int64)
    nodes = space.node_of_dof[np.asarray(V.dofmap.list, dtype=np.int64)]
    for k in range(d):
        nodal[both.sub(0).sub(k).dofmap.list] = nodes * d + k
    return Unknowns(both, space.shape, nodal[: index_map.size_local])


def _nodes(mesh: ConformingMesh, degree: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Nodes of each cell in VTK's order, and their places: corners, then middles of edges."""
    cells, points = mesh.cells, mesh.points
    if degree == 1:
        return cells, points
    edges = mesh_edges(cells)
    keys, count = edges[:, 0] * len(points) + edges[:, 1], len(points)
    columns = [cells]
    for i, j in _VTK_EDGES[: 3 * (mesh.cell_dimension - 1)]:
        low, high = np.minimum(cells[:, i], cells[:, j]), np.maximum(cells[:, i], cells[:, j])
        columns.append(count + np.searchsorted(keys, low * count + high)[:, None])
    return np.hstack(columns), np.vstack([points, points[edges].mean(axis=1)])


def _facet_nodes(dimension: int, degree: int) -> NDArray[np.int64]:
    """Nodes of the facet opposite each corner of a cell, by their place in VTK's order."""
    facets = []
    for k in range(dimension + 1):
        nodes = [corner for corner in range(dimension + 1) if corner != k]
        if degree == 2:
            edges = enumerate(_VTK_EDGES[: 3 * (dimension - 1)])
            nodes += [dimension + 1 + e for e, ends in edges if k not in ends]
        facets.append(nodes)
    return np.array(facets)
