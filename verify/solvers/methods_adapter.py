"""Adapters of the other ways to cut (`verify.methods`): a scene in, a neutral solution out.

And how their bodies are cut on the way.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import partial
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_of
from verify.accelerated import FAST
from verify.errors import InputError, UnsupportedSceneError
from verify.methods import METHODS
from verify.methods.cut_body import CutBody, Seams, make_body, seams_of, welded
from verify.methods.springs import SpringForce
from verify.scene import Scene
from verify.scene.strict import nearest
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import (
    Opened,
    Openings,
    background_mesh,
    cuts_of,
    errors_of_scene,
    material_of,
    openings_of,
)
from verify.solvers.interface import check_choices, refused_contact
from verify.solvers.motion_of_scene import CutMotion, Fade, Integration, OpeningBody
from verify.solvers.runs import OPENINGS, Record, check_steps, repeated
from verify.solvers.xfem import XfemSolver
from verify.solvers.xfem_system import (
    EXPLICIT,
    SCHEMES,
    Law,
    elasticity_of,
    mass_for,
    mass_of,
    solution_on,
    solve_equilibrium,
    springs_left_out,
    system_of,
)
from verify.system import System
from verify.xfem.arrays import XfemError
from verify.xfem.body import DynamicBody, MotionState
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh
from verify.xfem.release import ancestors

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Made = tuple[SimplexMesh, float]  # a mesh, and the size of its elements in m
_Given = dict[str, Any]
_SHEETS = ("subdivision", "removal", "virtual_node", "virtual_node_arbitrary", "uncut")
_WELDED = ("subdivision", "snapping", "snapping_subdivision")
_WITH_FACES = (*_WELDED, "virtual_node", "virtual_node_arbitrary")
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


@dataclass(eq=False)
class MethodOpening(OpeningBody):
    """A body cut by one of the methods, as `verify.solvers.motion_of_scene.OpeningBody`.

    Virtual nodes and removal cut again at every opening, what the cuts have opened by then. A
    mesh that is prepared for the whole cut is welded at first, and opens facet by facet.

    Parameters
    ----------
    method : str
        One of `METHODS`.
    parameters : dict
        Its own.
    inertia_of : callable
        Internal force and mass of a cut body.
    mesh : SimplexMesh
    openings : Openings
    mass : str
        One of `MASSES`.

    Attributes
    ----------
    final : CutBody
        With all cuts open; made by `events`.
    """

    method: str
    parameters: _Given
    inertia_of: Callable[[CutBody], tuple[InternalForce, Mass]]
    mesh: SimplexMesh
    openings: Openings
    mass: str
    final: CutBody = field(init=False)

    phase = "cutting"

    def __post_init__(self) -> None:
        self.removal = self.method.startswith("removal")
        self.rule = _RULES.get(self.method, OPENINGS[self.openings.rule])
        self._bodies: dict[int, CutBody] = {}  # by the identity of their mesh
        self._seams: Seams | None = None
        self._place: _Ints
        self._opened = Opened(np.empty(0), np.empty(0), None)

    def events(self) -> _Floats:
        """Return the times at which something opens, s."""
        self.final = self._kept_body(self._made(np.inf))
        if self.method in _WELDED:
            self._seams = seams_of(self.final.phantom)
            _, place = np.unique(self.final.phantom.node_points, axis=0, return_inverse=True)
            self._place = place.ravel()
            at = self._place[self._seams.one]
            self._opened = self.openings.of_seams(self._seams.points, at)
        return self._opened.events()

    def at(self, time: float, passed: bool = False) -> PhantomMesh:
        """Return the body with the cuts that are open at a time, or that blades have passed."""
        if self._seams is not None:
            closed = ~self._opened.until(time, passed)
            if not closed.any():
                return self.final.phantom
            phantom = welded(self.final.phantom, self._seams, closed)
            shown, origin = self.final.conforming, self.final.cell_origin
            body = make_body(self.mesh, phantom, conforming=shown, cell_origin=origin)
            return self._kept_body(body).phantom
        all_open = self._opened.until(np.inf, passed)
        if self.method == "uncut" or (self._opened.until(time, passed) == all_open).all():
            return self.final.phantom
        return self._kept_body(self._made(time, passed)).phantom

    def inertia(self, phantom: PhantomMesh) -> tuple[InternalForce, Mass]:
        """Return elasticity and mass of a body that `at` has returned."""
        return self.inertia_of(self._bodies[id(phantom)])

    def inherited(self, old: PhantomMesh, state: MotionState, further: DynamicBody) -> MotionState:
        """Hand a state on to the body that is cut further."""
        source = self.source(old, further.force.phantom)
        return MotionState(state.displacement[source], state.velocity[source], state.time)

    def source(self, old: PhantomMesh, new: PhantomMesh) -> _Ints:
        """Find dof node (N,) of an old body from which each of a new one comes, cell by cell."""
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
            return super().parting(new, nodes, parent)
        own = np.zeros(self.final.phantom.node_count, dtype=np.int64)
        own[self.final.phantom.cells] = new.cells
        was = np.full(new.node_count, -1)
        was[nodes] = parent
        one, other = own[self._seams.one], own[self._seams.other]
        seam, corner = np.nonzero((one != other) & (was[one] == was[other]) & (was[one] >= 0))
        cut = np.full(new.node_count, len(self.openings.asked))
        np.minimum.at(cut, was[one[seam, corner]], self._opened.cut[seam])
        return cut[parent]

    def _made(self, time: float, passed: bool = False) -> CutBody:
        """Make the body that the method cuts by the cuts as they are at a time."""
        given = (self.mesh, self.openings.cuts)
        if self.method in (*_WELDED, "uncut"):
            return METHODS[self.method](*given, **self.parameters)

        def opened(cut: PhantomMesh) -> NDArray[np.bool_]:
            self._opened = self.openings.of_cells(cut)
            return self._opened.until(time, passed)

        return METHODS[self.method](*given, **self.parameters, opened=opened)

    def _kept_body(self, body: CutBody) -> CutBody:
        self._bodies[id(body.phantom)] = body
        return body


class MethodSolver:
    """A method of `verify.methods` on P1 elements: statics and motion, linear and corotational.

    Parameters
    ----------
    name : str
        One of `verify.methods.METHODS`.

    Parameters of `solve`
    ---------------------
    load_steps : int
        Corotational statics: as of the solver ``xfem``.
    scheme : str
        Dynamics: as of the solver ``xfem``.
    step_factor, spectral_radius : float
    opening : {"late", "swept"}
        Dynamics: as of the solver ``xfem``; cells that are removed are so late.
    further parameters
        Parameters of the method, in `verify.methods`.
    """

    choices: Mapping[str, Collection[str]] = {"scheme": SCHEMES, "opening": OPENINGS}
    _law: Law = InternalForce
    _mass: str | None = None  # by the scheme

    def __init__(self, name: str) -> None:
        self.name = name
        self._method = name  # that cuts

    @property
    def parameters(self) -> Collection[str]:
        """List the parameters of the method, beside the ones that `solve` names."""
        return _parameters_of(self._method)

    @property
    def contact(self) -> Collection[str]:
        """Analyses with contact of the faces of cuts, if the method leaves two of them."""
        return XfemSolver.contact if self.name in _WITH_FACES else ()

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what ``xfem`` refuses, and what no changed mesh can do."""
        if reason := XfemSolver().refuses(scene):
            return reason
        if scene.material.thickness is not None and self.name not in _SHEETS:
            return f"membranes in space are not offered by {self.name}"
        return refused_contact(self, scene)

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        load_steps: int = 0,
        scheme: str = "newmark",
        step_factor: float = 0.9,
        spectral_radius: float = 0.8,
        opening: str | None = None,
        **parameters: Any,
    ) -> Solution:
        """Solve `scene` on mesh `level`.

        Raises
        ------
        UnsupportedSceneError
            If `refuses` gives a reason.
        InputError
            If a parameter is unknown, a mesh file bad, a support nowhere, a piece not held, or the
            method cannot make the cut.
        NotInEquilibriumError, StepFailedError
            If a Newton iteration does not converge, or a motion blows up.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        rule = opening or scene.analysis.opening
        check_choices(self.name, self.choices, {"scheme": scheme, "opening": rule})
        if self._method.startswith("removal"):
            if opening not in (None, "late"):
                raise InputError("cells are removed behind the blade; expected opening = 'late'")
            rule = "late"
        check_steps(load_steps, step_factor)
        self._check(scene, scheme, parameters)
        integration = Integration(scheme, step_factor, spectral_radius)

        def run(made: _Made, trial: bool) -> Solution:
            if scene.analysis.kind == "dynamic":
                return self._moved(scene, made, integration, rule, parameters, trial)
            return self._at_rest(scene, made, load_steps, parameters)

        with errors_of_scene(scene):
            return repeated(repetitions, lambda: background_mesh(scene, level), run)

    def system(self, scene: Scene, level: int, **parameters: Any) -> System:
        """Return stiffness, mass and supports of `scene` on mesh `level`; all cuts are open.

        Raises
        ------
        UnsupportedSceneError, InputError
            As of `solve`.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        taken = _parameters_of(self._method)
        own = {name: value for name, value in parameters.items() if name in taken}
        with errors_of_scene(scene):
            mesh, size = background_mesh(scene, level)
            body = METHODS[self._method](mesh, cuts_of(scene, size), **own)
            resisting = elasticity_of(scene, body.resisting, "linear")
            return system_of(scene, body.phantom, *resisting, exact_of(scene))

    def _check(self, scene: Scene, scheme: str, parameters: dict[str, Any]) -> None:
        for name in parameters:
            if name not in (known := _parameters_of(self._method)):
                raise InputError(f"{self._method} has no parameter '{name}'{nearest(name, known)}")
        if scene.analysis.kind == "dynamic" and parameters.get("weights") == "whole":
            raise UnsupportedSceneError(
                "copies that resist as whole cells, with the mass of their share, have no "
                "critical step; expected weights = 'share'"
            )

    def _moved(
        self, scene: Scene, made: _Made, how: Integration, rule: str, given: _Given, trial: bool
    ) -> Solution:
        """Cut, load, move."""
        record, (mesh, size) = Record(), made
        forces: list[InternalForce] = []
        mass = self._mass or mass_for(how.scheme)

        def inertia(body: CutBody) -> tuple[InternalForce, Mass]:
            material = material_of(scene, body.resisting.mesh)
            law = self._law(body.resisting, material, scene.analysis.kinematics, kernels=FAST)
            forces.append(law)
            return forces[-1], mass_of(scene, body.phantom, mass, None)

        openings = openings_of(scene, size, rule)
        opening = MethodOpening(self._method, given, inertia, mesh, openings, mass)
        motion = CutMotion(scene, opening, how, exact_of(scene), record)
        phantom, fields = motion.run(trial)
        record.regularisations.append(springs_left_out(forces[-1]))
        self._say(record, opening.final)
        return solution_on(scene, record, phantom, fields, size, opening.final.conforming)

    def _at_rest(self, scene: Scene, made: _Made, load_steps: int, given: _Given) -> Solution:
        """Cut, load, solve."""
        mesh, size = made
        body = METHODS[self._method](mesh, cuts_of(scene, size), **given)
        record = Record(timings=dict(body.seconds))
        fields = solve_equilibrium(
            scene, body.phantom, exact_of(scene), record, resisting=body.resisting, law=self._law,
            load_steps=load_steps,
        )  # fmt: skip
        self._say(record, body)
        return solution_on(scene, record, body.phantom, fields, size, body.conforming)

    def _say(self, record: Record, body: CutBody) -> None:
        """Record what the method made of the mesh."""
        counts = body.counts
        record.regularisations += [Regularisation(**vars(change)) for change in body.changes]
        record.notes |= {
            "method": self.name,
            "nodes": f"{counts.nodes_before} before the cut, {counts.nodes} after",
            "elements": f"{counts.elements_before} before the cut, {counts.elements} after",
            "smallest volume fraction": f"{body.smallest_fraction:.3g}",
        }


