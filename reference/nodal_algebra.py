"""Matrices and forms that act on nodal arrays (k,), nodes × components, equal on all MPI ranks.

Assembly, products and factorisations are distributed; what a motion does with vectors between them
is not, so that every rank takes the same steps.

Systems of which ties are dropped one after the other. The matrix A of the body with its whole cut
open is factorised once. Ties B u = 0 are forces λ between the nodes that they hold together: S λ =
B A⁻¹ f with S = B A⁻¹ Bᵀ, u = A⁻¹ (f − Bᵀ λ). Ties are in the order in which they go, the last one
first: the Cholesky factor of S for the remaining ties is then a leading block of the factor for
all.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree

from reference.linear_solvers import (
    LARGEST_CORRECTION,
    Kind,
    factorised,
    mean_stiffness,
    preconditioned_gradients,
    solve_directly,
)
from reference.meshing import ConformingMesh
from reference.meshing.opening import interior_facets
from reference.space import ConformingSpace, TiedUnknowns, Unknowns
from verify.geometry.simplices import cell_facets

Array = NDArray[np.float64]
_MOST = 10_000  # iterations
_LEFT = 1e-12  # of a right side, by conjugate gradients: one solution for a linear step
# in ns, for a solid of n unknowns whose matrix has e entries (docs/theory/reference.md): an
# iteration per entry, a factorisation per n² and a solution by it per n^(4/3)
_ITERATION, _FACTORISATION, _SOLUTION = 2.0, 2.0, 40.0


class NodalMatrix:
    """A PETSc matrix that multiplies nodal arrays.

    Parameters
    ----------
    petsc_matrix : PETSc Mat
    unknowns : Unknowns
    """

    def __init__(self, petsc_matrix: Any, unknowns: Unknowns) -> None:
        self.petsc, self._unknowns = petsc_matrix, unknowns
        self._in, self._out = petsc_matrix.createVecs()

    def __matmul__(self, values: Array) -> Array:
        """Multiply an array (k,)."""
        self._in.array[:] = self._unknowns.own_part(values)
        self.petsc.mult(self._in, self._out)
        return self._unknowns.everywhere(self._out.array).ravel()


class NodalSolver:
    """Solver with a matrix of which the rows and columns of held unknowns are taken out.

    It factorises, unless it is to iterate by conjugate gradients. It stops iterating when they have
    taken as many operations as a factorisation, beyond the cost of solutions by a factor. It stops,
    too, at a direction without positive curvature. No clock decides.

    Parameters
    ----------
    matrix : PETSc Mat
        Changed, and destroyed with the solver.
    unknowns : Unknowns
        Of the matrix.
    held : (h,) int array
        Scalar displacements, by nodes.
    kind : {"definite", "symmetric", "general"}
    largest : float
        Share of the first solution that may be lost in round-off.
    iterates : bool
        Whether to begin by conjugate gradients: for solids and symmetric matrices.
    """

    def __init__(
        self,
        matrix: Any,
        unknowns: Unknowns,
        held: NDArray[np.int32],
        kind: Kind = "definite",
        largest: float = LARGEST_CORRECTION,
        iterates: bool = False,
    ) -> None:
        self._largest, self._kind = largest, kind
        self._unknowns, self._matrix, self._proven = unknowns, matrix, False
        matrix.zeroRowsColumns(unknowns.rows(held), mean_stiffness(matrix))
        self._solver: Any = None
        self._iteration = preconditioned_gradients(matrix, _LEFT) if iterates else None
        self._spent = 0.0  # ns by iterations, beyond solutions by a factor
        if not iterates:
            self._factorise()
        self._x, self._b = matrix.createVecs()

    def _factorise(self) -> None:
        self._solver = factorised(self._matrix, self._kind)

    @property
    def iterates(self) -> bool:
        """Whether the next solution will be by conjugate gradients."""
        return self._iteration is not None

    def solve(self, right: Array) -> Array:
        """Solve for an array (k,), zero where held if the right side is.

        The first solve by a factorisation is refined, and shows whether it is any good.

        Raises
        ------
        IllConditionedError
            If the solution is lost in round-off.
        RuntimeError
            If MUMPS failed.
        """
        self._b.array[:] = self._unknowns.own_part(right)
        if not self._is_iterated():
            self._solve_directly()
        return self._unknowns.everywhere(self._x.array).ravel()

    def _is_iterated(self) -> bool:
        """Iterate if that is still worth it; say whether it has led to the solution."""
        if self._iteration is None:
            return False
        size = float(self._matrix.getSize()[0])
        iteration = _ITERATION * float(self._matrix.getInfo()["nz_used"])
        solution, factorisation = _SOLUTION * size ** (4 / 3), _FACTORISATION * size**2
        left = factorisation + solution - self._spent
        self._iteration.setTolerances(max_it=int(min(max(1.0, left / iteration), _MOST)))
        self._iteration.solve(self._b, self._x)
        self._spent += self._iteration.getIterationNumber() * iteration - solution
        found = bool(self._iteration.getConvergedReason() > 0)
        if not found or self._spent >= factorisation:
            self._iteration.destroy()
            self._iteration = None
            self._factorise()
        return found

    def _solve_directly(self) -> None:
        if self._proven:
            self._solver.solve(self._b, self._x)
        else:
            self._x.set(0.0)
            solve_directly(self._solver, self._matrix, self._x, self._b, self._largest)
            self._proven = True

    def destroy(self) -> None:
        """Free what PETSc holds."""
        for entry in (self._solver, self._iteration, self._matrix, self._x, self._b):
            if entry is not None:
                entry.destroy()


def compiled(form: Any) -> Any:
    """Compile a form of UFL; one that is compiled stays."""
    from dolfinx import fem

    return fem.form(form)


def assembled_matrix(form: Any) -> Any:
    """Assemble a bilinear form (of UFL, or compiled)."""
    from dolfinx.fem import petsc

    matrix = petsc.assemble_matrix(compiled(form))
    matrix.assemble()
    return matrix


def nodal_forces(form: Any, unknowns: Unknowns) -> Array:
    """Assemble a linear form (of UFL, or compiled); (k,)."""
    from dolfinx import fem, la

    vector = fem.assemble_vector(compiled(form))
    vector.scatter_reverse(la.InsertMode.add)
    return unknowns.everywhere(vector.array).ravel()


Numbers = NDArray[np.int64]


def sides_of_cut(mesh: ConformingMesh) -> list[tuple[Numbers, Numbers]]:
    """Cells (f,) on either side of each of `mesh.cut_facets`, and their corners opposite to it."""
    before = mesh.parent[mesh.cells]
    first, second, is_cut, _ = interior_facets(before, mesh.cut_facets)
    first, second = first[is_cut], second[is_cut]
    facets = cell_facets(before)
    order = np.lexsort(facets[first].T[::-1])
    assert np.array_equal(facets[first][order], mesh.cut_facets)
    return [np.divmod(side[order], mesh.cell_dimension + 1) for side in (first, second)]


def facing_nodes(space: ConformingSpace) -> Numbers:
    """Pairs (f, q, 2) of nodes at one place on both sides of each facet of `mesh.cut_facets`."""
    both = np.stack([space.facet_nodes(*side) for side in sides_of_cut(space.mesh)])
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
        Tied unknowns, now and at every later solve.
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
        """Add forces between the nodes of some ties; held unknowns bear them."""
        for ends, sign in ((self._one[which], 1.0), (self._other[which], -1.0)):
            np.add.at(forces, ends, sign * sizes * self._free[ends])
