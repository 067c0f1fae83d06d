"""Times from which on each cut has opened each element of a body that moves."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import ToolPathCut
from verify.xfem.virtual import VirtualMesh

__all__ = ["opening_times"]

_Floats = NDArray[np.float64]


def opening_times(cuts: Sequence[Any], virtual: VirtualMesh, times: Sequence[float]) -> _Floats:
    """Return when each cut opens each cell that it splits: (m, cuts), NaN elsewhere, s.

    A tool path opens a cell when the blade has passed all points at which it crosses an edge of
    it: the cell is then crossed through. Other cuts open all their cells at once.

    Parameters
    ----------
    cuts : sequence
        Of the scene.
    virtual : VirtualMesh
        The mesh with all of them.
    times : sequence of float
        When each cut opens; of a tool path not read.
    """
    mesh = virtual.mesh
    found = np.full((len(mesh.cells), len(cuts)), np.nan)
    for k, cut in enumerate(cuts):
        cells = np.unique(virtual.parent[virtual.label[:, k] != 0])
        if isinstance(cut, ToolPathCut):
            found[cells, k] = _passed(cut, virtual, cells, k)
        else:
            found[cells, k] = times[k]
    return found


def _passed(cut: ToolPathCut, virtual: VirtualMesh, cells: NDArray[np.int64], k: int) -> _Floats:
    """(c,) time at which the blade has passed all points where it crosses edges of the cells."""
    corners = virtual.mesh.cells[cells]
    value = virtual.level_sets[:, k]
    latest = np.full(len(cells), -np.inf)
    for a, b in zip(*np.triu_indices(corners.shape[1], 1), strict=True):
        one, other = value[corners[:, a]], value[corners[:, b]]
        crossed = np.flatnonzero((one >= 0.0) != (other >= 0.0))
        share = (one / (one - np.where(one == other, np.inf, other)))[crossed, None]
        ends = virtual.mesh.points[corners[crossed][:, [a, b]]]
        places = (1.0 - share) * ends[:, 0] + share * ends[:, 1]
        if len(places):
            latest[crossed] = np.maximum(latest[crossed], cut.passed_at(places))
    return latest
