"""The pressure of a mixed solution, which its displacement determines."""

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg

from reference.exact.hooke import Hooke
from reference.fracture.cells import CellGradients, cell_gradients
from verify.solution import Solution

Array = NDArray[np.float64]
MIXED = "displacement and pressure"  # what a solution's note on its unknowns says
_CHUNK = 20_000  # cells


class NodalPressure:
    """Continuous linear pressures, p = λ div u in the mean with every one of them (Taylor–Hood).

    That is the equation by which `reference.elasticity` finds both, so that this is
    the pressure it found, though a solution keeps its displacement only. λ div u itself is off by
    far more where ν is near ½.

    Parameters
    ----------
    solution : Solution
        Quadratic.
    law : Hooke
    step : int
        Which output time; default the last.
    """

    def __init__(self, solution: Solution, law: Hooke, step: int = -1) -> None:
        d = solution.dimension
        corners, self._place = np.unique(solution.cells[:, : d + 1], return_inverse=True)
        self._place = self._place.reshape(-1, d + 1)
        right, measure = np.zeros(len(corners)), np.empty(len(self._place))
        for start in range(0, len(self._place), _CHUNK):
            cells = np.arange(start, min(start + _CHUNK, len(self._place)))
            at = cell_gradients(solution, cells, step)
            divergence = np.trace(at.gradient, axis1=2, axis2=3) * at.weights
            shares = law.lame * divergence @ at.corner_shares
            right += np.bincount(self._place[cells].ravel(), shares.ravel(), len(corners))
            measure[cells] = at.weights.sum(axis=1)
        ones = np.ones((d + 1, d + 1)) + np.eye(d + 1)
        mass = measure[:, None, None] * ones / ((d + 1) * (d + 2))
        rows = np.broadcast_to(self._place[:, :, None], mass.shape)
        matrix = sparse.csr_matrix((mass.ravel(), (rows.ravel(), rows.swapaxes(1, 2).ravel())))
        # a mass in units of its diagonal has a condition number of at most 10: some 30 iterations
        jacobi = sparse.diags_array(1 / matrix.diagonal())
        self._values, failed = cg(matrix, right, rtol=1e-12, maxiter=1000, M=jacobi)
        if failed:
            raise RuntimeError("the pressure of a mixed solution was not found: are cells flat?")

    def stress(self, law: Hooke, cells: NDArray[np.int64], at: CellGradients) -> Array:
        """Stress (m, q, d, d) at the quadrature points of some cells, Pa."""
        deviatoric = Hooke(0.0, law.shear, law.dimension).stress(at.gradient)
        pressure = self._values[self._place[cells]] @ at.corner_shares.T
        return deviatoric + pressure[..., None, None] * np.eye(law.dimension)


def stress_of(
    solution: Solution, law: Hooke, step: int = -1
) -> Callable[[NDArray[np.int64], CellGradients], Array]:
    """Give the stress (m, q, d, d) at points of cells: with a pressure if the solution has one."""
    if solution.notes.get("unknowns") == MIXED:
        return partial(NodalPressure(solution, law, step).stress, law)
    return lambda _cells, at: law.stress(at.gradient)
