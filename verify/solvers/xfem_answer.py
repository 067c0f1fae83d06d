"""Answer of the XFEM solver as a neutral solution, with everything that it changed."""

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene
from verify.solution import Regularisation, Solution
from verify.solvers.across_interfaces import across_interfaces
from verify.solvers.runs import Answer, Repeated, solution_on
from verify.solvers.supports_of_scene import support_ends
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.phantom import PhantomMesh
from verify.xfem.slivers import SliverReport, Specks
from verify.xfem.subdivision import subdivide


def solution_of(scene: Scene, done: Repeated[Answer], notes: dict[str, str]) -> Solution:
    """Put an answer on the conforming mesh of its cut body.

    Parameters
    ----------
    scene : Scene
    done : Repeated
    notes : dict of str to str
        Choices of the solver, beside those of the answer.
    """
    phantom, body = done.answer.phantom, subdivide(done.answer.phantom)
    return solution_on(
        body,
        done,
        _side_labels(phantom.label[body.cell_piece]),
        [
            *_regularisations(phantom),
            *done.answer.further,
            *across_interfaces(scene, phantom.mesh.points, phantom.mesh.cells),
            *support_ends(scene, phantom, done.size),
        ],
        notes,
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


def _regularisations(phantom: PhantomMesh) -> list[Regularisation]:
    """Report what the solver moved or left out, each with its size."""
    entries = []
    if phantom.snapped:
        entries.append(Regularisation("node taken as on the cut", phantom.snapped, 0.0, "m"))
    if phantom.dropped:
        entries.append(
            Regularisation("piece without volume left out", phantom.dropped, 0.0, "volume fraction")
        )
    return entries
