"""Adapter of the compact XFEM solver: a scene in, a neutral solution out."""

from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import Polygon, PolylineCut, Rectangle, Scene
from verify.scene.planar import distance_to_outline, inside_polygon
from verify.solution import Regularisation, Solution
from verify.solvers.xfem_bases import solve_in_basis
from verify.solvers.xfem_scene import (
    background_mesh,
    cuts_of,
    loads_of,
    material_of,
    supports_of,
)
from verify.xfem.errors import BasisError, XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.slivers import SliverReport, treat_slivers
from verify.xfem.static import solve_static
from verify.xfem.subdivision import Subdivision, subdivide
from verify.xfem.virtual import VirtualMesh, cut_mesh

__all__ = ["XfemSolver"]

_BASES = ("sidewise", "shifted", "heaviside")
_TIPS = ("inside", "through", "nearest")
_POLICIES = ("keep", "merge", "drop")


@dataclass(frozen=True)
class _Run:
    """One pass through all phases."""

    virtual: VirtualMesh
    displacement: NDArray[np.float64]
    timings: dict[str, float]
    residual: float | None
    slivers: SliverReport | None


@dataclass(frozen=True)
class _Choice:
    """The parameters of a solve."""

    basis: str
    tip: str
    slivers: str


class XfemSolver:
    """The compact solver `verify.xfem`: linear statics on P1 simplices.

    Parameters of `solve`
    ---------------------
    basis : {"sidewise", "shifted", "heaviside"}
        Unknowns of the enrichment; all give the same displacements up to round-off.
    tip : {"inside", "through", "nearest"}
        What happens to an element in which a cut ends; see `verify.xfem.split.split_cells`.
    slivers : {"keep", "merge", "drop"}
        What happens to pieces with less than a tenth of their element; see
        `verify.xfem.slivers`. A direct static solve does not mind them, so they are kept.
    """

    name = "xfem"

    def refuses(self, scene: Scene) -> str | None:
        """Refuse what `verify.xfem` does not do through this adapter yet."""
        if scene.analysis.kind == "dynamic":
            return "dynamics is not offered by this adapter yet"
        if scene.analysis.kinematics == "corotational":
            return "corotational kinematics is not offered by this adapter yet"
        return None

    def levels(self, scene: Scene) -> int:
        """Return the number of mesh levels of the scene."""
        return scene.mesh.count

    def solve(
        self,
        scene: Scene,
        level: int,
        repetitions: int = 1,
        basis: str = "sidewise",
        tip: str = "inside",
        slivers: str = "keep",
    ) -> Solution:
        """Solve `scene` on mesh `level`.

        Raises
        ------
        UnsupportedSceneError
            If `refuses` gives a reason.
        InputError
            If a parameter is unknown, a mesh file bad, a support nowhere, or a piece not held.
        """
        if reason := self.refuses(scene):
            raise UnsupportedSceneError(reason)
        given = (("basis", basis, _BASES), ("tip", tip, _TIPS), ("slivers", slivers, _POLICIES))
        for name, value, known in given:
            if value not in known:
                raise InputError(f"{name} '{value}'; expected one of {', '.join(known)}")
        if not 0 <= level < self.levels(scene):
            raise InputError(f"mesh level {level}; expected 0..{self.levels(scene) - 1}")
        exact = _exact(scene)
        try:
            start = perf_counter()
            mesh, size = background_mesh(scene, level)
            meshing = perf_counter() - start
            choice = _Choice(basis, tip, slivers)
            runs = [_run(scene, mesh, size, exact, choice) for _ in range(1 + repetitions)]
        except BasisError as error:  # another basis can do the scene
            raise UnsupportedSceneError(str(error)) from None
        except XfemError as error:
            raise InputError(str(error), str(scene.file or scene.name)) from None
        timings = {phase: [run.timings[phase] for run in runs[1:]] for phase in runs[0].timings}
        return _solution(scene, runs[-1], size, {"meshing": [meshing], **timings}, choice)


def _exact(scene: Scene) -> Any:
    """Return the exact solution that supports or loads may be taken from."""
    if scene.exact is None:
        return None
    from reference.exact import exact_solution  # formulas in numpy; no FEniCSx

    return exact_solution(scene.exact.solution, scene.exact.parameters, scene.material)


