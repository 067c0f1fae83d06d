"""Answer of the compact XFEM solver as a neutral solution, with everything that it changed."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from verify.scene import Polygon, PolylineCut, Rectangle, Scene
from verify.scene.planar import distance_to_outline, inside_polygon
from verify.solution import Regularisation, Solution
from verify.solvers.body_of_scene import across_interfaces
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.phantom import PhantomMesh
from verify.xfem.slivers import SliverReport, Specks
from verify.xfem.subdivision import Subdivision, subdivide

__all__ = ["Answer", "joined", "penalised", "solution_of", "treated"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Answer:
    """Displacements and their rates (t, N, d) of the unknowns of a cut mesh at output times."""

    phantom: PhantomMesh
    times: _Floats
    displacement: _Floats
    velocity: _Floats | None
    acceleration: _Floats | None
    ledger: dict[str, _Floats]
    timings: dict[str, float]
    iterations: dict[str, int]
    notes: dict[str, str]
    unknowns: int
    further: list[Regularisation] = field(default_factory=list)


def solution_of(
    scene: Scene,
    answer: Answer,
    size: float,
    timings: dict[str, list[float]],
    notes: dict[str, str],
) -> Solution:
    """Put an answer on the conforming mesh of its cut body.

    Parameters
    ----------
    scene : Scene
    answer : Answer
    size : float
        Element size, m.
    timings : dict of str to list of float
        Of all repetitions.
    notes : dict of str to str
        Choices of the solver, beside those of the answer.
    """
    phantom = answer.phantom
    body = subdivide(phantom)
    return Solution(
        points=body.points,
        cells=body.cells,
        displacement=np.stack([body.interpolation @ one for one in answer.displacement]),
        times=answer.times,
        velocity=_at_points(body, answer.velocity),
        acceleration=_at_points(body, answer.acceleration),
        cut_facets=body.cut_facets,
        cell_sides=_side_labels(phantom.label[body.cell_piece]),
        ledger=answer.ledger,
        unknowns=answer.unknowns,
        size=size,
        timings=timings,
        iterations=answer.iterations,
        regularisations=[
            *_regularisations(scene, phantom, body),
            *answer.further,
            *across_interfaces(scene, phantom.mesh),
        ],
        notes={**notes, **answer.notes},
    )


def penalised(ghost: GhostPenalty | None, share: float | None = None) -> list[Regularisation]:
    """Report a ghost penalty: its faces, and its share in the energy or else its factor."""
    if ghost is None or not len(ghost.weights):
        return []
    size, unit = (ghost.factor, "factor") if share is None else (share, "of the strain energy")
    return [Regularisation("face with a ghost penalty", len(ghost.weights), size, unit)]


def treated(report: SliverReport | None) -> list[Regularisation]:
    """Report what was done to slivers, each kind with its largest volume fraction."""
    if report is None:
        return []
    counts = {
        "sliver that follows a root cell (aggregation)": report.aggregated,
        "sliver absorbed across the cut": report.dropped,
        "sliver without a root cell, kept": report.rootless,
    }
    return [
        Regularisation(kind, count, report.largest, "volume fraction")
        for kind, count in counts.items()
        if count
    ]


def joined(specks: Specks) -> list[Regularisation]:
    """Report loose parts of round-off size that move with their neighbours."""
    if not specks.count:
        return []
    kind = "loose part of round-off size joined to its neighbour"
    return [Regularisation(kind, specks.count, specks.largest, "volume fraction")]


def _at_points(body: Subdivision, values: _Floats | None) -> _Floats | None:
    return None if values is None else np.stack([body.interpolation @ one for one in values])


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


def _regularisations(scene: Scene, phantom: PhantomMesh, body: Subdivision) -> list[Regularisation]:
    """Report what the solver moved or left out, each with its size."""
    entries = []
    if phantom.snapped:
        entries.append(Regularisation("node taken as on the cut", phantom.snapped, 0.0, "m"))
    if phantom.dropped:
        entries.append(
            Regularisation("piece without volume left out", phantom.dropped, 0.0, "volume fraction")
        )
    moved = _moved_ends(scene, body)
    if moved:
        kind = "end of a cut moved to an element edge"
        entries.append(Regularisation(kind, len(moved), max(moved), "m"))
    return entries


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
