"""Base of every integrator: a step that changes a state and says which forces it has used.

Each scheme advances M (v₁ − v₀) = h (f_ext − f_int − f_visc + reactions) with forces of its own
choice, or balances them with an inertia of its own. Knowing them, the energy ledger closes for any
scheme without knowing which one it was.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from verify.xfem.dynamics.body import MotionState
from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import check_floats

__all__ = ["Integrator", "StepFailedError", "StepForces", "check_state", "check_step"]

_Floats = NDArray[np.float64]


class StepFailedError(RuntimeError):
    """A step whose equation was not solved, or whose result is not finite."""


@dataclass(frozen=True)
class StepForces:
    """Forces (N, d) that a step has put into the balance of momentum, in newtons.

    Attributes
    ----------
    internal, external, viscous : (N, d) float array
    inertia : (N, d) float array, optional
        What the step has balanced with them, where that is not M (v₁ − v₀)/h.
    """

    internal: _Floats
    external: _Floats
    viscous: _Floats
    inertia: _Floats | None = None


class Integrator(Protocol):
    """A time integration scheme for one body and one step size."""

    step_size: float

    def step(self, state: MotionState) -> StepForces:
        """Advance the state in place by one step.

        Raises
        ------
        StepFailedError
            If the step's equation was not solved or the result is not finite; the state is then
            left as it was.
        """
        ...


def check_step(step_size: float) -> float:
    """Return the step size, if it is one.

    Raises
    ------
    XfemError
        If it is not positive and finite.
    """
    if not (np.isfinite(step_size) and step_size > 0.0):
        raise XfemError(f"time step {step_size!r} s; expected positive and finite")
    return float(step_size)


def check_state(state: MotionState, shape: tuple[int, int]) -> None:
    """Check that a state fits a body, before a step is spoilt by broadcasting.

    Raises
    ------
    XfemError
        If it does not.
    """
    for name, value in (("displacement", state.displacement), ("velocity", state.velocity)):
        check_floats(name, value, shape)
    if not np.isfinite(state.time):
        raise XfemError(f"time {state.time!r} s of a state; expected finite")
