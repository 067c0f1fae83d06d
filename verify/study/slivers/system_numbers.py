"""Condition number and critical explicit step of a small linear system, to round-off.

Slivers of ε = 1e-12 make the raw condition number 1e24: its smallest eigenvalue comes from the
inverse of the matrix scaled by its diagonal, whose own condition number is small.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.system import System

__all__ = ["CONDITION", "SCALED", "STEP", "condition_numbers", "critical_step"]

CONDITION, SCALED = "condition number", "condition number scaled by the diagonal"
STEP = "critical explicit step"

_TRUSTED = 1e13  # condition number up to which the smallest eigenvalue has two digits and more
_LEAST_MASS = 1e-13  # eigenvalue of the scaled mass: below, its inverse has no three digits
_LARGEST = 6000  # unknowns of a dense matrix
_Floats = NDArray[np.float64]


def condition_numbers(system: System) -> tuple[float, float]:
    """λ_max/λ_min of the stiffness on the free unknowns, raw and scaled by its diagonal.

    Raises
    ------
    InputError
        If scaling leaves the matrix singular to round-off, or it is too large for a dense one.
    """
    stiffness = _free(system.stiffness, system)
    diagonal = np.diag(stiffness)
    if not (diagonal > 0.0).all():
        raise InputError("an unknown without stiffness: the matrix is singular")
    scale = 1.0 / np.sqrt(diagonal)
    scaled = scale[:, None] * stiffness * scale
    least, *_, largest = np.linalg.eigvalsh(scaled)
    if not least * _TRUSTED > largest:
        raise InputError(
            f"condition number above {_TRUSTED:.0e} after scaling by the diagonal: what depends on "
            "the smallest eigenvalue is round-off"
        )
    inverse = scale[:, None] * np.linalg.inv(scaled) * scale
    raw = np.linalg.eigvalsh(stiffness)[-1] * np.linalg.eigvalsh(0.5 * (inverse + inverse.T))[-1]
    return float(raw), float(largest / least)


def critical_step(system: System) -> float:
    """Largest stable step 2/ω_max of central differences on the free unknowns, s.

    Raises
    ------
    InputError
        If there is no mass, or it is singular to round-off (that of a strip much thinner than
        its elements, if it is not lumped).
    """
    if system.mass is None:
        raise InputError("the scene states no density")
    stiffness, mass = _free(system.stiffness, system), _free(system.mass, system)
    diagonal = np.diag(mass)
    if not (diagonal > 0.0).all():
        raise InputError("an unknown without mass: every step is too large")
    scale = 1.0 / np.sqrt(diagonal)
    mass, stiffness = (scale[:, None] * one * scale for one in (mass, stiffness))
    if np.linalg.eigvalsh(mass)[0] < _LEAST_MASS:
        raise InputError(
            f"mass singular to round-off, though scaled: least eigenvalue below {_LEAST_MASS:.0e}"
        )
    factor = np.linalg.inv(np.linalg.cholesky(mass))
    return float(2.0 / np.sqrt(np.linalg.eigvalsh(factor @ stiffness @ factor.T)[-1]))


def _free(matrix: Any, system: System) -> _Floats:
    free = np.flatnonzero(~system.fixed)
    if not len(free):
        raise InputError("every unknown is held")
    if len(free) > _LARGEST:
        raise InputError(f"{len(free)} free unknowns; at most {_LARGEST} for a dense matrix")
    dense: _Floats = matrix[free][:, free].toarray()
    return 0.5 * (dense + dense.T)
