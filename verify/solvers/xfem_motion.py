"""A moving body that XFEM cuts again whenever its cuts open further."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import Scene
from verify.solution import Regularisation
from verify.solvers.cuts_of_scene import to_cut
from verify.solvers.motion_of_scene import Fade
from verify.solvers.openings_of_scene import Opened, Openings
from verify.solvers.supports_of_scene import motion_of_supports
from verify.solvers.xfem_answer import penalised, treated
from verify.solvers.xfem_system import elasticity_of, mass_of
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.errors import XfemError
from verify.xfem.inherit import ancestors, inherit_state
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import Kernels
from verify.xfem.mass import Mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, cut_mesh

_Floats = NDArray[np.float64]


RULES = {
    "late": "elements as a whole, when the blade has crossed them through",
    "swept": "elements ahead of the blade, held by forces that fade with what it has swept",
}


@dataclass(frozen=True)
class Cutting:
    """How XFEM cuts a body and what it makes of it: parameters of the solver."""

    tip: str
    slivers: str
    mass: str
    kernels: Kernels


class XfemOpening:
    """A scene on a mesh that is cut, as `verify.solvers.motion_of_scene.OpeningBody`.

    Parameters
    ----------
    scene : Scene
    mesh : SimplexMesh
    openings : Openings
    exact : object or None
        The exact solution that supports may be taken from.
    cutting : Cutting
    """

    removal = False
    phase = "enrichment"

    def __init__(
        self, scene: Scene, mesh: SimplexMesh, openings: Openings, exact: Any, cutting: Cutting
    ) -> None:
        self.scene, self.openings, self.exact = scene, openings, exact
        self.cutting, self.mass = cutting, cutting.mass
        self.rule = RULES[openings.rule]
        self._to_cut = to_cut(mesh, openings.cuts, cutting.tip)
        self._opened: Opened
        self._slivers: list[Regularisation] = []
        self._penalised: list[Regularisation] = []

    def events(self) -> _Floats:
        """Return the times at which something opens, s."""
        mesh, cuts, rule, _ = self._to_cut
        self._opened = self.openings.of_cells(cut_mesh(mesh, cuts, rule))
        return self._opened.events()

    def at(self, time: float, passed: bool = False) -> PhantomMesh:
        """Cut the mesh where the cuts have opened it at a time, and treat its slivers."""
        mesh, cuts, rule, _ = self._to_cut
        phantom = cut_mesh(mesh, cuts, rule, self._opened.until(time, passed))
        phantom, self._slivers = treated(
            phantom,
            self.cutting.slivers,
            lambda body: motion_of_supports(self.scene, body, self.exact).fixed,
        )
        return phantom

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a cut mesh, with the penalty if there is to be one."""
        cutting = self.cutting
        kinematics, penalise = self.scene.analysis.kinematics, cutting.slivers == "penalise"
        force, ghost = elasticity_of(self.scene, phantom, kinematics, penalise, cutting.kernels)
        self._penalised = penalised(ghost)
        return force, mass_of(self.scene, phantom, self.mass, ghost)

    def inherited(self, old: PhantomMesh, state: MotionState, further: DynamicBody) -> MotionState:
        """Hand a state on to the body that is cut further.

        Raises
        ------
        InputError
            If it cannot be handed on.
        """
        try:
            return inherit_state(old, further.force.phantom, state, further)
        except XfemError as error:
            raise InputError(
                f"the state at {state.time:g} s cannot be handed on to the body that is cut "
                f"further ({error}); slivers = 'keep' may help"
            ) from None

    def source(self, old: PhantomMesh, new: PhantomMesh) -> NDArray[np.int64]:
        """Corner of an old body from which each corner of one that is cut further comes."""
        return ancestors(old, new)

    def fading(self, new: PhantomMesh) -> Fade | None:
        """Return the factors of the forces at dof nodes that are released."""
        return self._opened.fade(new.node_parent)

    def regularisations(self) -> list[Regularisation]:
        """Return what was done to ends of cuts and to slivers."""
        return [*self._to_cut.done, *self._slivers, *self._penalised]
