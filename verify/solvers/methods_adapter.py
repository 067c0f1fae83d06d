"""Adapters of the other ways to cut (`verify.methods`): a scene in, a neutral solution out."""

from dataclasses import dataclass
from functools import partial
from inspect import signature
from time import perf_counter
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.methods.catalogue import METHODS
from verify.methods.cut_body import CutBody
from verify.methods.spring_force import SpringForce
from verify.scene import Scene
from verify.solution import Regularisation, Solution
from verify.solvers.xfem_cuts import cuts_of
from verify.solvers.xfem_loads import loads_of
from verify.solvers.xfem_scene import background_mesh, material_of
from verify.solvers.xfem_static import in_load_steps
from verify.solvers.xfem_supports import supports_of
from verify.xfem.corotational import InternalForce
from verify.xfem.corotational_static import NotInEquilibriumError
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.static import solve_static
from verify.xfem.supports import check_bodies

__all__ = [
    "MassSpringSolver",
    "RemovalRefinedSolver",
    "RemovalSolver",
    "SnappingSolver",
    "SnappingSubdivisionSolver",
    "SubdivisionSolver",
    "UncutSolver",
    "VirtualNodeArbitrarySolver",
    "VirtualNodeSolver",
]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Equilibrium:
    """What every way to solve gives."""

    displacement: _Floats
    energy: float
    timings: dict[str, float]
    iterations: dict[str, int]
    changes: dict[str, int]


class _MethodSolver:
    """A method of `verify.methods`: P1 elements, static, linear or corotational.

    Parameters of `solve` are those of the method, and ``load_steps`` of corotational statics
    (0: as few as converge).
    """

    name: ClassVar[str]
    _force: Any = InternalForce

    @property
    def method(self) -> str:
        """Name of the method that cuts."""
        return self.name

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what these adapters do not offer."""
        if scene.analysis.kind == "dynamic":
            return "dynamics is not offered by this adapter yet"
        return None

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(
        self, scene: Scene, level: int, repetitions: int = 1, load_steps: int = 0, **parameters: Any
    ) -> Solution:
        """Solve `scene` on mesh `level`.

        Raises
        ------
        UnsupportedSceneError
            If `refuses` gives a reason.
        InputError
            If a parameter is unknown, a mesh file bad, a support nowhere, a piece not held, or the
            method cannot make the cut.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        if not 0 <= level < self.levels(scene):
            raise InputError(f"mesh level {level}; expected 0..{self.levels(scene) - 1}")
        self._check(parameters)
        try:
            start = perf_counter()
            mesh, size = background_mesh(scene, level)
            meshing = perf_counter() - start
            runs = [
                self._run(scene, mesh, size, load_steps, parameters) for _ in range(1 + repetitions)
            ]
        except (XfemError, NotInEquilibriumError) as error:
            raise InputError(str(error), str(scene.file or scene.name)) from None
        body, result = runs[-1]
        timings = {phase: [run[1].timings[phase] for run in runs[1:]] for phase in result.timings}
        return _solution(self.name, body, result, size, {"meshing": [meshing], **timings})

    def _check(self, parameters: dict[str, Any]) -> None:
        known = list(signature(METHODS[self.method]).parameters)[2:]
        for name in parameters:
            if name not in known:
                text = f"parameter '{name}' of {self.name}"
                raise InputError(f"{text}; expected one of {', '.join([*known, 'load_steps'])}")

    def _run(
        self,
        scene: Scene,
        mesh: SimplexMesh,
        size: float,
        load_steps: int,
        parameters: dict[str, Any],
    ) -> tuple[CutBody, _Equilibrium]:
        """Cut, load, solve: all of it, nothing kept from the run before."""
        mesh = SimplexMesh(mesh.points, mesh.cells)
        body = METHODS[self.method](mesh, cuts_of(scene, size), **parameters)
        start = perf_counter()
        exact = _exact(scene)
        supports = supports_of(scene, body.virtual, exact)
        load = loads_of(scene, body.virtual, exact)
        timings = {**body.seconds, "loading": perf_counter() - start}
        material = body.material(material_of(scene))
        if scene.analysis.kinematics == "linear" and self._force is InternalForce:
            static = solve_static(body.resisting, material, supports, load)
            timings |= static.timings
            return body, _Equilibrium(static.displacement, static.strain_energy, timings, {}, {})
        check_bodies(body.resisting, supports)
        start = perf_counter()
        force = self._force(body.resisting, material, scene.analysis.kinematics)
        found, steps = in_load_steps(
            force,
            supports.fixed,
            lambda share: supports_of(scene, body.virtual, exact, share).values,
            load,
            load_steps,
        )
        timings["solve"] = perf_counter() - start
        iterations = {"newton": sum(found.iterations), "load steps": steps}
        clamped = getattr(force, "clamped", 0)
        changes = {"spring that the fit would make negative left out": clamped}
        return body, _Equilibrium(found.displacement, found.energy, timings, iterations, changes)


