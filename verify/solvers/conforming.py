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
from reference.meshing import (
    ConformingMesh,
    Grading,
    background_mesh,
    conforming_mesh,
    imprint,
    open_cut,
    singular_points,
    structured_triangles,
)
from reference.space import ConformingSpace, conforming_space
from verify.errors import InputError, UnsupportedSceneError
from verify.scene import ArcCut, Polygon, PolylineCut, Rectangle, Scene
from verify.solution import Solution

__all__ = ["ConformingSolver", "ReferenceSolver"]

import_dolfinx()  # fail here, by name, and not in the middle of a solve


def _refusal(scene: Scene) -> str | None:
    if not isinstance(scene.geometry, Rectangle | Polygon):
        return f"conforming meshes of a '{scene.geometry.kind}' geometry are not offered yet"
    if scene.analysis.kind == "dynamic":
        return "dynamics is not offered by the reference yet"
    if scene.analysis.kinematics == "corotational" and any(
        quantity.kind == "strain_energy" for quantity in scene.quantities
    ):
        return (
            "strain energies at finite rotation are not compared yet; ask for displacements and "
            "openings in [[quantities]]"
        )
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

        def make(level: int) -> ConformingMesh:
            counts, size = _structure(scene, level)
            if mesh == "remeshed" or any(isinstance(cut, ArcCut) for cut in scene.cuts):
                # equal mean area: a square is two triangles, equilateral ones of `edge`
                edge = size if counts is None else size * np.sqrt(2 / np.sqrt(3))
                return conforming_mesh(scene, Grading(edge, np.zeros((0, 2))))
            return _imprinted(scene, counts, size)

        return _solve(scene, make, level, degree, _structure(scene, level)[1], repetitions)


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
        outline = scene.geometry.outline()  # type: ignore[union-attr]
        x, y = outline.T
        extent = np.sqrt(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
        size = scene.reference.size or extent / 12
        grading = Grading(size, singular_points(scene), extent / 2, strip=1.0)
        return _solve(
            scene,
            lambda level: conforming_mesh(scene, grading.halved(level)),
            level,
            scene.reference.degree,
            grading.halved(level).size,
            min(repetitions, 1),
        )


def _imprinted(scene: Scene, counts: tuple[int, int] | None, size: float) -> ConformingMesh:
    """Imprint the polylines of the scene on its background mesh, and open them."""
    geometry = scene.geometry
    assert isinstance(geometry, Rectangle | Polygon)
    if counts is None:
        points, cells = background_mesh(geometry.outline(), size)
    else:
        assert isinstance(geometry, Rectangle)
        points, cells = structured_triangles(geometry.lower, geometry.upper, counts)
    polylines = [cut.vertices() for cut in scene.cuts if isinstance(cut, PolylineCut)]
    return open_cut(*imprint(points, cells, polylines))


def _structure(scene: Scene, level: int) -> tuple[tuple[int, int] | None, float]:
    """Cell counts of a structured level (None if unstructured), and its element size."""
    geometry = scene.geometry
    if scene.mesh.pattern == "unstructured" or not isinstance(geometry, Rectangle):
        assert scene.mesh.sizes is not None
        return None, scene.mesh.sizes[level]
    sides = np.subtract(geometry.upper, geometry.lower)
    if scene.mesh.cells is not None:
        counts = np.array(scene.mesh.cells[level])
    else:
        assert scene.mesh.sizes is not None
        counts = np.ceil(sides / scene.mesh.sizes[level] * (1 - 1e-9)).astype(int)
    return (int(counts[0]), int(counts[1])), float((sides / counts).max())


def _solve(
    scene: Scene,
    make_mesh: Callable[[int], ConformingMesh],
    level: int,
    degree: int,
    size: float,
    repetitions: int,
) -> Solution:
    if reason := _refusal(scene):
        raise UnsupportedSceneError(reason)
    exact = None
    if scene.exact is not None:
        exact = exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)
    timings: dict[str, list[float]] = {}
    if repetitions:  # a pass on the coarsest mesh compiles the forms and is not timed
        _equilibrium(scene, conforming_space(make_mesh(0), degree), exact)
    for _ in range(max(repetitions, 1)):
        start = perf_counter()
        mesh = make_mesh(level)
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
    unknowns, values = constrained_values(scene, space, exact)
    finite = solve_large_strain(
        scene.material,
        space,
        unknowns,
        lambda factor: factor * values,
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
    first = np.zeros(int(mesh.parent.max()) + 1, dtype=np.int64)
    first[mesh.parent[::-1]] = np.arange(len(mesh.parent))[::-1]
    return Solution(
        points=space.node_points,
        cells=space.cell_nodes,
        displacement=result.displacement[None],
        order=space.degree,
        cut_facets=mesh.points[first[mesh.cut_facets]].reshape(-1, 2, 2),
        cell_sides=mesh.pieces,
        ledger={"strain": np.array([result.strain_energy])},
        unknowns=result.displacement.size,
        size=size,
        timings=timings,
        iterations=result.iterations,
        notes={"element": f"P{space.degree}", "cells": str(len(mesh.cells)), **result.notes},
    )
