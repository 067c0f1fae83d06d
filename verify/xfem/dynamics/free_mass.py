"""Mass of what supports leave free: accelerations of given forces."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import SuperLU, splu

from verify.xfem.dynamics.body import DynamicBody

__all__ = ["FreeMass", "couples_supports"]

_Floats = NDArray[np.float64]


class FreeMass:
    """The mass of a body without rows and columns of held components.

    Parameters
    ----------
    body : DynamicBody
    """

    def __init__(self, body: DynamicBody) -> None:
        self._body = body
        self._solvers: list[SuperLU] | None = None
        if body.mass.diagonal is None and body.fixed.any():
            self._solvers = [_supported(body, k) for k in range(body.shape[1])]

    def solve(self, forces: _Floats) -> _Floats:
        """Accelerations (N, d) of forces (N, d), zero where held; writes on the forces."""
        forces[self._body.fixed] = 0.0
        if self._solvers is None:
            return self._body.mass.solve(forces)
        columns = [solver.solve(forces[:, k]) for k, solver in enumerate(self._solvers)]
        return np.stack(columns, axis=1)


def couples_supports(body: DynamicBody) -> bool:
    """Whether an acceleration of held components moves free ones through the mass."""
    if body.mass.diagonal is not None:
        return False
    rows, columns, _ = body.mass.entries
    return bool((body.fixed[rows] & ~body.fixed[columns]).any())


def _supported(body: DynamicBody, component: int) -> SuperLU:
    """Factor of the mass of the free nodes in one component."""
    free = diags_array((~body.fixed[:, component]).astype(float))
    held = diags_array(body.fixed[:, component].astype(float))
    return splu(csc_array(free @ body.mass.matrix @ free + held))
