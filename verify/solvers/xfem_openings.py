"""Times of a motion: from which on cuts have opened what, and at which steps have to end."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene, ToolPathCut
from verify.scene.history import jumps
from verify.xfem.cuts import Cut
from verify.xfem.phantom import PhantomMesh

__all__ = ["opening_times", "seam_times", "stops_of"]

_Floats = NDArray[np.float64]


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


def stops_of(scene: Scene, outputs: _Floats, openings: Sequence[float], apart: float) -> _Floats:
    """Return the times at which a step has to end, s: outputs, whole cuts, and jumps.

    Parameters
    ----------
    scene : Scene
        Its loads and supports may jump.
    outputs : (t,) float array
    openings : sequence of float
        Of the cuts that open as a whole.
    apart : float
        A jump that is nearer to an output is at that output, s.
    """
    parts = [*scene.supports, *scene.loads]
    leaps = [t for part in parts for t in jumps(getattr(part, "history", None))]
    leaps = [t for t in leaps if np.abs(outputs - t).min() > apart]
    found = np.unique([*outputs, *openings, *leaps])
    return found[(found >= 0.0) & (found <= outputs[-1])]
