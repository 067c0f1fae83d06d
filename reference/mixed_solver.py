"""Solving large saddle points of displacement and pressure by MINRES, each block preconditioned."""

from typing import Any

from reference.linear_solvers import Answer, iterate, near_null_space
from reference.mixed_space import MixedSpace

_MOST_ITERATIONS = 2000
_BLOCKS = {
    "pc_type": "fieldsplit",
    "pc_fieldsplit_type": "schur",
    "pc_fieldsplit_schur_fact_type": "diag",
    "pc_fieldsplit_schur_precondition": "user",
    "fieldsplit_u_ksp_type": "preonly",
    "fieldsplit_u_pc_type": "gamg",
    "fieldsplit_u_pc_gamg_threshold": 0.01,
    "fieldsplit_u_pc_gamg_aggressive_coarsening": 1,
    "fieldsplit_u_mg_levels_ksp_type": "chebyshev",
    "fieldsplit_u_mg_levels_ksp_max_it": 3,
    "fieldsplit_u_mg_levels_pc_type": "jacobi",
    "fieldsplit_u_mg_levels_esteig_ksp_type": "cg",
    "fieldsplit_u_mg_coarse_pc_type": "lu",
    "fieldsplit_u_mg_coarse_pc_factor_mat_solver_type": "mumps",
    "fieldsplit_p_ksp_type": "chebyshev",
    "fieldsplit_p_ksp_max_it": 4,
    "fieldsplit_p_ksp_convergence_test": "skip",
    "fieldsplit_p_pc_type": "jacobi",
}


def solve_saddle(
    matrix: Any, weight: Any, mixed: MixedSpace, x: Any, vector: Any, tolerance: float
) -> Answer:
    """Solve by MINRES with GAMG for the displacements and a mass for the pressures.

    Parameters
    ----------
    matrix, x, vector : PETSc Mat and Vecs
        x holds the values of the constrained unknowns and zeros else.
    weight : PETSc Mat
        Of the pressures, on all unknowns: like minus their Schur complement.
    mixed : MixedSpace
    tolerance : float
        Of the true residual, relative to that of the start.

    Raises
    ------
    RuntimeError
        If the tolerance is not reached; with PETSc's reason.
    """
    from petsc4py import PETSc

    d, space = mixed.space.dimension, mixed.space
    comm = matrix.comm
    own = mixed.displacement_dofs[: space.owned]
    # GAMG wants the components of a node side by side, so this order is kept in the block
    of_u = mixed.indices(own.ravel())
    of_p = mixed.pressure_indices()
    of_u.setBlockSize(d)
    block = matrix.createSubMatrix(of_u, of_u)
    near = near_null_space(block, space)
    of_u.compose("nearnullspace", near)
    mass = weight.createSubMatrix(of_p, of_p)
    solver = PETSc.KSP().create(comm)
    solver.setOptionsPrefix("mixed_")
    options: Any = PETSc.Options()
    for name, value in _BLOCKS.items():
        options[f"mixed_{name}"] = value
    solver.setOperators(matrix)
    solver.setType("minres")
    solver.setInitialGuessNonzero(True)
    split: Any = solver.getPC()
    split.setType("fieldsplit")
    split.setFieldSplitIS(("u", of_u), ("p", of_p))
    split.setFieldSplitSchurPreType(PETSc.PC.FieldSplitSchurPreType.USER, mass)
    solver.setFromOptions()
    wanted = 0.1 * tolerance

    def aim(_loads: float, left: float) -> None:
        # MINRES minimises the preconditioned residual, and judges by it
        nonlocal wanted
        wanted *= min(0.1, 0.5 * tolerance / left) if left else 1.0
        solver.setTolerances(rtol=wanted, atol=0.0, max_it=_MOST_ITERATIONS)

    method = "MINRES with GAMG and pressures"
    try:
        return iterate(solver, matrix, x, vector, tolerance, aim, method, persist=True)
    finally:
        for name in _BLOCKS:
            options.delValue(f"mixed_{name}")
        for entry in (solver, near, block, mass, of_u, of_p):
            entry.destroy()
