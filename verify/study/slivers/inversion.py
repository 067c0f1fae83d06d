"""Corotational motion at large strain: whether slivers turn inside out and energy runs away.

A body held at one face is let go from a sine of 15 % nominal strain.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from verify.study.slivers.bodies import POISSON, SweptBody
from verify.xfem.dynamics import DynamicBody, Integrator, StepFailedError
from verify.xfem.mass import Mass
from verify.xfem.supports import Supports

__all__ = ["Swing", "swing"]

_STRAIN = 0.15
_RUNAWAY = 100.0  # energy over that at the start


@dataclass(frozen=True)
class Swing:
    """What became of the motion.

    Attributes
    ----------
    steps : int
        Taken.
    inverted : int
        Most pieces that were inverted at one instant, of those looked at.
    energy : float
        Largest mechanical energy over that at the start.
    blown_up : bool
        Energy beyond 100 times that at the start, or a step that failed.
    reason : str
        How it ended.
    """

    steps: int
    inverted: int
    energy: float
    blown_up: bool
    reason: str


def swing(
    body: SweptBody,
    mass: Mass,
    scheme_of: Callable[[DynamicBody], Integrator],
    steps: int,
    every: int = 10,
) -> Swing:
    """Let a stretched body swing, and look at it every few steps."""
    virtual = body.virtual
    force = body.force()
    held = virtual.mesh.points[:, 0] < 1e-9
    dynamic = DynamicBody(force, mass, supports=Supports.none(virtual).prescribe(virtual, held))
    state = dynamic.rest()
    state.displacement[:] = _stretched(virtual.node_points)
    start = force.evaluate(state.displacement)[1]
    scheme = scheme_of(dynamic)
    inverted, largest = 0, 1.0
    for step in range(1, steps + 1):
        try:
            with np.errstate(over="ignore", invalid="ignore"):
                scheme.step(state)
        except StepFailedError as failure:
            return Swing(step, inverted, largest, True, str(failure))
        if step % every == 0:
            inverted = max(inverted, len(force.inverted(state.displacement)))
            kinetic = 0.5 * float(np.sum(mass.apply(state.velocity) * state.velocity))
            largest = max(largest, (force.evaluate(state.displacement)[1] + kinetic) / start)
            if not largest < _RUNAWAY:
                text = f"energy {largest:.1e} times that at the start"
                return Swing(step, inverted, largest, True, text)
    return Swing(steps, inverted, largest, False, f"none in {steps} steps")


def _stretched(points: NDArray[np.float64]) -> NDArray[np.float64]:
    along = points[:, 0]
    displacement = np.zeros_like(points)
    displacement[:, 0] = _STRAIN * np.sin(np.pi * along / 2) * 2 / np.pi
    contraction = -POISSON * _STRAIN * np.cos(np.pi * along / 2)
    displacement[:, 1:] = contraction[:, None] * (points[:, 1:] - 0.5)
    displacement[along < 1e-9] = 0.0
    return displacement