class SubdivisionSolver(_MethodSolver):
    """Cut cells split into conforming simplices."""

    name = "subdivision"


class SnappingSolver(_MethodSolver):
    """Nodes moved onto the cut and doubled."""

    name = "snapping"


class SnappingSubdivisionSolver(_MethodSolver):
    """Near nodes snapped, the rest subdivided."""

    name = "snapping_subdivision"


class RemovalSolver(_MethodSolver):
    """Touched cells removed."""

    name = "removal"


class RemovalRefinedSolver(_MethodSolver):
    """Touched cells refined, then removed."""

    name = "removal_refined"


class VirtualNodeSolver(_MethodSolver):
    """Cut cells copied for each part with a node (Molino et al. 2004)."""

    name = "virtual_node"


class VirtualNodeArbitrarySolver(_MethodSolver):
    """Cut cells copied for each part (Sifakis et al. 2007)."""

    name = "virtual_node_arbitrary"


class UncutSolver(_MethodSolver):
    """Finite elements without the cut: the control."""

    name = "uncut"


class MassSpringSolver(_MethodSolver):
    """Springs on the edges of a mesh cut by another method.

    Parameters of `solve`
    ---------------------
    cut : str
        The method that cuts; snapping by default.
    fit : {"fitted", "van_gelder"}
        See `verify.methods.spring_fit`.
    """

    name = "mass_spring"

    def __init__(self) -> None:
        self._cut = "snapping"

    @property
    def method(self) -> str:
        """Name of the method that cuts."""
        return self._cut

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        load_steps: int = 0,
        cut: str = "snapping",
        fit: str = "fitted",
        **parameters: Any,
    ) -> Solution:
        """Solve `scene` on mesh `level`; see `verify.solvers.interface.Solver`."""
        given = (("cut", cut, tuple(METHODS)), ("fit", fit, ("fitted", "van_gelder")))
        for name, value, known in given:
            if value not in known:
                raise InputError(f"{name} '{value}'; expected one of {', '.join(known)}")
        self._cut = cut
        self._force = partial(SpringForce, fit=fit)  # type: ignore[arg-type]
        return super().solve(scene, level, repetitions, load_steps, **parameters)


def _exact(scene: Scene) -> Any:
    """Return the exact solution that supports or loads may be taken from."""
    if scene.exact is None:
        return None
    from reference.exact import exact_solution  # formulas in numpy; no FEniCSx

    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def _solution(
    name: str, body: CutBody, result: _Equilibrium, size: float, timings: dict[str, list[float]]
) -> Solution:
    shown, counts = body.conforming, body.counts
    regularisations = [
        Regularisation(change.kind, change.count, change.size, change.unit)
        for change in body.changes
    ]
    regularisations += [
        Regularisation(kind, count, 0.0, "N/m") for kind, count in result.changes.items() if count
    ]
    return Solution(
        points=shown.points,
        cells=shown.cells,
        displacement=(shown.interpolation @ result.displacement)[None],
        cut_facets=shown.cut_facets,
        ledger={"strain": np.array([result.energy])},
        unknowns=result.displacement.size,
        size=size,
        timings=timings,
        iterations=result.iterations,
        regularisations=regularisations,
        notes={
            "method": name,
            "nodes": f"{counts.nodes_before} before the cut, {counts.nodes} after",
            "elements": f"{counts.elements_before} before the cut, {counts.elements} after",
            "smallest volume fraction": f"{body.smallest_fraction:.3g}",
            "timed": "every phase as listed; first call (compilation) excluded; writing excluded",
        },
    )
