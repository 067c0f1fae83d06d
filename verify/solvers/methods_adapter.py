"""Adapters of the other ways to cut (`verify.methods`): a scene in, a neutral solution out."""

from collections.abc import Collection, Mapping
from functools import partial
from inspect import signature
from typing import Any

from reference.exact import exact_of
from verify.accelerated import FAST
from verify.errors import InputError, UnsupportedSceneError
from verify.methods import METHODS
from verify.methods.cut_body import CutBody
from verify.methods.springs import SpringForce
from verify.scene import Scene
from verify.scene.strict import nearest
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import (
    background_mesh,
    density_of,
    errors_of_scene,
    material_of,
)
from verify.solvers.interface import check_choices
from verify.solvers.motion_of_scene import CutMotion, Integration
from verify.solvers.opening_bodies import MethodOpening
from verify.solvers.openings_of_scene import cuts_of, openings_of
from verify.solvers.runs import Record, check_steps, repeated
from verify.solvers.timeline import OPENINGS, timeline_of
from verify.solvers.xfem import XfemSolver
from verify.solvers.xfem_answer import Law, solution_on, solve_equilibrium, springs_left_out
from verify.solvers.xfem_system import EXPLICIT, SCHEMES, elasticity_of, system_of
from verify.system import System
from verify.xfem.internal_force import InternalForce
from verify.xfem.mass import Mass, side_wise_mass
from verify.xfem.mesh import SimplexMesh

_SHEETS = ("subdivision", "removal", "virtual_node", "virtual_node_arbitrary", "uncut")


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
        Those of the method, in `verify.methods`.
    """

    choices: Mapping[str, Collection[str]] = {"scheme": SCHEMES, "opening": OPENINGS}
    _law: Law = InternalForce

    def __init__(self, name: str) -> None:
        self.name = name
        self._method = name  # that cuts

    @property
    def parameters(self) -> Collection[str]:
        """Names of those of the method, beside those that `solve` names."""
        return _parameters_of(self._method)

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what ``xfem`` refuses, and what no changed mesh can do."""
        if reason := XfemSolver().refuses(scene):
            return reason
        if scene.material.thickness is not None and self.name not in _SHEETS:
            return f"membranes in space are not offered by {self.name}"
        return None

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

        def run(mesh: tuple[SimplexMesh, float], trial: bool) -> Solution:
            if scene.analysis.kind == "dynamic":
                return self._moved(scene, *mesh, integration, rule, parameters, trial)
            return self._at_rest(scene, *mesh, load_steps, parameters)

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
        self,
        scene: Scene,
        mesh: SimplexMesh,
        size: float,
        integration: Integration,
        rule: str,
        parameters: dict[str, Any],
        trial: bool,
    ) -> Solution:
        """Cut, load, move."""
        record = Record()
        forces: list[InternalForce] = []

        def inertia(body: CutBody) -> tuple[InternalForce, Mass]:
            material, kinematics = (
                material_of(scene, body.resisting.mesh),
                scene.analysis.kinematics,
            )
            forces.append(self._law(body.resisting, material, kinematics, kernels=FAST))
            return forces[-1], side_wise_mass(body.phantom, density_of(scene, body.phantom.mesh))

        timeline = timeline_of(scene, kinks=False)
        openings = openings_of(scene, size, timeline, rule)
        opening = MethodOpening(self._method, parameters, inertia, mesh, openings)
        motion = CutMotion(scene, timeline, opening, integration, exact_of(scene), record)
        phantom, fields = motion.run(trial)
        record.regularisations.append(springs_left_out(forces[-1]))
        self._say(record, opening.final)
        return solution_on(scene, record, phantom, fields, size, opening.final.conforming)

    def _at_rest(
        self,
        scene: Scene,
        mesh: SimplexMesh,
        size: float,
        load_steps: int,
        parameters: dict[str, Any],
    ) -> Solution:
        """Cut, load, solve."""
        body = METHODS[self._method](mesh, cuts_of(scene, size), **parameters)
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

    def __init__(self) -> None:
        super().__init__("mass_spring")

    @property
    def parameters(self) -> Collection[str]:
        """Names of those of `MethodSolver` and of all methods, of which one cuts."""
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
        if scene.analysis.kind == "dynamic" and scheme in (*EXPLICIT, "energy_momentum"):
            raise UnsupportedSceneError(
                f"{scheme} of springs: their critical step is not that of the elements, and they "
                "have no stress; expected newmark, implicit_euler or generalised_alpha"
            )


def _parameters_of(method: str) -> list[str]:
    """Names of the parameters of a method after mesh and cuts."""
    _, _, *offered = signature(METHODS[method]).parameters.values()
    return [one.name for one in offered if one.kind is not one.KEYWORD_ONLY]
