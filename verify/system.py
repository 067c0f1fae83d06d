"""The linear system of a scene on one mesh level, which a solver may hand over."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, issparse

from verify.errors import InputError


@dataclass(frozen=True)
class System:
    """Stiffness and mass of a body at rest, and which of its unknowns the supports hold.

    Attributes
    ----------
    stiffness : (n, n) scipy sparse array
        Of the undeformed body, without supports, N/m (per metre of thickness in the plane).
    mass : (n, n) scipy sparse array, optional
        As the solver steps with it (lumped or not), kg; None where the scene states no density.
    fixed : (n,) bool array
        Unknowns that the supports of the scene prescribe.
    """

    stiffness: csr_array
    mass: csr_array | None
    fixed: NDArray[np.bool_]


def checked_system(given: Any) -> System:
    """Return what `system` of a solver handed over.

    Raises
    ------
    InputError
        If it is no `System`, or its parts do not fit together or are not finite and symmetric.
    """
    if not isinstance(given, System):
        raise InputError(f"system() gave {type(given).__name__}; expected a verify.system.System")
    fixed = np.asarray(given.fixed)
    n = len(fixed) if fixed.ndim == 1 else -1
    if fixed.dtype != bool or n < 1:
        raise InputError(f"system.fixed of shape {fixed.shape}; expected one bool per unknown")
    checked: dict[str, Any] = {}
    for name in ("stiffness", "mass"):
        matrix = getattr(given, name)
        if matrix is None and name == "mass":
            checked[name] = None
            continue
        if not issparse(matrix) or matrix.shape != (n, n):
            text = f"system.{name} is no sparse array of {n} × {n}, one row per unknown"
            raise InputError(text)
        matrix = csr_array(matrix)
        largest = np.abs(matrix.data).max(initial=0.0)
        if not np.isfinite(largest):
            raise InputError(f"system.{name} has an entry that is not finite")
        if np.abs((matrix - matrix.T).data).max(initial=0.0) > 1e-9 * largest:
            raise InputError(f"system.{name} is not symmetric")
        checked[name] = matrix
    return System(checked["stiffness"], checked["mass"], fixed)
