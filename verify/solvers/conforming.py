"""Adapters of the FEniCSx side: conforming elements at equal h, and the reference itself."""

from collections.abc import Callable
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.boundary_values import constrained_values
from reference.dolfinx_versions import import_dolfinx
from reference.elasticity import load_form, solve_linear
from reference.exact import exact_solution
from reference.large_strain import solve_large_strain
from reference.meshing import ConformingMesh
from reference.space import ConformingSpace, conforming_space
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene
from verify.solution import Solution
from verify.solvers.conforming_meshes import not_imprinted, peer_mesh, reference_mesh, structure

__all__ = ["ConformingSolver", "ReferenceSolver"]

import_dolfinx()  # fail here, by name, and not in the middle of a solve


def _refusal(scene: Scene) -> str | None:
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        if geometry.cells == "surface":
            return "membranes are not offered by the reference yet"
        if reason := not_imprinted(scene):
            return reason
    elif not isinstance(geometry, Rectangle | Polygon | Box):
        return f"conforming meshes of a '{geometry.kind}' geometry are not offered yet"
    if scene.analysis.kind == "dynamic":
        return "dynamics is not offered by the reference yet"
    if scene.dimension == 3 and scene.analysis.kinematics != "linear":
        return "finite rotations in space are not offered by the reference yet"
    return None


class _Equilibrium(NamedTuple):
    """What every way to solve gives: displacement (n, 2), energy, seconds, iterations, notes."""

    displacement: NDArray[np.float64]
    strain_energy: float
    timings: dict[str, float]
    iterations: dict[str, int]
    notes: dict[str, str]


class ConformingSolver:
    """P1 (or P2) elements on a mesh that conforms to the cut, at the mesh size of the scene.

    Parameters of `solve`
    ---------------------
    degree : {1, 2}
        Polynomial order.
    mesh : {"imprinted", "remeshed"}
        Imprinted: the scene's own background mesh, of which only the cells that the cut
        touches are split; it differs from what an unfitted method works on by the cut cells
        alone. Remeshed: gmsh meshes the cut body anew, with the same mean cell area. Neither is
        graded.
    """

    name = "conforming"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what `reference` does not do yet."""
        return _refusal(scene)

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        degree: int = 1,
        mesh: str = "imprinted",
    ) -> Solution:
        """Solve `scene` on mesh `level`; see `verify.solvers.interface.Solver`."""
        if mesh not in ("imprinted", "remeshed") or degree not in (1, 2):
            raise InputError(
                f"mesh '{mesh}', degree {degree}; expected imprinted or remeshed, 1 or 2"
            )

        size = structure(scene, level).size
        return _solve(
            scene, lambda level: (peer_mesh(scene, level, mesh), size), level, degree, repetitions
        )


class ReferenceSolver:
    """Elements of the degree that the scene asks for, graded to every singular point.

    A reference is timed once, whatever `repetitions` says: it judges and does not compete.
    """

    name = "reference"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what `reference` does not do yet."""
        return _refusal(scene)

    def levels(self, scene: Scene) -> int:
        """Return the number of levels of the reference."""
        return scene.reference.levels

    def solve(self, scene: Scene, level: int, repetitions: int = 1) -> Solution:
        """Solve `scene` on reference level `level`; each halves all element sizes."""
        return _solve(
            scene,
            lambda level: reference_mesh(scene, level),
            level,
            scene.reference.degree,
            min(repetitions, 1),
        )


def _solve(
    scene: Scene,
    make_mesh: Callable[[int], tuple[ConformingMesh, float]],
    level: int,
    degree: int,
    repetitions: int,
) -> Solution:
    if reason := _refusal(scene):
        raise UnsupportedSceneError(reason)
    exact = None
    if scene.exact is not None:
        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    timings: dict[str, list[float]] = {}
    if repetitions:  # a pass on the coarsest mesh compiles the forms and is not timed
        _equilibrium(scene, conforming_space(make_mesh(0)[0], degree), exact)
    for _ in range(max(repetitions, 1)):
        start = perf_counter()
        mesh, size = make_mesh(level)
        space = conforming_space(mesh, degree)
        meshed = perf_counter() - start
        result = _equilibrium(scene, space, exact)
        if repetitions:
            for phase, seconds in {"meshing": meshed, **result.timings}.items():
                timings.setdefault(phase, []).append(seconds)
    return _solution(mesh, space, result, size, timings)


def _equilibrium(scene: Scene, space: ConformingSpace, exact: Any) -> _Equilibrium:
    """Solve a scene by its kinematics."""
    if scene.analysis.kinematics == "linear":
        linear = solve_linear(scene, space, exact)
        return _Equilibrium(
            linear.displacement,
            linear.strain_energy,
            linear.timings,
            {"cg": linear.answer.iterations} if linear.answer.iterations else {},
            {
                "linear solver": linear.answer.method,
                "round-off": f"{linear.answer.round_off:.1e}",
                "residual": f"{linear.answer.residual:.1e}",
            },
        )
    unknowns, _ = constrained_values(scene, space, exact)
    finite = solve_large_strain(
        scene.material,
        space,
        unknowns,
        lambda factor: constrained_values(scene, space, exact, factor)[1],
        lambda v: load_form(scene, space, v, exact),
    )
    return _Equilibrium(
        finite.displacement,
        finite.strain_energy,
        finite.timings,
        {"newton": finite.iterations, "load steps": finite.steps},
        {
            "linear solver": "PETSc SNES, MUMPS Cholesky",
            "smallest det F": f"{finite.smallest_jacobian:.3g}",
            "area inside out": f"{finite.inverted:.1e}",
            "steps taken again": "; ".join(finite.refused_steps) or "none",
        },
    )


def _solution(
    mesh: ConformingMesh,
    space: ConformingSpace,
    result: _Equilibrium,
    size: float,
    timings: dict[str, list[float]],
) -> Solution:
    return Solution(
        points=space.node_points,
        cells=space.cell_nodes,
        displacement=result.displacement[None],
        order=space.degree,
        cut_facets=mesh.realised_cut,
        cell_sides=mesh.pieces,
        ledger={"strain": np.array([result.strain_energy])},
        unknowns=result.displacement.size,
        size=size,
        timings=timings,
        iterations=result.iterations,
        notes={"element": f"P{space.degree}", "cells": str(len(mesh.cells)), **result.notes},
    )
