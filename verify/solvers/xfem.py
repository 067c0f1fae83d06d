"""Adapter of the compact XFEM solver: a scene in, a neutral solution out.

And how its body is cut on the way.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_of
from verify.accelerated import FAST
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Box, Scene, Skin
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import (
    Opened,
    Openings,
    background_mesh,
    cuts_of,
    errors_of_scene,
    openings_of,
    to_cut,
)
from verify.solvers.boundary_conditions import motion_of_supports, supports_of
from verify.solvers.interface import check_choices, refused_contact
from verify.solvers.motion_of_scene import CutMotion, Fade, Integration, OpeningBody
from verify.solvers.runs import OPENINGS, Record, check_steps, repeated
from verify.solvers.xfem_system import (
    MASSES,
    SCHEMES,
    elasticity_of,
    joined,
    mass_for,
    mass_of,
    penalised,
    solution_on,
    solve_equilibrium,
    system_of,
    treated,
)
from verify.system import System
from verify.xfem.arrays import XfemError
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.internal_force import InternalForce
from verify.xfem.linear_solvers import PLAIN
from verify.xfem.mass import Mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, cut_mesh
from verify.xfem.release import inherit_state
from verify.xfem.slivers import join_fragments

_Floats = NDArray[np.float64]
_KERNELS = {"fast": FAST, "plain": PLAIN}
_CHOICES: Mapping[str, Collection[str]] = {
    "tip": ("inside", "extended", "through", "nearest", "partial"),
    "slivers": ("keep", "merge", "drop", "penalise"),
    "scheme": SCHEMES,
    "mass": MASSES,
    "kernels": _KERNELS,
    "opening": OPENINGS,
}


@dataclass(frozen=True)
class _Parameters:
    """The parameters of a solve, as `XfemSolver` describes them, with their defaults.

    Raises
    ------
    InputError
        If one has a value that it cannot have.
    """

    tip: str | None = None
    slivers: str = "keep"
    load_steps: int = 0
    scheme: str = "newmark"
    mass: str | None = None
    step_factor: float = 0.9
    spectral_radius: float = 0.8
    step: float | None = None
    kernels: str = "fast"
    opening: str | None = None

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in _CHOICES if getattr(self, name) is not None}
        check_choices(XfemSolver.name, _CHOICES, given)
        check_steps(self.load_steps, self.step_factor)
        self.integration()  # it checks its own

    def on(self, scene: Scene, mesh: SimplexMesh) -> Self:
        """Return them with the default tip rule of a scene and its mesh, unless one was asked."""
        # a last facet that bends to its node would bear a load that is not in balance with others
        loaded = any(load.kind == "cut_faces" for load in scene.loads)
        default = "extended" if mesh.dim == 3 or loaded else "partial"
        return self if self.tip else replace(self, tip=default)

    @property
    def inertia(self) -> str:
        """Name of the mass of a motion: the one that was asked for, or that suits the scheme."""
        return self.mass or mass_for(self.scheme, self.slivers)

    def integration(self) -> Integration:
        """Return the options of the time integration."""
        return Integration(self.scheme, self.step_factor, self.spectral_radius, self.step)


@dataclass(eq=False)
class XfemOpening(OpeningBody):
    """A scene on a mesh that is cut, as `verify.solvers.motion_of_scene.OpeningBody`.

    Parameters
    ----------
    scene : Scene
    mesh : SimplexMesh
    openings : Openings
    exact : object or None
        The exact solution that supports may be taken from.
    given : _Parameters
    """

    scene: Scene
    mesh: SimplexMesh
    openings: Openings
    exact: Any
    given: _Parameters

    phase = "enrichment"

    def __post_init__(self) -> None:
        self.mass, self.rule = self.given.inertia, OPENINGS[self.openings.rule]
        self._to_cut = to_cut(self.mesh, self.openings.cuts, self.given.tip)
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
            self.given.slivers,
            lambda body: motion_of_supports(self.scene, body, self.exact).fixed,
        )
        return phantom

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a cut mesh, with the penalty if there is to be one."""
        kinematics, penalise = self.scene.analysis.kinematics, self.given.slivers == "penalise"
        kernels = _KERNELS[self.given.kernels]
        force, ghost = elasticity_of(self.scene, phantom, kinematics, penalise, kernels)
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

    def fading(self, new: PhantomMesh) -> Fade | None:
        """Return the factors of the forces at dof nodes that are released."""
        return self._opened.fade(new.node_parent)

    def regularisations(self) -> list[Regularisation]:
        """Return what was done to ends of cuts and to slivers."""
        return [*self._to_cut.done, *self._slivers, *self._penalised]


