"""Free vibration of a cut body: lowest frequencies and the largest, by SLEPc."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.elasticity import mass_form, stiffness_form
from reference.nodal_algebra import assembled_matrix
from reference.space import ConformingSpace
from verify.scene import Material

__all__ = ["Vibration", "largest_frequency", "lowest_frequencies"]


@dataclass(frozen=True)
class Vibration:
    """Modes of free vibration.

    Attributes
    ----------
    frequencies : (k,) array
        Angular frequencies ω, ascending, rad/s.
    modes : (k, n, d) array
        At the nodes of the space; of unit mass norm.
    residual : float
        Largest relative residual ‖Kv − ω²Mv‖ / ω²‖Mv‖ of a pair.
    """

    frequencies: NDArray[np.float64]
    modes: NDArray[np.float64]
    residual: float


def lowest_frequencies(
    material: Material, space: ConformingSpace, unknowns: NDArray[np.int32], count: int
) -> Vibration:
    """Find the lowest modes with consistent mass, by shift-and-invert Lanczos around zero.

    Parameters
    ----------
    material : Material
        With a density.
    space : ConformingSpace
    unknowns : (k,) int array
        Scalar unknowns held at rest.
    count : int
        How many modes; a multiple one counts as often as it occurs.

    Raises
    ------
    RuntimeError
        If SLEPc finds fewer.
    """
    stiffness, mass = _matrices(material, space, unknowns)
    # a little below zero, so that a body that nothing holds is no singular matrix
    shift = -1e-6 * _mean_ratio(stiffness, mass)
    return _solve(stiffness, mass, count, space, unknowns, shift)


def largest_frequency(
    material: Material, space: ConformingSpace, unknowns: NDArray[np.int32]
) -> float:
    """Find the largest angular frequency ω with consistent mass, rad/s; 2/ω is a critical step."""
    stiffness, mass = _matrices(material, space, unknowns)
    return float(_solve(stiffness, mass, 1, space, unknowns, None).frequencies[-1])


def _matrices(
    material: Material, space: ConformingSpace, unknowns: NDArray[np.int32]
) -> tuple[Any, Any]:
    """Stiffness and mass; the unknowns held are out of both, but for ones on the diagonal of K."""
    import ufl

    V = space.function_space
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    mass = assembled_matrix(mass_form(material, u, v))
    stiffness = assembled_matrix(stiffness_form(material, u, v))
    rows = space.rows(unknowns)
    stiffness.zeroRowsColumns(rows, 1.0)
    mass.zeroRowsColumns(rows, 0.0)
    return stiffness, mass


def _mean_ratio(stiffness: Any, mass: Any) -> float:
    k, m = stiffness.getDiagonal(), mass.getDiagonal()
    k.array[m.array == 0.0] = 0.0  # held
    return float(k.sum() / m.sum())


def _solve(
    stiffness: Any,
    mass: Any,
    count: int,
    space: ConformingSpace,
    unknowns: NDArray[np.int32],
    shift: float | None,
) -> Vibration:
    from slepc4py import SLEPc

    solver = SLEPc.EPS().create(stiffness.comm)
    solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
    solver.setTolerances(tol=1e-11, max_it=500)
    transform = solver.getST()
    linear = transform.getKSP()
    linear.setType("preonly")
    linear.getPC().setType("cholesky")
    linear.getPC().setFactorSolverType("mumps")
    if shift is None:
        # M must be inverted: ones in place of the unknowns held give eigenvalues 1/1 at most,
        # and K's are scaled out of the way
        mass.zeroRowsColumns(space.rows(unknowns), 1.0)
        stiffness.zeroRowsColumns(space.rows(unknowns), 0.0)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    else:
        transform.setType("sinvert")
        solver.setTarget(shift)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
    solver.setOperators(stiffness, mass)
    solver.setDimensions(nev=count)
    solver.solve()
    found = solver.getConverged()
    if found < count:
        raise RuntimeError(
            f"SLEPc found {found} of {count} modes (reason {solver.getConvergedReason()})"
        )
    values, modes, residuals = [], [], []
    vector, k_v, m_v = (stiffness.createVecRight() for _ in range(3))
    for i in range(count):
        value = float(np.real(solver.getEigenpair(i, vector)))
        stiffness.mult(vector, k_v)
        mass.mult(vector, m_v)
        modes.append(space.everywhere(vector.array))
        modes[-1] /= np.sqrt(vector.dot(m_v))
        k_v.axpy(-value, m_v)
        residuals.append(float(k_v.norm() / (abs(value) * m_v.norm() or 1.0)))
        values.append(value)
    order = np.argsort(values)
    frequencies = np.sqrt(np.maximum(np.array(values)[order], 0.0))
    for entry in (solver, stiffness, mass, vector, k_v, m_v):
        entry.destroy()
    return Vibration(frequencies, np.array(modes)[order], max(residuals))
