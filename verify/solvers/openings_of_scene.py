"""Times of a motion: from which on cuts have opened what, and at which steps have to end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene, ToolPathCut
from verify.scene.history import jumps
from verify.solvers.cuts_of_scene import cuts_of
from verify.xfem.cuts import Cut
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]
_DUE = 1e-9  # of the duration: times that close are one, steps added up are off by less


@dataclass(frozen=True)
class Openings:
    """The cuts of a moving scene in the order in which they open.

    What is cut further keeps what is cut already: those that open first come first.

    Attributes
    ----------
    asked : list
        The cuts of the scene.
    cuts : list of Cut
        The same as level sets.
    times : list of float
        When each opens as a whole, s; of a tool path not read.
    outputs : (t,) array
        Output times, s.
    due : float
        What is due so much later is due now, s.
    """

    asked: list[Any]
    cuts: list[Cut]
    times: list[float]
    outputs: _Floats
    due: float

    def of_cells(self, phantom: PhantomMesh) -> _Floats:
        """Return `opening_times` of the mesh with all the cuts."""
        return opening_times(self.asked, phantom, self.times)

    def of_seams(self, seams: _Floats) -> _Floats:
        """Return `seam_times` of seams (k, d, space)."""
        return seam_times(self.asked, self.cuts, seams, self.times)


def openings_of(scene: Scene, size: float) -> Openings:
    """Return when the cuts of a moving scene open on a mesh of a size, in m.

    A time that is an output time up to what steps are off by is that one.
    """
    outputs = np.array(scene.analysis.output_times)
    due = _DUE * float(outputs[-1])

    def snapped(time: float) -> float:
        nearest = float(outputs[np.abs(outputs - time).argmin()])
        return nearest if abs(nearest - time) <= due else time

    times = [snapped(float(getattr(cut, "opens_at", 0.0))) for cut in scene.cuts]
    order, cuts = np.argsort(times, kind="stable"), cuts_of(scene, size)
    return Openings(
        [scene.cuts[k] for k in order],
        [cuts[k] for k in order],
        [times[k] for k in order],
        outputs,
        due,
    )


def opening_times(cuts: Sequence[Any], phantom: PhantomMesh, times: Sequence[float]) -> _Floats:
    """Return when each cut opens each cell that it splits: (m, cuts), NaN elsewhere, s.

    A tool path opens a cell when the blade has passed all points at which it crosses an edge of
    it: the cell is then crossed through. Other cuts open all their cells at once.

    Parameters
    ----------
    cuts : sequence
        Of the scene.
    phantom : PhantomMesh
        The mesh with all of them.
    times : sequence of float
        When each cut opens; of a tool path not read.
    """
    mesh = phantom.mesh
    found = np.full((len(mesh.cells), len(cuts)), np.nan)
    for k, cut in enumerate(cuts):
        cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
        if isinstance(cut, ToolPathCut):
            found[cells, k] = _passed(cut, phantom, cells, k)
        else:
            found[cells, k] = times[k]
    return found


def _passed(cut: ToolPathCut, phantom: PhantomMesh, cells: NDArray[np.int64], k: int) -> _Floats:
    """(c,) time at which the blade has passed all points where it crosses edges of the cells."""
    corners = phantom.mesh.cells[cells]
    value = phantom.level_sets[:, k]
    latest = np.full(len(cells), -np.inf)
    for a, b in zip(*np.triu_indices(corners.shape[1], 1), strict=True):
        one, other = value[corners[:, a]], value[corners[:, b]]
        crossed = np.flatnonzero((one >= 0.0) != (other >= 0.0))
        share = (one / (one - np.where(one == other, np.inf, other)))[crossed, None]
        ends = phantom.mesh.points[corners[crossed][:, [a, b]]]
        places = (1.0 - share) * ends[:, 0] + share * ends[:, 1]
        if len(places):
            latest[crossed] = np.maximum(latest[crossed], cut.passed_at(places))
    return latest


def seam_times(
    cuts: Sequence[Any], levels: Sequence[Cut], seams: _Floats, times: Sequence[float]
) -> _Floats:
    """Return when seams (k, d, space) open, given by their corners: (k,), s.

    A tool path opens a seam when the blade has passed all corners of it, another cut at once. A
    seam is of the cut to which its corners and its middle are nearest: nodes may be off it.

    Parameters
    ----------
    cuts : sequence
        Of the scene.
    levels : sequence of Cut
        The same as level sets.
    seams : (k, d, space) float array
    times : sequence of float
        As of `opening_times`.
    """
    count, corners, space = seams.shape
    if not count:
        return np.empty(0)
    places = np.concatenate([seams, seams.mean(axis=1, keepdims=True)], axis=1).reshape(-1, space)
    off = np.stack(
        [np.maximum(np.abs(cut.level_set(places)), -cut.depth(places)) for cut in levels]
    )
    nearest = off.reshape(len(levels), count, corners + 1).max(axis=2).argmin(axis=0)
    found = np.array(times)[nearest]
    for k, cut in enumerate(cuts):
        mine = np.flatnonzero(nearest == k)
        if isinstance(cut, ToolPathCut) and len(mine):
            passed = cut.passed_at(seams[mine].reshape(-1, space))
            found[mine] = passed.reshape(len(mine), corners).max(axis=1)
    return found


def stops_of(scene: Scene, openings: Openings) -> _Floats:
    """Return the times at which a step has to end, s: outputs, whole cuts, and jumps.

    A jump of a load or support that is due at an output is at that output.
    """
    whole = [
        time
        for cut, time in zip(openings.asked, openings.times, strict=True)
        if not isinstance(cut, ToolPathCut)
    ]
    outputs, parts = openings.outputs, [*scene.supports, *scene.loads]
    leaps = [t for part in parts for t in jumps(getattr(part, "history", None))]
    leaps = [t for t in leaps if np.abs(outputs - t).min() > openings.due]
    found = np.unique([*outputs, *whole, *leaps])
    return found[(found >= 0.0) & (found <= outputs[-1])]