class MassSpringSolver(MethodSolver):
    """Springs on the edges of a mesh cut by another method.

    Parameters of `solve`
    ---------------------
    cut : str
        The method that cuts; snapping by default.
    fit : {"fitted", "van_gelder"}
        See `verify.methods.springs`.
    """

    choices: Mapping[str, Collection[str]] = {
        "scheme": SCHEMES, "opening": OPENINGS, "cut": METHODS, "fit": ("fitted", "van_gelder"),
    }  # fmt: skip

    _mass = "sidewise"  # springs have their masses at nodes

    def __init__(self) -> None:
        super().__init__("mass_spring")

    @property
    def parameters(self) -> Collection[str]:
        """List the parameters of `MethodSolver` and of all methods, of which one cuts."""
        common = list(signature(MethodSolver.solve).parameters)[4:-1]
        return {*common, *(name for method in METHODS for name in _parameters_of(method))}

    def solve(  # type: ignore[override]
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        cut: str = "snapping",
        fit: str = "fitted",
        **parameters: Any,
    ) -> Solution:
        """Solve `scene` on mesh `level`; see `verify.solvers.interface.Solver`."""
        check_choices(self.name, self.choices, {"cut": cut, "fit": fit})
        self._method = cut
        self._law = partial(SpringForce, fit=fit)  # type: ignore[arg-type]
        return super().solve(scene, level, repetitions, **parameters)

    def system(self, scene: Scene, level: int, **parameters: Any) -> System:
        """Refuse: springs have no linear system of their own here."""
        raise UnsupportedSceneError("springs have no stiffness of elements")

    def _check(self, scene: Scene, scheme: str, parameters: dict[str, Any]) -> None:
        super()._check(scene, scheme, parameters)
        if scene.material.model != "hooke":
            raise UnsupportedSceneError(f"springs are no '{scene.material.model}' material")
        if scene.analysis.kind == "dynamic" and scheme in (*EXPLICIT, "energy_momentum"):
            raise UnsupportedSceneError(
                f"{scheme} of springs: their critical step is not that of the elements, and they "
                "have no stress; expected newmark, implicit_euler or generalised_alpha"
            )


def _parameters_of(method: str) -> list[str]:
    """Find names of the parameters of a method after mesh and cuts."""
    _, _, *offered = signature(METHODS[method]).parameters.values()
    return [one.name for one in offered if one.kind is not one.KEYWORD_ONLY]
