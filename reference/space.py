"""The finite element space of a conforming mesh and its unknowns, shared among MPI ranks.

Matrices, and vectors within a solve, are PETSc's: each rank has the rows of its own unknowns.
Nodal arrays (n, d), or (k,) of all their components, are whole and equal on all ranks.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, eye_array, kron

from reference.installation import create_simplex_mesh
from reference.meshing import ConformingMesh
from verify.geometry.simplices import connected, measures, mesh_edges

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


@dataclass(eq=False)
class Unknowns:
    """Scalar unknowns of a function space, of which every MPI rank owns some.

    Attributes
    ----------
    function_space : dolfinx.fem.FunctionSpace
    shape : (n, d) tuple of int
        Of nodal arrays.
    nodal : (l,) int array
        The nodal displacement that each unknown of this rank is: node times d plus component; −1
        of one that is none.
    """

    function_space: Any
    shape: tuple[int, int]
    nodal: Numbers

    @property
    def first(self) -> int:
        """Global number of the first unknown of this rank."""
        count = len(self.nodal)
        return int(self.function_space.mesh.comm.scan(count)) - count

    def own_unknowns(self, displacements: NDArray[Any]) -> tuple[Numbers, Numbers]:
        """Find which of some nodal displacements (h,) are this rank's own.

        Returns
        -------
        own : (l,) array
            Numbers of the unknowns on this rank.
        at : (l,) array
            Their places in `displacements`.
        """
        place = np.full(self.shape[0] * self.shape[1] + 1, -1, dtype=np.int64)  # the last for −1
        place[displacements] = np.arange(len(displacements))
        at = place[self.nodal]
        own = np.flatnonzero(at >= 0)
        return own, at[own]

    def rows(self, displacements: NDArray[Any]) -> Any:
        """Select the nodal displacements that this rank owns, in PETSc's numbering."""
        from petsc4py import PETSc

        return (self.own_unknowns(displacements)[0] + self.first).astype(PETSc.IntType)

    def indices(self, own: Numbers) -> Any:
        """Give some unknowns of this rank as PETSc's index set."""
        from petsc4py import PETSc

        found: Any = PETSc.IS()
        numbers = (own + self.first).astype(PETSc.IntType)
        return found.createGeneral(numbers, comm=self.function_space.mesh.comm)

    @property
    def pressures(self) -> Numbers:
        """Unknowns of this rank that are no displacements."""
        return np.flatnonzero(self.nodal < 0)

    def own_part(self, values: Array) -> Array:
        """Give the unknowns that this rank owns of a nodal array, with pressures of zero."""
        return np.append(values, 0.0)[self.nodal]

    def distributed(self, matrix: csr_array) -> Any:
        """Make a PETSc Mat of a matrix (k, k) of nodal displacements, which every rank has."""
        from petsc4py import PETSc

        place = coo_array(matrix[self.nodal.clip(0)])
        held = self.nodal[place.row] >= 0
        number = self.everywhere(self.first + np.arange(len(self.nodal), dtype=float))
        at = place.row[held], number.ravel()[place.col[held]].astype(int)
        total = self.function_space.mesh.comm.allreduce(len(self.nodal))
        rows = coo_array((place.data[held], at), shape=(len(self.nodal), total)).tocsr()
        size: Any = ((len(self.nodal), None), (len(self.nodal), None))
        numbers = (one.astype(PETSc.IntType) for one in (rows.indptr, rows.indices))
        csr: Any = (*numbers, rows.data)
        return PETSc.Mat().createAIJ(size, csr=csr, comm=self.function_space.mesh.comm)

    def everywhere(self, local: Array) -> Array:
        """Gather nodal displacements (n, d) on all ranks from the unknowns of each."""
        values = np.zeros(self.shape[0] * self.shape[1] + 1)
        values[self.nodal] = local[: len(self.nodal)]
        values = values[:-1].reshape(self.shape)
        comm = self.function_space.mesh.comm
        if comm.size > 1:
            from mpi4py import MPI

            comm.Allreduce(MPI.IN_PLACE, values)  # a sum with zeros: exact, the same everywhere
        return values


