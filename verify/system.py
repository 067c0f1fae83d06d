"""The linear system of a scene on one mesh level, which a solver may hand over, and its numbers.

Condition number, critical explicit step and lowest frequency. Slivers of ε = 1e-12 make the raw
condition number 1e24: its smallest eigenvalue comes from the inverse of the matrix scaled by its
diagonal, whose own condition number is small.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array, issparse
from scipy.sparse.linalg import LinearOperator, cg, eigsh, splu

from verify.errors import InputError
from verify.scene import Scene


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


CONDITION, SCALED = "condition number", "condition number scaled by the diagonal"
STEP = "critical explicit step"
FREQUENCY = "lowest natural frequency"
ITERATIONS = "iterations of conjugate gradients"

_TRUSTED = 1e13  # condition number up to which the smallest eigenvalue has two digits and more
_LEAST_MASS = 1e-13  # eigenvalue of the scaled mass: below, its inverse has no three digits
_LARGEST = 6000  # unknowns of a dense matrix
_DENSE = 500  # unknowns up to which all eigenvalues cost less than a Lanczos iteration
_LANCZOS = 1e-8  # relative tolerance of an eigenvalue
_RESIDUAL = 1e-8  # at which conjugate gradients end, of the load
_MOST_ITERATIONS = 10  # for each unknown; exact arithmetic needs one
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

    By a Lanczos iteration where the unknowns are many; the mass is scaled to a unit diagonal
    before, because mass and stiffness of slivers go to zero together.

    Raises
    ------
    InputError
        If there is no mass, or it is singular to round-off: the consistent mass of a strip much
        thinner than its elements.
    """
    mass, stiffness = _scaled("mass", system, "every step is too large")
    lumped = np.abs((mass - diags_array(mass.diagonal())).data).max(initial=0.0) == 0.0
    if mass.shape[0] > _DENSE:
        largest = _largest_eigenvalue(stiffness, None if lumped else mass)
    else:
        dense = mass.toarray()
        _check_mass(float(np.linalg.eigvalsh(dense)[0]))
        factor = np.linalg.inv(np.linalg.cholesky(dense))
        largest = float(np.linalg.eigvalsh(factor @ stiffness.toarray() @ factor.T)[-1])
    if not largest > 0.0:
        raise InputError("nothing resists: no step is critical")
    return float(2.0 / np.sqrt(largest))


def lowest_frequency(system: System) -> float:
    """Lowest natural frequency ω/2π of the free unknowns, 1/s.

    What a mass that is not the body's own shifts first.

    Raises
    ------
    InputError
        If there is no mass, an unknown without one, or a part that nothing holds.
    """
    stiffness, mass = _scaled("stiffness", system, "the matrix is singular")
    try:
        inverse = LinearOperator(stiffness.shape, splu(stiffness).solve)
    except RuntimeError:
        raise InputError("a part that nothing holds: its lowest frequency is 0") from None
    # M x = μ K x: the largest μ belongs to the lowest frequency
    largest = _largest(mass, M=stiffness, Minv=inverse)
    return float(1.0 / (2.0 * np.pi * np.sqrt(largest)))


def gradient_iterations(system: System) -> int:
    """Count the iterations of conjugate gradients under a uniform body force, M·1.

    Preconditioned by the diagonal, to a residual of 1e-8 of the load in the norm of the
    preconditioner: what condition number and spectrum cost together.

    Raises
    ------
    InputError
        If there is no mass, an unknown without stiffness, or no convergence.
    """
    stiffness, mass = _scaled("stiffness", system, "the matrix is singular")
    scale = np.sqrt(csr_array(system.stiffness).diagonal()[_unknowns(system)])
    most, count = _MOST_ITERATIONS * len(scale), 0

    def counted(_: Any) -> None:
        nonlocal count
        count += 1

    given: dict[str, Any] = {"rtol": _RESIDUAL, "maxiter": most, "callback": counted}
    if cg(stiffness, mass @ scale, **given)[1]:
        raise InputError(f"conjugate gradients do not converge in {most} iterations")
    return count


def _scaled(by: Literal["mass", "stiffness"], system: System, so: str) -> list[csc_array]:
    """Scale mass and stiffness of the free unknowns to a unit diagonal of one, which is first."""
    if system.mass is None:
        raise InputError("the scene states no density")
    free = _unknowns(system)
    pair = [csc_array(one)[free][:, free] for one in (system.mass, system.stiffness)]
    if by == "stiffness":
        pair.reverse()
    diagonal = pair[0].diagonal()
    if not (diagonal > 0.0).all():
        raise InputError(f"an unknown without {by}: {so}")
    scale = diags_array(1.0 / np.sqrt(diagonal))
    return [csc_array(scale @ one @ scale) for one in pair]


def _largest(matrix: Any, tol: float = _LANCZOS, **given: Any) -> float:
    """Largest eigenvalue by a Lanczos iteration."""
    start = np.random.default_rng(0).standard_normal(matrix.shape[0])
    common: dict[str, Any] = {"k": 1, "which": "LA", "return_eigenvectors": False, "v0": start}
    return float(eigsh(matrix, tol=tol, **common, **given)[0])


def _largest_eigenvalue(stiffness: csc_array, mass: csc_array | None) -> float:
    """Of K x = λ M x, by a Lanczos iteration; M is the identity where it is not given."""
    if mass is None:
        return _largest(stiffness)
    try:
        inverse = LinearOperator(mass.shape, splu(mass).solve)
    except RuntimeError:
        _check_mass(0.0)
        raise
    _check_mass(1.0 / _largest(inverse, tol=0.1))
    return _largest(stiffness, M=mass, Minv=inverse)


def _check_mass(least: float) -> None:
    if least < _LEAST_MASS:
        raise InputError(
            f"mass singular to round-off, though scaled: least eigenvalue below {_LEAST_MASS:.0e}"
        )


def _unknowns(system: System) -> NDArray[np.int64]:
    free = np.flatnonzero(~system.fixed)
    if not len(free):
        raise InputError("every unknown is held")
    return free


def _free(matrix: Any, system: System) -> _Floats:
    free = _unknowns(system)
    if len(free) > _LARGEST:
        raise InputError(f"{len(free)} free unknowns; at most {_LARGEST} for a dense matrix")
    dense: _Floats = matrix[free][:, free].toarray()
    return 0.5 * (dense + dense.T)


def with_uncut_twin(
    system: Any, scene: Scene, level: int, parameters: Mapping[str, Any]
) -> tuple[System, System]:
    """Return the systems of a scene and of its uncut body, as the hook `system` of a solver gives.

    Raises
    ------
    UnsupportedSceneError, InputError
        If the solver refuses one of them, or hands over no system.
    """
    whole = scene.model_copy(update={"cuts": [], "quantities": [], "acceptance": []})
    own, uncut = (checked_system(system(one, level, **parameters)) for one in (scene, whole))
    return own, uncut