def _run(scene: Scene, mesh: SimplexMesh, size: float, exact: Any, choice: _Choice) -> _Run:
    """Cut, load, solve: all of it, nothing kept from the run before."""
    mesh = SimplexMesh(mesh.points, mesh.cells)
    start = perf_counter()
    virtual = cut_mesh(mesh, cuts_of(scene, size), choice.tip)  # type: ignore[arg-type]
    slivers = None
    if choice.slivers != "keep":
        virtual, slivers = treat_slivers(virtual, choice.slivers)  # type: ignore[arg-type]
    enrichment = perf_counter() - start
    supports = supports_of(scene, virtual, exact)
    load = loads_of(scene, virtual, exact)
    loading = perf_counter() - start - enrichment
    material = material_of(scene)
    if choice.basis == "sidewise":
        static = solve_static(virtual, material, supports, load)
        displacement, phases, residual = static.displacement, static.timings, static.residual
    else:
        basis: Any = choice.basis
        displacement, phases = solve_in_basis(virtual, material, supports, load, basis)
        residual = None
    timings = {"enrichment": enrichment, "loading": loading, **phases}
    return _Run(virtual, displacement, timings, residual, slivers)


def _solution(
    scene: Scene, run: _Run, size: float, timings: dict[str, list[float]], choice: _Choice
) -> Solution:
    virtual = run.virtual
    body = subdivide(virtual)
    notes = {
        "method": "P1 XFEM, element-wise cut",
        "basis": choice.basis,
        "tip": choice.tip,
        "slivers": choice.slivers,
        "linear solver": "own sparse Cholesky" if choice.basis == "sidewise" else "SciPy SuperLU",
        "timed": "every phase as listed; first call (compilation) excluded; writing excluded",
    }
    if run.residual is not None:
        notes["residual"] = f"{run.residual:.3e}"
    label = virtual.label[body.cell_piece]
    return Solution(
        points=body.points,
        cells=body.cells,
        displacement=(body.interpolation @ run.displacement)[None],
        cut_facets=body.cut_facets,
        cell_sides=_side_labels(label),
        unknowns=run.displacement.size,
        size=size,
        timings=timings,
        regularisations=[*_regularisations(scene, virtual, body), *_absorbed(run.slivers)],
        notes=notes,
    )


def _side_labels(label: NDArray[np.int8]) -> NDArray[np.int64]:
    """One number per combination of sides; 0 away from all cuts."""
    if not label.shape[1]:
        return np.zeros(len(label), dtype=np.int64)
    distinct, number = np.unique(label, axis=0, return_inverse=True)
    away = np.flatnonzero((distinct == 0).all(axis=1))
    names = np.arange(1, len(distinct) + 1)
    names[away] = 0
    sides: NDArray[np.int64] = names[number.ravel()]
    return sides


def _regularisations(scene: Scene, virtual: VirtualMesh, body: Subdivision) -> list[Regularisation]:
    """Report what the solver moved or left out, each with its size."""
    entries = []
    if virtual.snapped:
        entries.append(Regularisation("node taken as on the cut", virtual.snapped, 0.0, "m"))
    if virtual.dropped:
        entries.append(
            Regularisation("piece without volume left out", virtual.dropped, 0.0, "volume fraction")
        )
    moved = _moved_ends(scene, body)
    if moved:
        kind = "end of a cut moved to an element edge"
        entries.append(Regularisation(kind, len(moved), max(moved), "m"))
    return entries


def _absorbed(report: SliverReport | None) -> list[Regularisation]:
    """Report slivers that a larger piece absorbed, each kind with its largest volume fraction."""
    if report is None:
        return []
    counts = {
        "sliver absorbed by its neighbour on the same side": report.merged,
        "sliver absorbed across the cut": report.dropped,
    }
    return [
        Regularisation(kind, count, report.largest, "volume fraction")
        for kind, count in counts.items()
        if count
    ]


def _moved_ends(scene: Scene, body: Subdivision) -> list[float]:
    """Distance of each inner end of a cut to the realised cut, m; ends on it do not count."""
    if not isinstance(scene.geometry, Rectangle | Polygon):
        return []
    outline = scene.geometry.outline()
    tolerance = 1e-9 * float(np.ptp(outline, axis=0).max())
    ends = [
        cut.vertices()[[0, -1]]
        for cut in scene.cuts
        if isinstance(cut, PolylineCut) and cut.points[0] != cut.points[-1]
    ]
    moved = []
    for end in np.concatenate(ends) if ends else []:
        inner = inside_polygon(end[None], outline)[0]
        if not inner or distance_to_outline(end[None], outline)[0] <= tolerance:
            continue
        if len(body.cut_facets) == 0:
            moved.append(float("inf"))
            continue
        to_facets = np.linalg.norm(body.cut_facets - end, axis=2).min()
        if to_facets > tolerance:
            moved.append(float(to_facets))
    return moved