class XfemSolver:
    """The compact solver `verify.xfem`: P1 simplices in 2D, in 3D and as membranes.

    Statics in linear and in corotational kinematics, and motion, with cuts that open on the way.

    Parameters of `solve`
    ---------------------
    tip : {"inside", "extended", "through", "nearest", "partial"}
        What happens to an element in which a cut ends: see `verify.xfem.pieces.split_cells`; the
        last, for triangles and their default, divides it so that the end is a node
        (`verify.methods.tip_nodes`). The default of tetrahedra, and where faces of a cut bear a
        load, is "extended".
    slivers : {"keep", "merge", "drop", "penalise"}
        What happens to pieces with less than a tenth of their element; see
        `verify.xfem.slivers`; "merge" is cell aggregation. A direct static solve does not mind
        them, so they are kept. The last is a ghost penalty, of linear statics and of motion with
        the side-wise mass.
    load_steps : int
        Corotational statics: equal parts in which supports and loads grow, halved where the energy
        asks for it; 0: one.
    scheme : str
        Dynamics: time integration, "newmark", "implicit_euler", "energy_momentum",
        "generalised_alpha", "central_differences", "symplectic_euler", "forward_euler", or
        "real_time": implicit Euler with one linearisation and the side-wise mass, the step of
        `verify play`.
    step : float
        Dynamics: largest time step, s, instead of the scene's; 1/60 is a frame of `verify play`.
    spectral_radius : float
        Dynamics: spectral radius of generalised_alpha at infinite frequency, from 0 to 1.
    mass : {"sidewise", "consistent", "evs", "gevs", "row_sum", "hrz", "thesis"}
        Dynamics: "consistent" by default, "sidewise" for explicit schemes and a ghost penalty. The
        last three are the lumpings of the thesis; EVS and GEVS raise eigenvalues of the consistent
        mass of cut cells, see `verify.methods.mass_variants`. A `system` has the side-wise one.
    step_factor : float
        Dynamics: share of the critical step that an explicit scheme takes at most, and an
        implicit one if the scene states no time step.
    opening : {"late", "swept"}
        Dynamics: when a blade opens an element, when it has passed all of it, or ahead of it
        against forces that fade (docs/theory/dynamics.md); by default as the scene says.
    kernels : {"fast", "plain"}
        Operations of `verify.accelerated`, or those that `verify.xfem` does alone.
    """

    name = "xfem"
    contact = ("static", "dynamic", "finite_rotation")
    choices = _CHOICES
    parameters = tuple(one.name for one in fields(_Parameters))

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what `verify.xfem` does not do through this adapter."""
        if isinstance(scene.geometry, Skin):
            return "the geometry 'skin' is played (verify play), not solved"
        if isinstance(scene.geometry, Box) and scene.mesh.pattern == "unstructured":
            return "boxes are meshed in a structured way only; give a mesh file for another mesh"
        return refused_contact(self, scene)

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(self, scene: Scene, level: int, repetitions: int = 1, **parameters: Any) -> Solution:
        """Solve `scene` on mesh `level`.

        Raises
        ------
        UnsupportedSceneError
            If `refuses` gives a reason, or the parameters do not suit the scene.
        InputError
            If a parameter has a value that it cannot have, a mesh file is bad, a support nowhere,
            or a piece not held.
        NotInEquilibriumError, StepFailedError
            If a Newton iteration does not converge, or a motion blows up.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        given, exact = _Parameters(**parameters), exact_of(scene)
        if given.slivers == "penalise":
            _check_penalty(scene, given.inertia)
        with errors_of_scene(scene):
            return repeated(
                repetitions, lambda: background_mesh(scene, level),
                lambda made, trial: _run(scene, made, exact, given, trial),
            )  # fmt: skip

    def system(self, scene: Scene, level: int, **parameters: Any) -> System:
        """Return stiffness, mass and supports of `scene` on mesh `level`; all cuts are open.

        Raises
        ------
        UnsupportedSceneError, InputError
            As of `solve`.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        given, exact = _Parameters(**parameters), exact_of(scene)
        with errors_of_scene(scene):
            mesh, size = background_mesh(scene, level)
            phantom, _ = _cut(scene, mesh, size, exact, given.on(scene, mesh))
            resisting = elasticity_of(scene, phantom, "linear", given.slivers == "penalise")
            return system_of(scene, phantom, *resisting, exact, given.mass or "sidewise")


def _cut(
    scene: Scene, mesh: SimplexMesh, size: float, exact: Any, given: _Parameters
) -> tuple[PhantomMesh, list[Regularisation]]:
    """Cut the mesh and treat its slivers; report what was moved, joined and treated."""

    def held(body: PhantomMesh) -> NDArray[np.bool_]:
        return supports_of(scene, body, exact).fixed

    asked = to_cut(mesh, cuts_of(scene, size), given.tip)
    phantom = cut_mesh(asked.mesh, asked.cuts, asked.rule)
    phantom, fragments = join_fragments(phantom, supports_of(scene, phantom, exact))
    phantom, slivers = treated(phantom, given.slivers, held)
    return phantom, [*slivers, *asked.done, joined(fragments)]


def _check_penalty(scene: Scene, mass: str) -> None:
    """Refuse a ghost penalty where the library has none."""
    static = scene.analysis.kind == "static"
    if static and scene.analysis.kinematics != "linear":
        raise UnsupportedSceneError("slivers = 'penalise' in statics is for linear kinematics")
    if not static and mass != "sidewise":
        raise UnsupportedSceneError("slivers = 'penalise' in motion is for the sidewise mass")


def _run(
    scene: Scene, made: tuple[SimplexMesh, float], exact: Any, given: _Parameters, trial: bool
) -> Solution:
    """Cut, load, solve."""
    mesh, size = made
    given = given.on(scene, mesh)
    said = {"method": "P1 XFEM, element-wise cut", "tip": str(given.tip), "slivers": given.slivers}
    record = Record(notes=said)
    if scene.analysis.kind == "dynamic":
        openings = openings_of(scene, size, given.opening or scene.analysis.opening)
        opening = XfemOpening(scene, mesh, openings, exact, given)
        motion = CutMotion(scene, opening, given.integration(), exact, record)
        return solution_on(scene, record, *motion.run(trial), size)
    with record.timed("enrichment"):
        phantom, record.regularisations = _cut(scene, mesh, size, exact, given)
    fields = solve_equilibrium(
        scene, phantom, exact, record, load_steps=given.load_steps,
        penalise=given.slivers == "penalise", kernels=_KERNELS[given.kernels],
    )  # fmt: skip
    return solution_on(scene, record, phantom, fields, size)
