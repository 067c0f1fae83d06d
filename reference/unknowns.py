"""Unknowns of a system, shared among MPI ranks, and the nodal displacements that they are.

Matrices, and vectors within a solve, are PETSc's: each rank has the rows of its own unknowns.
Nodal arrays (n, d), or (k,) of all their components, are whole and equal on all ranks.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

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
        """Give those of some nodal displacements that this rank owns as PETSc numbers them."""
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
        link = coo_array((np.ones(len(pairs)), tuple(pairs.T)), shape=(count, count))
        _, group = connected_components(link.tocsr(), directed=False)
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
        """All nodal displacements in groups of which one is among some, ascending."""
        mark = np.zeros(self.shape, dtype=bool)
        mark.ravel()[displacements] = True
        np.logical_or.at(mark, self.leader, mark.copy())
        return np.flatnonzero(mark[self.leader]).astype(np.int32)

    def own_part(self, values: Array) -> Array:
        """Give the forces of the groups of this rank, of nodal forces (n, d)."""
        return super().own_part(self.summed(values))

    def everywhere(self, local: Array) -> Array:
        """Gather nodal displacements (n, d) on all ranks from those of the groups of each."""
        return self.spread(super().everywhere(local)).reshape(self.shape)
