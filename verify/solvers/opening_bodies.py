"""Bodies that XFEM or another way to cut parts further as time goes on."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.methods import METHODS
from verify.methods.cut_body import CutBody, Seams, make_body, seams_of, welded
from verify.scene import Scene
from verify.solution import Regularisation
from verify.solvers.motion_of_scene import Fade
from verify.solvers.openings_of_scene import Opened, Openings, to_cut
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
from verify.xfem.release import parting_cuts

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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

    def source(self, old: PhantomMesh, new: PhantomMesh) -> _Ints:
        """Corner of an old body from which each corner of one that is cut further comes."""
        return ancestors(old, new)

    def fading(self, new: PhantomMesh) -> Fade | None:
        """Return the factors of the forces at dof nodes that are released."""
        return self._opened.fade(new.node_parent)

    def parting(self, new: PhantomMesh, nodes: _Ints, parent: _Ints) -> _Ints:
        """Cut that has parted each of some dof nodes, by the dof node that they were."""
        return parting_cuts(new, nodes, parent)

    def regularisations(self) -> list[Regularisation]:
        """Return what was done to ends of cuts and to slivers."""
        return [*self._to_cut.done, *self._slivers, *self._penalised]


_Bools = NDArray[np.bool_]

_WELDED = ("subdivision", "snapping", "snapping_subdivision")
_RULES = {
    **dict.fromkeys(
        _WELDED,
        "facets of the finished mesh, made before the start, when the blade has passed them",
    ),
    **dict.fromkeys(
        ("removal", "removal_refined"), "cells are removed when the blade has crossed them through"
    ),
    "uncut": "never",
}


class MethodOpening:
    """A body cut by one of the methods, as `verify.solvers.motion_of_scene.OpeningBody`.

    Virtual nodes and removal cut again at every opening, what the cuts have opened by then. A
    mesh that is prepared for the whole cut is welded at first, and opens facet by facet.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    parameters : dict
        Its own.
    inertia : callable
        Internal force and mass of a cut body.
    mesh : SimplexMesh
    openings : Openings

    Attributes
    ----------
    final : CutBody
        With all cuts open; made by `events`.
    """

    final: CutBody
    mass = "sidewise"
    phase = "cutting"

    def __init__(
        self,
        method: str,
        parameters: dict[str, Any],
        inertia: Callable[[CutBody], tuple[InternalForce, Mass]],
        mesh: SimplexMesh,
        openings: Openings,
    ) -> None:
        self.removal = method.startswith("removal")
        self.rule = _RULES.get(method, RULES[openings.rule])
        self.mesh, self.openings = mesh, openings
        self._method, self._parameters, self._inertia = method, parameters, inertia
        self._bodies: dict[int, CutBody] = {}  # by the identity of their mesh
        self._seams: Seams | None = None
        self._place: _Ints
        self._opened = Opened(np.empty(0), np.empty(0), None)

    def events(self) -> _Floats:
        """Return the times at which something opens, s."""
        self.final = self._kept_body(self._made(np.inf))
        if self._method in _WELDED:
            self._seams = seams_of(self.final.phantom)
            _, place = np.unique(self.final.phantom.node_points, axis=0, return_inverse=True)
            self._place = place.ravel()
            at = self._place[self._seams.one]
            self._opened = self.openings.of_seams(self._seams.points, at)
        return self._opened.events()

    def at(self, time: float, passed: bool = False) -> PhantomMesh:
        """Return the body as far as it is open at a time, or as far as blades have passed it."""
        if self._seams is not None:
            closed = ~self._opened.until(time, passed)
            if not closed.any():
                return self.final.phantom
            phantom = welded(self.final.phantom, self._seams, closed)
            shown, origin = self.final.conforming, self.final.cell_origin
            body = make_body(self.mesh, phantom, conforming=shown, cell_origin=origin)
            return self._kept_body(body).phantom
        all_open = self._opened.until(np.inf, passed)
        if self._method == "uncut" or (self._opened.until(time, passed) == all_open).all():
            return self.final.phantom
        return self._kept_body(self._made(time, passed)).phantom

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a body that `at` has returned."""
        return self._inertia(self._bodies[id(phantom)])

    def inherited(self, old: PhantomMesh, state: MotionState, further: DynamicBody) -> MotionState:
        """Hand a state on to the body that is cut further."""
        source = self.source(old, further.force.phantom)
        return MotionState(state.displacement[source], state.velocity[source], state.time)

    def source(self, old: PhantomMesh, new: PhantomMesh) -> _Ints:
        """Dof node (N,) of an old body from which each of a new one comes, cell by cell."""
        if old is new:
            return np.arange(new.node_count)
        if self._seams is None and self._bodies[id(new)].cell_number is None:
            return ancestors(old, new)
        before, after = (self._bodies[id(one)].cell_number for one in (old, new))
        place = np.arange(len(new.cells))
        if before is not None and after is not None:
            place = np.searchsorted(before, after)
            if not np.array_equal(before[np.minimum(place, len(before) - 1)], after):
                raise XfemError("a cell that was removed as debris is there again later")
        source = np.zeros(new.node_count, dtype=np.int64)
        source[new.cells] = old.cells[place]
        return source

    def fading(self, new: PhantomMesh) -> Fade | None:
        """Return the factors of the forces at dof nodes that are released."""
        place = new.node_parent
        if self._seams is not None:
            place = np.empty(new.node_count, dtype=np.int64)
            place[new.cells] = self._place[self.final.phantom.cells]
        return self._opened.fade(place)

    def parting(self, new: PhantomMesh, nodes: _Ints, parent: _Ints) -> _Ints:
        """Cut that has parted each of some dof nodes, by the dof node that they were.

        Of several seams at once it is the first cut of theirs.
        """
        if self._seams is None or self._opened.cut is None:
            return parting_cuts(new, nodes, parent)
        own = np.zeros(self.final.phantom.node_count, dtype=np.int64)
        own[self.final.phantom.cells] = new.cells
        was = np.full(new.node_count, -1)
        was[nodes] = parent
        one, other = own[self._seams.one], own[self._seams.other]
        seam, corner = np.nonzero((one != other) & (was[one] == was[other]) & (was[one] >= 0))
        cut = np.full(new.node_count, len(self.openings.asked))
        np.minimum.at(cut, was[one[seam, corner]], self._opened.cut[seam])
        return cut[parent]

    def regularisations(self) -> list[Regularisation]:
        """Return nothing: what a method changed is said by its body."""
        return []

    def _made(self, time: float, passed: bool = False) -> CutBody:
        """Make the body that the method cuts as far as the cuts have come at a time."""
        given = (self.mesh, self.openings.cuts)
        if self._method in (*_WELDED, "uncut"):
            return METHODS[self._method](*given, **self._parameters)

        def opened(cut: PhantomMesh) -> _Bools:
            self._opened = self.openings.of_cells(cut)
            return self._opened.until(time, passed)

        return METHODS[self._method](*given, **self._parameters, opened=opened)

    def _kept_body(self, body: CutBody) -> CutBody:
        self._bodies[id(body.phantom)] = body
        return body
