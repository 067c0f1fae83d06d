"""Implicit Euler for membranes, one linear solve per step, implicit in their tension as well.

The stiffness with frozen rotations knows nothing of what holds a taut membrane across its plane;
`RealTimeEuler` treats that explicitly, and with steps beyond twice the time that a transverse wave
takes across an element it feeds the motion. Here tension enters on the left-hand side.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.dynamics.body import DynamicBody, MotionState
from verify.xfem.dynamics.integrator import StepForces
from verify.xfem.dynamics.linear_solver import LinearSolver
from verify.xfem.dynamics.real_time import RealTimeEuler
from verify.xfem.dynamics.tension_kernels import add_tension, tension, tension_product
from verify.xfem.errors import XfemError

__all__ = ["TautEuler"]


class TautEuler(RealTimeEuler):
    """As `RealTimeEuler`, for a membrane.

    Parameters
    ----------
    body : DynamicBody
    step_size : float
        In seconds.
    solver : LinearSolver, optional

    Raises
    ------
    XfemError
        If the body is no membrane.
    """

    def __init__(
        self, body: DynamicBody, step_size: float, solver: LinearSolver | None = None
    ) -> None:
        super().__init__(body, step_size, solver)
        virtual = body.force.virtual
        if virtual.mesh.dim == virtual.mesh.space:
            raise XfemError("a solid is no membrane; expected RealTimeEuler")
        self._pairs = np.empty((len(virtual.cells), 3, 3))
        self._across = np.empty((len(virtual.cells), 3))
        self._points: NDArray[np.float64] = virtual.node_points

    def linearise(self, state: MotionState) -> None:
        """Write M + hC + h²K into `blocks` and the right-hand side into `load`, with tension."""
        super().linearise(state)
        force, h = self.body.force, self.step_size
        cells = force.virtual.cells
        tension(
            cells, *force.geometry, force.rotations, state.displacement, self._points,
            self._pairs, self._across,
        )  # fmt: skip
        add_tension(self._pairs, self._across, self.body.pattern.targets, h * h, self.blocks)
        tension_product(self._pairs, self._across, cells, state.velocity, -h * h, self.load)

    def step(self, state: MotionState) -> StepForces:
        """Advance by one step."""
        forces = super().step(state)
        cells = self.body.force.virtual.cells
        tension_product(
            self._pairs, self._across, cells, state.velocity, self.step_size, forces.internal
        )
        return forces
