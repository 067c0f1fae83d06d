"""Motion of a body that another way to cut has cut, from the start of a scene."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.methods.cut_body import CutBody
from verify.scene import Equilibrium, Scene, ToolPathCut
from verify.solvers.xfem_answer import Answer
from verify.solvers.xfem_motion import MotionChoice, Mover
from verify.xfem.corotation import InternalForce
from verify.xfem.mesh import SimplexMesh
from verify.xfem.virtual import VirtualMesh

__all__ = ["MethodMover", "refuses_motion"]


def refuses_motion(scene: Scene) -> str | None:
    """Why a dynamic scene cannot be done by a method that changes the mesh, if it cannot."""
    if any(isinstance(cut, ToolPathCut) or cut.opens_at > 0.0 for cut in scene.cuts):
        return "cuts that open later are not offered: nothing inherits a state from another mesh"
    if scene.cuts and isinstance(scene.initial, Equilibrium):
        return "an equilibrium with closed cuts is not offered: the mesh has them open"
    return None


class MethodMover(Mover):
    """Motion of a cut body.

    Parameters
    ----------
    body : CutBody
    law : callable
        Internal force of a virtual mesh.
    scene, mesh, size, exact, choice
        As of `Mover`.
    """

    def __init__(
        self,
        body: CutBody,
        law: Callable[[VirtualMesh], InternalForce],
        scene: Scene,
        mesh: SimplexMesh,
        size: float,
        exact: Any,
        choice: MotionChoice,
    ) -> None:
        super().__init__(scene, mesh, size, exact, choice)
        self._cut_body, self._internal_force = body, law

    def run(self, trial: bool) -> Answer:
        """Run from the first to the last output time; `trial` stops after one step."""
        answer = super().run(trial)
        answer.timings.update(self._cut_body.seconds)
        del answer.timings["enrichment"]
        return answer

    def _events(self) -> NDArray[np.float64]:
        return np.empty(0)

    def _cut(self, time: float) -> VirtualMesh:
        return self._cut_body.virtual

    def _law(self, virtual: VirtualMesh) -> InternalForce:
        return self._internal_force(self._cut_body.resisting)