class TiedUnknowns(Unknowns):
    """Unknowns of a system of which some displacements are tied to others: one per group of nodes.

    Until a facet of a cut opens, its nodes on one side are tied to those on the other. Around each
    node the nodes that are left are then those that `open_cut` would make of the facets that are
    open. Matrices and forces are assembled once, on the mesh with the whole cut open, and nothing
    of the state changes when a tie goes: neither strain nor kinetic energy, nor momenta.

    Parameters
    ----------
    whole : Unknowns
        Without ties.

    Attributes
    ----------
    leader : (n,) int array
        The node that leads the group of each node.
    followers : (f,) int array
        Nodes that another one leads.
    """

    def __init__(self, whole: Unknowns) -> None:
        super().__init__(whole.function_space, whole.shape, whole.nodal)
        self._whole = whole
        self._expansion: Any = None
        self.tie(np.zeros((0, 2), dtype=np.int64))

    def tie(self, pairs: Numbers) -> None:
        """Tie the nodes of pairs (p, 2), and no others."""
        (count, d), whole = self.shape, self._whole
        group = connected(count, *pairs.T)
        self.leader = np.unique(group, return_index=True)[1][group]
        self.followers = np.flatnonzero(self.leader != np.arange(count))
        led = np.append(np.repeat(self.leader != np.arange(count), d), False)[whole.nodal]
        self.nodal = whole.nodal[~led]
        if self._expansion is not None:
            self._expansion.destroy()
            self._expansion = None
        if len(self.followers):
            self._expand(led)

    def _expand(self, led: NDArray[np.bool_]) -> None:
        """Make the matrix that gives every unknown the value of its leader."""
        from petsc4py import PETSc

        whole, rows, size = self._whole, len(led), len(self.nodal)
        column = self.first + np.cumsum(~led) - 1
        of_leader = self.spread(whole.everywhere(column.astype(float)))
        column = np.where(whole.nodal < 0, column, whole.own_part(of_leader).astype(np.int64))
        start = np.arange(rows + 1, dtype=PETSc.IntType)
        entries = (start, column.astype(PETSc.IntType), np.ones(rows))
        matrix: Any = PETSc.Mat()
        sizes = ((rows, None), (size, None))
        self._expansion = matrix.createAIJ(sizes, csr=entries, comm=self.function_space.mesh.comm)

    def projected(self, matrix: Any) -> Any:
        """Give the matrix (PETSc, of the whole space: destroyed) of the groups."""
        if self._expansion is None:
            return matrix
        found = matrix.PtAP(self._expansion)
        matrix.destroy()
        return found

    def summed(self, forces: Array) -> Array:
        """Sum forces (k,) over each group, and give them to its leader."""
        if not len(self.followers):
            return forces
        total = forces.reshape(self.shape).copy()
        np.add.at(total, self.leader[self.followers], total[self.followers])
        total[self.followers] = 0.0
        return total.ravel()

    def mean(self, values: Array) -> Array:
        """Give each group the mean of its displacements (k,)."""
        shares = np.bincount(self.leader, minlength=len(self.leader))
        mean = self.summed(values).reshape(self.shape) / np.maximum(shares, 1)[:, None]
        return self.spread(mean)

    def spread(self, values: Array) -> Array:
        """Give each node the displacement (k,) of its leader."""
        return np.asarray(values.reshape(self.shape)[self.leader].ravel())

    def all_tied_to(self, displacements: NDArray[np.int32]) -> NDArray[np.int32]:
        """Return all nodal displacements in groups of which one is among some, ascending."""
        mark = np.zeros(self.shape, dtype=bool)
        mark.ravel()[displacements] = True
        np.logical_or.at(mark, self.leader, mark.copy())
        return np.flatnonzero(mark[self.leader]).astype(np.int32)

    def own_part(self, values: Array) -> Array:
        """Give the forces of the groups of this rank, of nodal forces (n, d)."""
        return super().own_part(self.summed(values))

    def everywhere(self, local: Array) -> Array:
        """Gather nodal displacements (n, d) on all ranks from the groups of each."""
        return self.spread(super().everywhere(local)).reshape(self.shape)


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
        Node of each (vector) unknown of this rank, unknowns of other ranks last. Serial: 0, 1, 2, …
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
        """Find nodes (f, q) of facets, each of a cell (f,) and opposite one of its corners (f,)."""
        on_facet = _facet_nodes(self.mesh.cell_dimension, self.degree)[opposite]
        return np.take_along_axis(self.cell_nodes[cell], on_facet, axis=1)

    def edges_of_facet(self, opposite: int) -> list[tuple[int, int]]:
        """Find edges with a node in their middle of the facet opposite a corner, in order of nodes.

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
        """Find unknowns (f, q) of a discontinuous space of this degree at the nodes of facets.

        They are in the order of `facet_nodes`; the cells must be this rank's.
        """
        dofs = np.asarray(broken.dofmap.list, dtype=np.int64)[self.dolfinx_cell[cell]]
        dofs = dofs[:, _TO_VTK[self.mesh.cell_dimension, self.degree]]
        on_facet = _facet_nodes(self.mesh.cell_dimension, self.degree)[opposite]
        return np.take_along_axis(dofs, on_facet, axis=1)

    def outward_normals(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Compute outward unit normals (f, d) of facets of boundary, by their rows (f,) there."""
        cell, opposite = self.mesh.boundary[rows].T
        corners = self.boundary_facets[1][rows]
        inward = self.mesh.points[self.mesh.cells[cell, opposite]] - corners[:, 0]
        along = np.linalg.qr(np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2))[0]
        inward -= np.einsum("fik,fjk,fj->fi", along, along, inward)
        normals: NDArray[np.float64] = -inward / np.linalg.norm(inward, axis=1)[:, None]
        return normals

    def boundary_nodes(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find nodes (b,) on outer boundary (not on the faces of the cut), and a cell of each."""
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
        """Compute centroid (n, d) of a cell of each node, m: on which side of a cut the node is."""
        beside = np.empty_like(self.node_points)
        beside[self.cell_nodes] = self.centroids[:, None]
        return beside

    @cached_property
    def boundary_facets(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Nodes (b, q) of all facets of the outer boundary, and their corners (b, k, d), m."""
        nodes = self.facet_nodes(*self.mesh.boundary.T)
        return nodes, self.node_points[nodes[:, : self.mesh.cell_dimension]]

    @cached_property
    def edge_ends(self) -> NDArray[np.int64]:
        """(n, 2) corner nodes at the ends of the edge that each node halves; itself of a corner."""
        k = self.mesh.cell_dimension
        ends = np.repeat(np.arange(len(self.node_points))[:, None], 2, axis=1)
        for e, edge in enumerate(_VTK_EDGES[: 3 * (k - 1)] if self.degree == 2 else ()):
            ends[self.cell_nodes[:, k + 1 + e]] = self.cell_nodes[:, edge]
        return ends

    def interpolation_of_corners(self) -> tuple[csr_array, NDArray[np.int64]]:
        """Interpolate linear elements on the same mesh by the quadratic ones of this space.

        Returns
        -------
        interpolation : (own nodes × d, corners × d) csr_array
            Corners are numbered by ranks, and on each in the order of its nodes.
        corners : (c,) int array
            Nodes of this rank that are corners.
        """
        ends = self.edge_ends
        own = self.node_of_dof[: self.owned]
        every = np.concatenate(self.function_space.mesh.comm.allgather(own))
        is_corner = ends[:, 0] == ends[:, 1]
        number = np.empty(len(every), dtype=np.int64)
        number[every] = np.cumsum(is_corner[every]) - 1
        places = (np.repeat(np.arange(len(own)), 2), number[ends[own]].ravel())
        shares = coo_array((np.full(2 * len(own), 0.5), places), (len(own), is_corner.sum()))
        return kron(shares, eye_array(self.dimension), format="csr"), own[is_corner[own]]

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


class LinearElements:
    """The linear elements on the mesh of a quadratic space, and what goes between the two.

    Parameters
    ----------
    fine : ConformingSpace
        Of degree 2.

    Attributes
    ----------
    space : ConformingSpace
    """

    def __init__(self, fine: ConformingSpace) -> None:
        comm, corners = fine.function_space.mesh.comm, fine.mesh.cell_dimension + 1
        self.space = conforming_space(fine.mesh, 1, comm if comm.size > 1 else None)
        number = np.empty(len(fine.node_points), dtype=np.int64)
        number[fine.cell_nodes[:, :corners]] = self.space.cell_nodes
        self._ends = number[fine.edge_ends]

    def refined(self, u: Array) -> Array:
        """Compute displacements of quadratic space that are those (n, d) of the linear elements."""
        return np.asarray(u[self._ends].mean(axis=1))

    def forces(self, fine: Array) -> Array:
        """Restrict forces of the quadratic space to nodal forces (k,) that do the same work."""
        coarse = np.zeros(self.space.shape)
        for end in self._ends.T:
            np.add.at(coarse, end, 0.5 * fine.reshape(len(end), -1))
        return coarse.ravel()

    def held(self, fine: NDArray[np.int32]) -> tuple[NDArray[np.int32], NDArray[np.bool_]]:
        """Find the held scalar unknowns, and their places in the quadratic space."""
        node, component = np.divmod(fine, self.space.dimension)
        one, other = self._ends[node].T
        return (one * self.space.dimension + component)[one == other].astype(np.int32), one == other


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
    """Find nodes of each cell in VTK's order, and their places: corners, then middles of edges."""
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
    """Find nodes of the facet opposite each corner of a cell, by their place in VTK's order."""
    facets = []
    for k in range(dimension + 1):
        nodes = [corner for corner in range(dimension + 1) if corner != k]
        if degree == 2:
            edges = enumerate(_VTK_EDGES[: 3 * (dimension - 1)])
            nodes += [dimension + 1 + e for e, ends in edges if k not in ends]
        facets.append(nodes)
    return np.array(facets)
