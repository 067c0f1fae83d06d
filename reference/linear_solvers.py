"""Solving symmetric systems: directly, or by multigrid to a true residual."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace, Unknowns

Kind = Literal["definite", "symmetric", "general"]  # the first two are symmetric
LARGEST_CORRECTION = 1e-6  # relative; a direct solve of a regular system stays far below it
_MOST_ITERATIONS = 2000
_RUNS = 6
_MOST_FLAT = 0.5  # of the unknowns: a body all of flat cells is thin, and no cut has made them
_ROUND_OFFS = 4.0  # a row has some tens of entries: 1.1 to 3 were measured on thin strips
_GAMG = {
    "pc_type": "gamg",
    "pc_gamg_threshold": 0.01,
    "pc_gamg_aggressive_coarsening": 1,
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 3,
    "mg_levels_pc_type": "jacobi",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_coarse_pc_type": "lu",
    "mg_coarse_pc_factor_mat_solver_type": "mumps",
}
_MULTIGRID = {"ksp_norm_type": "unpreconditioned", **_GAMG}
# of quadratic elements: linear ones on the same mesh below them, which are solved for directly as
# long as there are few
_LINEAR_BELOW = {
    "ksp_norm_type": "unpreconditioned",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": 1,
    "mg_levels_pc_type": "sor",
    "mg_levels_esteig_ksp_type": "cg",
    "mg_coarse_ksp_type": "preonly",
}
_DIRECTLY = {"pc_type": "cholesky", "pc_factor_mat_solver_type": "mumps"}
_MOST_CORNERS = 100_000  # unknowns of linear elements that are solved for directly
# of a saddle point: multigrid for the displacements, and a mass for the pressures
_BLOCKS = {
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "diag",
    "pc_fieldsplit_schur_precondition": "user",
    "fieldsplit_u_ksp_type": "preonly",
    **{f"fieldsplit_u_{name}": value for name, value in _GAMG.items()},
    "fieldsplit_p_ksp_type": "chebyshev",
    "fieldsplit_p_ksp_max_it": 4,
    "fieldsplit_p_ksp_convergence_test": "skip",
    "fieldsplit_p_pc_type": "jacobi",
}


class Answer(NamedTuple):
    """How well a system was solved.

    Attributes
    ----------
    method : str
    round_off : float
        Relative size of the last correction of the solution: its accuracy.
    residual : float
        Norm of the true residual over the norm of the loads, with the supports in place.
    iterations : int
    """

    method: str
    round_off: float
    residual: float
    iterations: int


class IllConditionedError(RuntimeError):
    """A system was factorised, but its solution is lost in round-off.

    Attributes
    ----------
    correction : (l,) array
        Last correction of the unknowns of this rank: largest where the system is weak.
    size : float
        Its norm over the norm of the solution.
    """

    def __init__(self, correction: NDArray[np.float64], size: float) -> None:
        super().__init__(
            f"MUMPS did not solve the system (a refined solution differs by {size:.1e})"
        )
        self.correction, self.size = correction, size


def factorised(matrix: Any, kind: Kind = "definite", controls: dict[int, int] | None = None) -> Any:
    """Factorise a matrix by MUMPS, with `controls` (its ICNTL) if need be; gives a PETSc KSP."""
    from petsc4py import PETSc

    if kind != "general":
        matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    if kind == "definite":
        matrix.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("preonly")
    conditioner = solver.getPC()
    conditioner.setType("lu" if kind == "general" else "cholesky")
    conditioner.setFactorSolverType("mumps")
    if controls:
        conditioner.setFactorSetUpSolverType()
        for number, value in controls.items():
            conditioner.getFactorMatrix().setMumpsIcntl(number, value)
    solver.setUp()
    return solver


Answers = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def answers_of(solver: Any, unknowns: Any, fixed: NDArray[np.int64]) -> tuple[Answers, Answers]:
    """Return what a factorised system makes of nodal forces, zero at `fixed` unknowns of a rank.

    Parameters
    ----------
    solver : PETSc KSP
    unknowns : reference.space.Unknowns
    fixed : (f,) int array

    Returns
    -------
    forces : function
        The part of this rank of nodal forces (k,).
    solve : function
        Displacements (k, c) on all ranks, of columns of nodal forces.
    """
    from petsc4py import PETSc

    def forces(values: NDArray[np.float64]) -> NDArray[np.float64]:
        own = unknowns.own_part(values)
        own[fixed] = 0.0
        return np.asarray(own)

    def solve(columns: NDArray[np.float64]) -> NDArray[np.float64]:
        right: Any = np.asfortranarray(np.column_stack([forces(one) for one in columns.T]))
        size: Any = ((len(right), None), (None, columns.shape[1]))
        loads = PETSc.Mat().createDense(size, array=right, comm=solver.comm)
        found = loads.duplicate()
        solver.matSolve(loads, found)
        each = [unknowns.everywhere(one).ravel() for one in found.getDenseArray().T]
        loads.destroy()
        found.destroy()
        return np.column_stack(each)

    return forces, solve


def preconditioned_gradients(matrix: Any, tolerance: float) -> Any:
    """Prepare conjugate gradients with an incomplete Cholesky factor; gives a PETSc KSP.

    Parameters
    ----------
    matrix : PETSc Mat
        Symmetric; best not much worse conditioned than a mass.
    tolerance : float
        Of the residual relative to the right side.
    """
    from petsc4py import PETSc

    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("cg")
    norm: Any = PETSc.KSP.NormType.UNPRECONDITIONED
    solver.setNormType(norm)
    solver.setTolerances(rtol=tolerance, atol=0.0)
    # of the unknowns of each rank by themselves an incomplete LU, which is the same
    solver.getPC().setType("icc" if matrix.comm.size == 1 else "bjacobi")
    return solver


def modes_not_positive(matrix: Any) -> int:
    """Count the eigenvalues of a symmetric matrix that are not positive, by Sylvester's law.

    They are the negative and the vanishing pivots of MUMPS.
    """
    # pivots of the last front are not counted otherwise, and vanishing ones are an error
    solver = factorised(matrix, "symmetric", {13: 1, 24: 1})
    negative, vanishing, _ = solver.getPC().getFactorMatrix().getInertia()
    solver.destroy()
    return int(negative + vanishing)


def solve_directly(
    solver: Any, matrix: Any, x: Any, vector: Any, largest: float = LARGEST_CORRECTION
) -> Answer:
    """Solve and refine by two residual corrections.

    The correction estimates the error itself, which the residual of a stiff system does not.

    Parameters
    ----------
    solver : PETSc KSP
    matrix, x, vector : PETSc Mat and Vecs
        x holds the values of the constrained unknowns.
    largest : float
        How large the last correction may be, relative to x.

    Raises
    ------
    RuntimeError
        If MUMPS failed.
    IllConditionedError
        If the last correction is not small.
    """
    residual, correction = vector.duplicate(), x.duplicate()
    loads = _residual(matrix, x, vector, residual)  # x holds the supports' values so far
    solver.solve(vector, x)
    reason = solver.getConvergedReason()
    size = 0.0
    for _ in range(2):
        _residual(matrix, x, vector, residual)
        solver.solve(residual, correction)
        size = float(correction.norm() / (x.norm() or 1.0))
        x.axpy(1.0, correction)
    left = _residual(matrix, x, vector, residual) / (loads or 1.0)
    last = np.array(correction.array, dtype=float)
    residual.destroy()
    correction.destroy()
    if reason < 0:
        raise RuntimeError(f"MUMPS did not solve the system (PETSc reason {reason})")
    if not size <= largest:
        raise IllConditionedError(last, size)
    return Answer("PETSc, MUMPS Cholesky", size, left, 0)


def solve_by_multigrid(
    matrix: Any,
    space: ConformingSpace,
    x: Any,
    vector: Any,
    tolerance: float,
    flat: NDArray[np.int32] | None = None,
) -> Answer:
    """Solve by conjugate gradients with multigrid, from x.

    Below quadratic elements are linear ones on the same mesh, below these algebraic multigrid
    (GAMG) where they are many. It knows the rigid motions.

    Cells that a cut leaves flat are stiff against everything but rigid motions, which no smoother
    of points resolves: their unknowns are solved for directly before and after each cycle (as de
    Prenter et al. do on cut cells, Comput. Mech. 65, 2020).

    PETSc judges convergence by a residual that it updates, and that drifts away from the true one:
    the true one is computed after each run, and CG is started again until it is small.

    Parameters
    ----------
    matrix, x, vector : PETSc Mat and Vecs
        x holds the values of the constrained unknowns and zeros else.
    space : ConformingSpace
        Of the displacements, which are the unknowns.
    tolerance : float
        Of the true residual, relative to the start.
    flat : int array, optional
        Unknowns of flat cells that this process owns, by their numbers in the matrix.

    Raises
    ------
    RuntimeError
        If the tolerance is not reached; with PETSc's reason.
    """
    from petsc4py import PETSc

    matrix.setOption(PETSc.Mat.Option.SPD, True)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    cycle = Cycle(matrix, space)
    own = np.zeros(0, dtype=np.int32) if flat is None else flat
    if 0 < matrix.comm.tompi4py().allreduce(len(own)) < _MOST_FLAT * matrix.getSize()[0]:
        norm: Any = PETSc.KSP.NormType.UNPRECONDITIONED
        solver.setNormType(norm)
        conditioner: Any = solver.getPC()
        conditioner.setType("python")
        conditioner.setPythonContext(_CyclesBetweenFlatCells(matrix, own, cycle))
    else:
        cycle.set(solver)
    solver.setType("cg")
    solver.setInitialGuessNonzero(True)

    def aim(loads: float, _left: float) -> None:
        solver.setTolerances(
            rtol=1e-30, atol=0.5 * tolerance * loads, divtol=1e10, max_it=_MOST_ITERATIONS
        )

    try:
        return iterate(solver, matrix, x, vector, tolerance, aim, f"CG with {cycle.name}")
    finally:
        solver.destroy()
        cycle.destroy()


class Cycle:
    """A multigrid cycle for the matrix of a space.

    Parameters
    ----------
    matrix : PETSc Mat
    space : ConformingSpace
    definite : bool
        Whether the matrix is positive definite.

    Attributes
    ----------
    name : str
    """

    def __init__(self, matrix: Any, space: ConformingSpace, definite: bool = True) -> None:
        from petsc4py import PETSc

        self.name = "GAMG"
        self._entries: list[Any] = []
        if space.degree == 1:
            matrix.setNearNullSpace(near_null_space(matrix, space))
            return
        shares, corners = space.interpolation_of_corners()
        d = space.dimension
        sizes = (matrix.getSizes()[0], (d * len(corners), shares.shape[1]))
        parts = (shares.indptr.astype(np.int32), shares.indices.astype(np.int32), shares.data)
        self._linear = PETSc.Mat().createAIJ(sizes, csr=parts, comm=matrix.comm)
        self._below = matrix.PtAP(self._linear)
        self._below.setBlockSize(d)
        kind = PETSc.Mat.Option.SPD if definite else PETSc.Mat.Option.SYMMETRIC
        self._below.setOption(kind, True)
        self._entries = [self._linear, self._below]
        self._direct = shares.shape[1] <= _MOST_CORNERS
        if not self._direct:
            self._below.setNearNullSpace(near_null_space(self._below, space, corners))
        self.name = "linear elements" if self._direct else "linear elements and GAMG"

    def update(self, matrix: Any) -> None:
        """Follow a matrix whose entries have changed."""
        if self._entries:
            matrix.PtAP(self._linear, self._below)

    def set(self, solver: Any) -> None:
        """Let the cycle precondition a PETSc KSP, with the norm of the true residual."""
        if not self._entries:
            with options(solver, "reference_", _MULTIGRID):
                return
        conditioner: Any = solver.getPC()
        solver.setOptionsPrefix("reference_")
        conditioner.setType("mg")
        conditioner.setMGLevels(2)
        conditioner.setMGInterpolation(1, self._linear)
        conditioner.getMGCoarseSolve().setOperators(self._below)
        coarse = _DIRECTLY if self._direct else _GAMG
        given = {**_LINEAR_BELOW, **{f"mg_coarse_{name}": value for name, value in coarse.items()}}
        with options(solver, "reference_", given):
            solver.setUp()  # GAMG reads what it is to be then

    def destroy(self) -> None:
        """Free what PETSc holds."""
        for entry in self._entries:
            entry.destroy()


class _CyclesBetweenFlatCells:
    """Preconditioner of PETSc: flat cells directly, a multigrid cycle, flat cells directly."""

    def __init__(self, matrix: Any, flat: NDArray[np.int32], cycle: Cycle) -> None:
        from petsc4py import PETSc

        self._matrix = matrix
        rows: Any = PETSc.IS()
        self._rows = rows.createGeneral(flat, comm=matrix.comm)
        self._block = matrix.createSubMatrix(self._rows, self._rows)
        self._direct = factorised(self._block)
        self._cycle = PETSc.KSP().create(matrix.comm)
        self._cycle.setOperators(matrix)
        cycle.set(self._cycle)
        self._cycle.setType("preonly")
        self._left, self._change = matrix.createVecRight(), matrix.createVecRight()
        self._part = self._block.createVecRight()

    def apply(self, _conditioner: Any, loads: Any, x: Any) -> None:
        x.set(0.0)
        self._correct(loads, x)
        self._cycle.solve(self._residual(loads, x), self._change)
        x.axpy(1.0, self._change)
        self._correct(self._residual(loads, x), x)

    def _residual(self, loads: Any, x: Any) -> Any:
        self._matrix.mult(x, self._left)
        self._left.aypx(-1.0, loads)
        return self._left

    def _correct(self, left: Any, x: Any) -> None:
        part = left.getSubVector(self._rows)
        self._direct.solve(part, self._part)
        left.restoreSubVector(self._rows, part)
        part = x.getSubVector(self._rows)
        part.axpy(1.0, self._part)
        x.restoreSubVector(self._rows, part)

    def destroy(self, _conditioner: Any) -> None:
        for entry in (self._rows, self._block, self._direct, self._cycle, self._left,
                      self._change, self._part):  # fmt: skip
            entry.destroy()


def solve_saddle(
    matrix: Any,
    weight: Any,
    space: ConformingSpace,
    mixed: Unknowns,
    x: Any,
    vector: Any,
    tolerance: float,
) -> Answer:
    """Solve by MINRES with GAMG for the displacements and a mass for the pressures.

    Parameters
    ----------
    matrix, x, vector : PETSc Mat and Vecs
        x holds the values of the constrained unknowns and zeros else.
    weight : PETSc Mat
        Of the pressures, on all unknowns: like minus their Schur complement.
    space : ConformingSpace
        Of the displacements.
    mixed : Unknowns
        Of `mixed_unknowns`.
    tolerance : float
        Of the true residual, relative to the start.

    Raises
    ------
    RuntimeError
        If the tolerance is not reached; with PETSc's reason.
    """
    from petsc4py import PETSc

    # GAMG wants the components of a node side by side, so the order of `space` is kept in the block
    own, at = mixed.own_unknowns(space.nodal)
    of_u, of_p = mixed.indices(own[np.argsort(at)]), mixed.indices(mixed.pressures)
    of_u.setBlockSize(space.dimension)
    block = matrix.createSubMatrix(of_u, of_u)
    near = near_null_space(block, space)
    of_u.compose("nearnullspace", near)
    mass = weight.createSubMatrix(of_p, of_p)
    solver = PETSc.KSP().create(matrix.comm)
    solver.setOperators(matrix)
    solver.setType("minres")
    solver.setInitialGuessNonzero(True)
    split: Any = solver.getPC()
    solver.setOptionsPrefix("mixed_")  # the blocks take it over when they are told
    split.setType("fieldsplit")
    split.setFieldSplitIS(("u", of_u), ("p", of_p))
    split.setFieldSplitSchurPreType(PETSc.PC.FieldSplitSchurPreType.USER, mass)
    wanted = 0.1 * tolerance

    def aim(_loads: float, left: float) -> None:
        # MINRES minimises the preconditioned residual, and judges by it
        nonlocal wanted
        wanted *= min(0.1, 0.5 * tolerance / left) if left else 1.0
        solver.setTolerances(rtol=wanted, atol=0.0, max_it=_MOST_ITERATIONS)

    method = "MINRES with GAMG and pressures"
    try:
        with options(solver, "mixed_", _BLOCKS):
            return iterate(solver, matrix, x, vector, tolerance, aim, method, persist=True)
    finally:
        for entry in (solver, near, block, mass, of_u, of_p):
            entry.destroy()


def iterate(
    solver: Any,
    matrix: Any,
    x: Any,
    vector: Any,
    tolerance: float,
    aim: Callable[[float, float], None],
    method: str,
    persist: bool = False,
) -> Answer:
    """Start an iterative solver from x again and again until the true residual is small.

    Small means within the tolerance, or within round-off of K x: in a thin body that bends the
    products are many orders larger than the loads. Then the last run has to change x by little.

    Parameters
    ----------
    solver, matrix, x, vector : PETSc KSP, Mat and Vecs
    tolerance : float
        Of the true residual, relative to the start.
    aim : callable
        Sets the solver's own tolerances for its next run. Its arguments are the norm of the
        residual at the start, and the share that the last run has left (0 before the first).
    method : str
    persist : bool
        Whether to go on after a run that PETSc says has failed.

    Raises
    ------
    RuntimeError
        If the tolerance is not reached; with PETSc's reason.
    """
    residual, before = vector.duplicate(), x.duplicate()
    loads = _residual(matrix, x, vector, residual)
    iterations, left, size, reached = 0, 0.0, 0.0, False
    for _ in range(_RUNS):
        aim(loads, left)
        x.copy(before)
        solver.solve(vector, x)
        iterations += solver.getIterationNumber()
        left = _residual(matrix, x, vector, residual) / (loads or 1.0)
        before.aypx(-1.0, x)
        size = float(before.norm() / (x.norm() or 1.0))
        failed = solver.getConvergedReason() < 0
        floor = _ROUND_OFFS * _round_off(matrix, x, residual) / (loads or 1.0)
        reached = left <= max(tolerance, floor if size <= LARGEST_CORRECTION else 0.0)
        if reached or (failed and not persist):
            break
    residual.destroy()
    before.destroy()
    if not reached:
        raise RuntimeError(
            f"{method} left a residual of {left:.1e} after {iterations} iterations (PETSc reason "
            f"{solver.getConvergedReason()}); {tolerance:.1e} is wanted"
        )
    return Answer(f"PETSc, {method}", min(size, left), left, iterations)


def _round_off(matrix: Any, x: Any, work: Any) -> float:
    """Estimate the norm of the round-off in K x: eps |K_ii x_i|; overwrites `work`."""
    matrix.getDiagonal(work)
    work.pointwiseMult(work, x)
    return float(np.finfo(float).eps * work.norm())


@contextmanager
def options(solver: Any, prefix: str, given: dict[str, Any]) -> Iterator[None]:
    """Set a PETSc KSP or SNES by options, which what it makes later may read until the end."""
    from petsc4py import PETSc

    known: Any = PETSc.Options()
    solver.setOptionsPrefix(prefix)
    for name, value in given.items():
        known[prefix + name] = value
    solver.setFromOptions()
    try:
        yield
    finally:
        for name in given:
            known.delValue(prefix + name)


def near_null_space(
    matrix: Any, space: ConformingSpace, nodes: NDArray[np.int64] | None = None
) -> Any:
    """Give the rigid motions of a body as PETSc wants them for the multigrid of `matrix`.

    Its unknowns belong to the nodes of this rank, or to some of them.
    """
    from petsc4py import PETSc

    mine = space.node_points[space.node_of_dof[: space.owned] if nodes is None else nodes]
    places = matrix.createVecRight()
    places.setBlockSize(space.dimension)
    places.array[:] = (mine - space.node_points.mean(axis=0)).ravel()
    found = PETSc.NullSpace().createRigidBody(places)
    places.destroy()
    return found


def rigid_motions(points: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Give the rigid motions (3 or 6, n · d) at points (n, d): shifts, then turns."""
    n, d = points.shape
    centred = points - centre
    pairs = [(0, 1)] if d == 2 else [(0, 1), (1, 2), (2, 0)]
    motions = np.zeros((d + len(pairs), n, d))
    for k in range(d):
        motions[k, :, k] = 1.0
    for k, (i, j) in enumerate(pairs):
        motions[d + k, :, i], motions[d + k, :, j] = -centred[:, j], centred[:, i]
    return motions.reshape(len(motions), -1)


def mean_stiffness(matrix: Any) -> float:
    """Give a mean diagonal entry: a constrained unknown shall not stand out among the others."""
    diagonal = matrix.getDiagonal()
    mean = float(diagonal.sum()) / diagonal.getSize()
    diagonal.destroy()
    return mean


def _residual(matrix: Any, x: Any, vector: Any, out: Any) -> float:
    """Put vector − matrix x into `out`; give its norm."""
    matrix.mult(x, out)
    out.aypx(-1.0, vector)
    return float(out.norm())
