"""Times from which on the cuts of a moving scene have opened what, on any mesh that is cut."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene, ToolPathCut
from verify.solvers.cuts_of_scene import cuts_of
from verify.solvers.timeline import Timeline
from verify.xfem.cuts import Cut
from verify.xfem.phantom import PhantomMesh

_Floats = NDArray[np.float64]


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
    """

    asked: list[Any]
    cuts: list[Cut]
    times: list[float]

    def of_cells(self, phantom: PhantomMesh) -> _Floats:
        """Return when each cut opens each cell that it splits: (m, cuts), NaN elsewhere, s.

        A tool path opens a cell when the blade has passed all points at which it crosses an edge
        of it: the cell is then crossed through. Other cuts open all their cells at once.

        Parameters
        ----------
        phantom : PhantomMesh
            The mesh with all of them.
        """
        found = np.full((len(phantom.mesh.cells), len(self.asked)), np.nan)
        for k, cut in enumerate(self.asked):
            cells = np.unique(phantom.parent[phantom.label[:, k] != 0])
            if isinstance(cut, ToolPathCut):
                found[cells, k] = _passed(cut, phantom, cells, k)
            else:
                found[cells, k] = self.times[k]
        return found

    def of_seams(self, seams: _Floats) -> _Floats:
        """Return when seams (k, d, space) open, given by their corners: (k,), s.

        A tool path opens a seam when the blade has passed all corners of it, another cut at once.
        A seam is of the cut to which its corners and its middle are nearest: nodes may be off it.
        """
        count, corners, space = seams.shape
        if not count:
            return np.empty(0)
        middles = seams.mean(axis=1, keepdims=True)
        places = np.concatenate([seams, middles], axis=1).reshape(-1, space)
        off = np.stack(
            [np.maximum(np.abs(cut.level_set(places)), -cut.depth(places)) for cut in self.cuts]
        )
        nearest = off.reshape(len(self.cuts), count, corners + 1).max(axis=2).argmin(axis=0)
        found = np.array(self.times)[nearest]
        for k, cut in enumerate(self.asked):
            mine = np.flatnonzero(nearest == k)
            if isinstance(cut, ToolPathCut) and len(mine):
                passed = cut.passed_at(seams[mine].reshape(-1, space))
                found[mine] = passed.reshape(len(mine), corners).max(axis=1)
        return found


def openings_of(scene: Scene, size: float, timeline: Timeline) -> Openings:
    """Return when the cuts of a moving scene open on a mesh of a size, in m."""
    order, cuts = np.argsort(timeline.opens, kind="stable"), cuts_of(scene, size)
    return Openings(
        [scene.cuts[k] for k in order],
        [cuts[k] for k in order],
        timeline.opens[order].tolist(),
    )


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
