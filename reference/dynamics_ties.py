"""Ties of a cut that is still closed: nodes on its two sides that move as one.

Matrices and forces are assembled once, on the mesh with the whole cut open. Until a facet opens,
its nodes on one side are tied to those on the other. Around each node the nodes that are left are
then those that `open_cut` would make of the facets that are open, and nothing of the state changes
when a tie goes: neither strain nor kinetic energy, nor momenta.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from reference.meshing.opening import cell_facets, interior_facets
from reference.space import ConformingSpace, SharedUnknowns

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


def facing_nodes(space: ConformingSpace) -> Numbers:
    """Pairs (f, q, 2) of nodes at one place on both sides of each facet of `mesh.cut_facets`."""
    mesh, k = space.mesh, space.mesh.cell_dimension
    before = mesh.parent[mesh.cells]
    first, second, is_cut, _ = interior_facets(before, mesh.cut_facets)
    first, second = first[is_cut], second[is_cut]
    facets = cell_facets(before)
    order = np.lexsort(facets[first].T[::-1])
    assert np.array_equal(facets[first][order], mesh.cut_facets)
    both = np.stack([space.facet_nodes(*np.divmod(s[order], k + 1)) for s in (first, second)])
    # nodes that face each other lie at the same place, to the last digit
    _, place = np.unique(space.node_points[both.ravel()], axis=0, return_inverse=True)
    rank = np.argsort(place.reshape(both.shape), axis=2)
    facing: Numbers = np.moveaxis(np.take_along_axis(both, rank, axis=2), 0, 2)
    return facing


class TiedUnknowns(SharedUnknowns):
    """Unknowns of a system of which some displacements are tied to others.

    Nodal arrays stay those of the whole space; systems have one unknown per group of nodes.

    Parameters
    ----------
    unknowns : ConformingSpace or MixedSpace
        Without ties.
    space : ConformingSpace
        Of the displacements.

    Attributes
    ----------
    leader : (n,) int array
        The node that leads the group of each node.
    followers : (f,) int array
        Nodes that another one leads.
    dimension : int
        Of the space.
    """

    def __init__(self, unknowns: SharedUnknowns, space: ConformingSpace) -> None:
        self._whole, self.dimension = unknowns, space.dimension
        self.function_space = unknowns.function_space
        self.leader = np.arange(len(space.node_points))
        self.followers = self.leader[:0]
        self._expansion: Any = None
        self._few: Any = None
        self._full: Any = None

    def tie(self, pairs: Numbers) -> None:
        """Tie the nodes of pairs (p, 2), and no others."""
        count, whole = len(self.leader), self._whole
        link = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
        _, group = connected_components(link.tocsr(), directed=False)
        self.leader = np.unique(group, return_index=True)[1][group]
        self.followers = np.flatnonzero(self.leader != np.arange(count))
        if self._expansion is not None:
            for entry in (self._expansion, self._full, self._few):
                entry.destroy()
            self._expansion = None
        if not len(self.followers):
            return
        led = np.zeros((count, self.dimension))
        led[self.followers] = 1.0
        self._kept = whole.own_part(led) == 0.0
        size = int(self._kept.sum())
        first = int(self.function_space.mesh.comm.scan(size)) - size
        own = first + np.cumsum(self._kept) - 1
        numbers = whole.everywhere(own.astype(float))[self.leader]
        moves = whole.own_part(np.ones((count, self.dimension))) > 0.0
        self._column = np.where(moves, whole.own_part(numbers).astype(np.int64), own)
        self._assemble(size)

    def _assemble(self, size: int) -> None:
        """Make the matrix that gives every unknown the value of its leader."""
        from petsc4py import PETSc

        rows = len(self._column)
        start = np.arange(rows + 1, dtype=PETSc.IntType)
        entries = (start, self._column.astype(PETSc.IntType), np.ones(rows))
        sizes = ((rows, None), (size, None))
        matrix: Any = PETSc.Mat()
        self._expansion = matrix.createAIJ(sizes, csr=entries, comm=self.function_space.mesh.comm)
        self._few, self._full = self._expansion.createVecs()

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
        total = forces.reshape(-1, self.dimension).copy()
        np.add.at(total, self.leader[self.followers], total[self.followers])
        total[self.followers] = 0.0
        return total.ravel()

    def mean(self, values: Array) -> Array:
        """Give each group the mean of its displacements (k,)."""
        shares = np.bincount(self.leader, minlength=len(self.leader))
        mean = self.summed(values).reshape(-1, self.dimension) / np.maximum(shares, 1)[:, None]
        return self.spread(mean)

    def spread(self, values: Array) -> Array:
        """Give each node the displacement (k,) of its leader."""
        return np.asarray(values.reshape(-1, self.dimension)[self.leader].ravel())

    def all_tied_to(self, unknowns: NDArray[np.int32]) -> NDArray[np.int32]:
        """All scalar displacements in groups of which one is among some, ascending."""
        mark = np.zeros((len(self.leader), self.dimension), dtype=bool)
        mark.ravel()[unknowns] = True
        np.logical_or.at(mark, self.leader, mark.copy())
        return np.flatnonzero(mark[self.leader]).astype(np.int32)

    def own_unknowns(self, unknowns: NDArray[np.int32]) -> tuple[Numbers, Numbers]:
        """Find which of some scalar displacements lead and are this rank's own."""
        own, at = self._whole.own_unknowns(unknowns)
        if self._expansion is None:
            return own, at
        kept = self._kept[own]
        return np.cumsum(self._kept)[own[kept]] - 1, at[kept]

    @property
    def first(self) -> int:
        """Number of the first group of this rank."""
        return self._whole.first if self._expansion is None else self._few.getOwnershipRange()[0]

    @property
    def own_size(self) -> int:
        """Number of groups of unknowns that this rank owns."""
        return self._whole.own_size if self._expansion is None else self._few.getLocalSize()

    def own_part(self, values: Array) -> Array:
        """Give the forces of the groups of this rank, of nodal forces (n, d)."""
        own = self._whole.own_part(values)
        if self._expansion is None:
            return own
        self._full.array[:] = own
        self._expansion.multTranspose(self._full, self._few)
        return np.array(self._few.array)

    def everywhere(self, local: Array) -> Array:
        """Gather nodal displacements (n, d) on all ranks from those of the groups of each."""
        if self._expansion is None:
            return self._whole.everywhere(local)
        self._few.array[:] = local
        self._expansion.mult(self._few, self._full)
        return self._whole.everywhere(np.array(self._full.array))
