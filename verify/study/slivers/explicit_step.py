"""The critical explicit step of a body with slivers: estimated, and found by running."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.study.slivers.bodies import DENSITY, SweptBody
from verify.study.slivers.conditioning import stiffness_matrix
from verify.xfem.critical_step import critical_step
from verify.xfem.dynamics import CentralDifferences, DynamicBody, Integrator, StepFailedError
from verify.xfem.errors import XfemError
from verify.xfem.mass import Mass, consistent_mass, side_wise_mass
from verify.xfem.mass_shifted import shifted_mass
from verify.xfem.virtual import VirtualMesh

__all__ = [
    "LUMPINGS",
    "Course",
    "course",
    "estimated_step",
    "linear_course",
    "mass_of",
    "step_by_running",
]

LUMPINGS: dict[str, Callable[[VirtualMesh, float], Mass]] = {
    "side-wise": side_wise_mass,
    "thesis": lambda virtual, density: shifted_mass(virtual, density, "enrichment"),
    "consistent": consistent_mass,
    "row sum": lambda virtual, density: shifted_mass(virtual, density, "row sum"),
    "HRZ": lambda virtual, density: shifted_mass(virtual, density, "weighted diagonal"),
}

_BLOWN_UP = 1e6  # kinetic energy over that at the start: beyond any exchange with strain energy
_BISECTIONS = 8
_BRACKET = (0.55, 1.9)  # times the guess, so that no middle falls on the guess itself
_LEAST_MASS = 1e-13  # eigenvalue of the scaled mass: below, its inverse has no three digits
_RUN = 400  # steps: 0.5 % beyond the critical step a mode grows by e^(0.2 · 400)


@dataclass(frozen=True)
class Course:
    """How a run went.

    Attributes
    ----------
    steps : int
        Taken until it ended or blew up.
    time : float
        In s.
    blown_up : bool
    reason : str
    """

    steps: int
    time: float
    blown_up: bool
    reason: str


def mass_of(body: SweptBody, lumping: str, with_ghost: bool = True) -> Mass:
    """Mass of a body, with the counterpart of its ghost penalty if wanted.

    Raises
    ------
    XfemError
        If the lumping is not defined on this body.
    """
    mass = LUMPINGS[lumping](body.virtual, DENSITY)
    if body.ghost is not None and with_ghost:
        return body.ghost.mass(mass, DENSITY)
    return mass


def estimated_step(body: SweptBody, mass: Mass) -> float:
    """2/ω_max of the free body, in s.

    Raises
    ------
    XfemError
        If the mass is singular to round-off: that of a strip which is much thinner than its
        elements, if it is not lumped.
    """
    if mass.diagonal is None and mass.root is None:
        scale = 1.0 / np.sqrt(mass.matrix.diagonal())
        least = np.linalg.eigvalsh(scale[:, None] * mass.matrix.toarray() * scale)[0]
        if least < _LEAST_MASS:
            raise XfemError(
                "mass singular to round-off, though scaled: its least eigenvalue is below "
                f"{_LEAST_MASS:.0e}"
            )
    return critical_step(stiffness_matrix(body), mass)


def _linear(body: SweptBody, mass: Mass) -> DynamicBody:
    return DynamicBody(body.force("linear"), mass)


def course(integrator: Integrator, dynamic: DynamicBody, steps: int) -> Course:
    """Let a free body go with random velocities, and see whether its energy explodes."""
    state = dynamic.rest()
    state.velocity[:] = 1e-3 * np.random.default_rng(5).normal(size=dynamic.shape)
    start = _kinetic(dynamic.mass, state.velocity)
    for step in range(1, steps + 1):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                integrator.step(state)
                energy = _kinetic(dynamic.mass, state.velocity)
        except StepFailedError as failure:
            return Course(step, step * integrator.step_size, True, str(failure))
        if not energy < _BLOWN_UP * start:
            text = f"kinetic energy {energy / start:.1e} times that at the start"
            return Course(step, state.time, True, text)
    return Course(steps, state.time, False, f"none in {steps} steps")


def _kinetic(mass: Mass, velocity: NDArray[np.float64]) -> float:
    return 0.5 * float(np.sum(velocity * mass.apply(velocity)))


def step_by_running(body: SweptBody, mass: Mass, guess: float) -> tuple[float, float]:
    """Find the largest stable step by bisection of linear runs of central differences.

    Parameters
    ----------
    guess : float
        In s; the bisection starts between 0.55 and 1.9 times it. What is found does not depend
        on it if it lies inside.

    Returns
    -------
    low, high : float
        Largest step seen stable and smallest seen unstable, in s.

    Raises
    ------
    ValueError
        If the stable step does not lie between 0.55 and 1.9 times the guess.
    """
    dynamic = _linear(body, mass)

    def stable(step: float) -> bool:
        return not course(CentralDifferences(dynamic, step), dynamic, _RUN).blown_up

    low, high = (share * guess for share in _BRACKET)
    if not stable(low) or stable(high):
        raise ValueError(f"stable step outside {low:.3g}…{high:.3g} s")
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low, high


def linear_course(body: SweptBody, mass: Mass, step: float, steps: int) -> Course:
    """Run central differences on the linear body with a step in s."""
    dynamic = _linear(body, mass)
    return course(CentralDifferences(dynamic, step), dynamic, steps)
