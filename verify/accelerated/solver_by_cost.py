"""Solvers chosen by what a matrix costs them: counted operations decide, no clock.

`SolverByCost` takes conjugate gradients or Cholesky's factorisation. How many iterations a motion
needs depends on its step, and what a factorisation costs on how thick a body is. Iterations are
counted and the operations of a factorisation known from its analysis, so that the same motion takes
the same way twice.

`DirectBySize` takes SciPy's factorisation for a few solutions with a small matrix, else `Cholesky`.
SciPy needs milliseconds more for each, but nothing has to be compiled, which takes ten seconds at
the first use of `Cholesky`.
"""

import numpy as np
from numpy.typing import NDArray

from verify.accelerated.cholesky import Cholesky
from verify.accelerated.conjugate_gradients import ConjugateGradients
from verify.xfem.arrays import Floats, NotConvergedError
from verify.xfem.block_pattern import BlockPattern
from verify.xfem.linear_solvers import LinearSolver, SparseLU

# measured on one core (AVX-512): in ns, per operation and entry of the factor of a
# factorisation with its solution, and per node and iteration of conjugate gradients
_OPERATION, _ENTRY, _ITERATION = 0.035, 6.0, 50.0
_LARGE = 2000  # nodes of a solid, from which it is not even analysed ...
_MANY, _ACROSS = 100, 12.0  # ... before so many iterations were not enough, or of its nodes across
_MOST = 10_000  # iterations where there is no memory for a factor


class SolverByCost(LinearSolver):
    """Solver of K x = b, first iterative and direct from the first solution that takes too long.

    A matrix that comes back, as in linear motion, is factorised too, once its solutions have taken
    as many iterations together.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    held : (N,) bool array
        As of `Cholesky`.
    solid : bool
        Whether the nodes belong to a solid, which fills a factor quickly.
    tolerance : float
        As of `ConjugateGradients`.

    Attributes
    ----------
    is_iterative : bool
        Whether the last solution was, and the next will begin, by conjugate gradients.
    """

    def __init__(
        self,
        pattern: BlockPattern,
        block: int,
        held: NDArray[np.bool_],
        solid: bool,
        tolerance: float,
    ) -> None:
        self._pattern, self._block, self._held = pattern, block, held
        self._direct: Cholesky | None = None
        self._blocks: Floats | None = None
        self.is_iterative = True
        self._waits = solid and pattern.node_count >= _LARGE
        # a cube at rest takes 10 N^⅓ to a residual of 1e-13
        many = int(_ACROSS * pattern.node_count ** (1 / 3)) if self._waits else 0
        self._iterative = ConjugateGradients(pattern, block, tolerance, max(_MANY, many))
        self._matrices, self._is_analysed = 0, False
        self._spent = 0  # iterations with this matrix
        self._turned_for_one = False  # to a factorisation, because a matrix came back

    def learn(self, former: LinearSolver) -> None:
        """Iterate as often as a former one was allowed to, or factorise at once if it did so."""
        if not self.is_iterative or not isinstance(former, SolverByCost):
            return
        self._iterative.limit = former._iterative.limit
        self._waits |= former._waits or former._is_analysed
        if not former.is_iterative:
            self._analyse()
            self.is_iterative = self._direct is None

    @property
    def reads_half(self) -> bool:  # type: ignore[override]
        """Whether blocks below the diagonal of the next matrix are not read."""
        return self.is_iterative

    @property
    def tolerance(self) -> float:
        """Of the residual that iterations leave, relative to the right-hand side."""
        return self._iterative.tolerance

    @tolerance.setter
    def tolerance(self, tolerance: float) -> None:
        self._iterative.tolerance = tolerance

    def _analyse(self) -> None:
        """Allow as many iterations as a factorisation is worth."""
        self._is_analysed = True
        try:
            self._direct = direct = Cholesky(self._pattern, self._block, self._held)
        except MemoryError:
            self._iterative.limit = _MOST
            return
        cost = _OPERATION * direct.operations + _ENTRY * direct.factor_entries
        self._iterative.limit = max(1, int(cost / (_ITERATION * self._pattern.node_count)))

    def factorize(self, blocks: Floats) -> None:
        """Take the matrix; see `LinearSolver`. A single matrix is spared the analysis."""
        self._blocks, self._matrices, self._spent = blocks, self._matrices + 1, 0
        self.is_iterative |= self._turned_for_one
        self._turned_for_one = False
        if self._matrices == 2 and not (self._is_analysed or self._waits):
            self._analyse()
        if self.is_iterative:
            self._iterative.factorize(blocks)
        else:
            assert self._direct is not None
            self._direct.factorize(blocks)

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`. Iterations run out only if there is no room for a factor."""
        x = np.zeros(np.shape(load)) if x is None else x
        if self.is_iterative and self._spent > self._iterative.limit:
            if not self._is_analysed:
                self._analyse()
            if self._direct is not None and self._spent > self._iterative.limit:
                self._turn()
                self._turned_for_one = True
        while self.is_iterative:
            allowed = self._iterative.limit
            try:
                self._iterative.solve(load, x)
                self._spent += self._iterative.iterations
                return x
            except NotConvergedError:
                if not self._is_analysed:
                    self._analyse()
                if self._direct is None and allowed == _MOST:
                    raise
                if self._iterative.limit <= allowed:
                    self._turn()
        assert self._direct is not None
        return self._direct.solve(load, x)

    def _turn(self) -> None:
        """Factorise this matrix."""
        assert self._blocks is not None
        assert self._direct is not None
        self.is_iterative = False
        pattern = self._pattern
        row = np.repeat(np.arange(pattern.node_count), np.diff(pattern.starts))
        below = np.flatnonzero(pattern.columns < row)
        self._blocks[below] = self._blocks[pattern.mirror[below]].transpose(0, 2, 1)
        self._direct.factorize(self._blocks)


# where SuperLU takes about 30 ms more than `Cholesky` (benchmarks/test_xfem_static compares them)
_FEW_ENTRIES = 110_000  # entries of the matrix: 4000 nodes in the plane, 900 in space
_FEW = 8  # factorisations, a quarter of a second at most


class DirectBySize(LinearSolver):
    """Solver of K x = b for symmetric positive definite K in nodal blocks.

    Parameters
    ----------
    pattern : BlockPattern
    block : int
        Size of the blocks.
    held : (N,) bool array, optional
        As of `Cholesky`.
    """

    def __init__(
        self, pattern: BlockPattern, block: int, held: NDArray[np.bool_] | None = None
    ) -> None:
        self._problem = pattern, block, held
        self._count = 0
        self._solver: LinearSolver
        if len(pattern.columns) * block**2 <= _FEW_ENTRIES:
            self._solver = SparseLU(pattern, block, definite=True)
        else:
            self._solver = Cholesky(*self._problem)

    def factorize(self, blocks: Floats) -> None:
        """Factorise; see `LinearSolver`."""
        self._count += 1
        if self._count > _FEW and isinstance(self._solver, SparseLU):
            self._solver = Cholesky(*self._problem)
        self._solver.factorize(blocks)

    def solve(self, load: Floats, x: Floats | None = None) -> Floats:
        """Solve; see `LinearSolver`."""
        return self._solver.solve(load, x)
