"""Ties of a cut that is still closed, and systems of which they are dropped one after the other.

The matrix A is that of the body with its whole cut open, factorised once. Ties B u = 0 are forces
λ between the nodes that they hold together: S λ = B A⁻¹ f with S = B A⁻¹ Bᵀ, u = A⁻¹ (f − Bᵀ λ).
Ties are in the order in which they go, the last one first: the Cholesky factor of S for those that
are left is then a leading block of the one for all.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from reference.meshing.opening import cell_facets, interior_facets
from reference.nodal_algebra import NodalSolver
from reference.space import ConformingSpace
from reference.unknowns import TiedUnknowns

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


def lasting_ties(facing: Numbers, opening: Array) -> Numbers:
    """Choose ties (p, 2) of nodes without cycles, those that last longest first.

    Of all ties at any time those among the chosen tie the same groups.

    Parameters
    ----------
    facing : (f, q, 2) array
        Pairs of nodes on both sides of each facet.
    opening : (f, q) array
        When each pair opens, s.
    """
    order = np.argsort(-opening.ravel(), kind="stable")
    pairs = np.sort(facing.reshape(-1, 2)[order], axis=1)
    _, first = np.unique(pairs, axis=0, return_index=True)
    count = int(facing.max(initial=-1)) + 1
    graph = coo_array((first + 1.0, tuple(pairs[first].T)), shape=(count, count))
    tree = minimum_spanning_tree(graph.tocsr()).tocoo()
    return np.column_stack([tree.row, tree.col])[np.argsort(tree.data)].astype(np.int64)


class TiedSolver:
    """Solver of a definite system with ties that go.

    Parameters
    ----------
    solver : NodalSolver
        Without any ties; destroyed with this one.
    ties : TiedUnknowns
        What is tied, now and at every later solve.
    lasting : (p, 2) int array
        Of `lasting_ties`.
    held : (h,) int array
        Unknowns that are held without ties.
    """

    def __init__(
        self, solver: NodalSolver, ties: TiedUnknowns, lasting: Numbers, held: NDArray[np.int32]
    ) -> None:
        self._solver, self._ties, self._lasting = solver, ties, lasting
        count, d = ties.shape
        free = np.ones(count * d)
        free[held] = 0.0
        ends = (lasting[:, None] * d + np.arange(d)[:, None]).reshape(-1, 2)
        some = free[ends].any(axis=1)
        self._one, self._other = ends[some].T
        self._tie_of = np.repeat(np.arange(len(lasting)), d)[some]
        self._free = free
        compliance = np.empty((len(self._one),) * 2)
        for k in range(len(self._one)):
            pull = np.zeros(count * d)
            self._pull(pull, np.array([1.0]), slice(k, k + 1))
            compliance[k] = self._apart(solver.solve(pull))
        self._factor: Any = cholesky(0.5 * (compliance + compliance.T), lower=True)

    def solve(self, right: Array) -> Array:
        """Solve for an array (k,), zero where held if the right side is."""
        one, other = self._ties.leader[self._lasting].T
        left = int(np.searchsorted(self._tie_of, np.count_nonzero(one == other)))
        factor, right = self._factor[:left, :left], right.copy()
        gap = self._apart(self._solver.solve(right))[:left]
        forces = solve_triangular(factor, gap, lower=True)
        forces = solve_triangular(factor, forces, lower=True, trans="T")
        self._pull(right, -forces, slice(left))
        return self._ties.spread(self._solver.solve(right))

    def destroy(self) -> None:
        """Free what PETSc holds."""
        self._solver.destroy()

    def _apart(self, u: Array) -> Array:
        return np.asarray(u[self._one] - u[self._other])

    def _pull(self, forces: Array, sizes: Array, which: slice) -> None:
        """Add forces between the nodes of some ties; what is held bears them."""
        for ends, sign in ((self._one[which], 1.0), (self._other[which], -1.0)):
            np.add.at(forces, ends, sign * sizes * self._free[ends])
