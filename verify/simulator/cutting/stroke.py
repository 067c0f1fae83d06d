"""One stroke of a tool: its path, where it is in the mesh, and when it entered and left cells."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.simulator.collision.bounding_tree import BoundingTree
from verify.simulator.cutting.blade_walk_kernels import cells_hit, walk
from verify.simulator.cutting.patch import MeshPatch
from verify.xfem.crossing import REACH
from verify.xfem.flat_cuts import Cut
from verify.xfem.mesh import SimplexMesh
from verify.xfem.tool_path import Sweep, ToolPath

__all__ = ["SeenCut", "Stroke"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

_ROUND_OFF = 8.0 * np.finfo(float).eps  # as in `verify.xfem.pieces`


class SeenCut:
    """A sweep as the nodes of one mesh see it: their level sets are those once taken.

    Parameters
    ----------
    nodes : (n, s) float array
        Nodes of the mesh or patch.
    values : (n,) float array
        Their level sets, in metres.
    sweep : Sweep
    front : float
        How far the blade has come, in metres.
    """

    def __init__(self, nodes: _Floats, values: _Floats, sweep: Sweep, front: float) -> None:
        self._nodes, self._values = nodes, values
        self._part = sweep.until(front)

    def level_set(self, points: _Floats) -> _Floats:
        """Values taken, at the nodes; the distance to the sweep elsewhere."""
        if points is self._nodes:
            return self._values
        if points.shape == self._nodes.shape and np.array_equal(points, self._nodes):
            return self._values
        return self._part.level_set(points)

    def depth(self, points: _Floats) -> _Floats:
        """Distance to the rim or to the blade, negative past it."""
        return self._part.depth(points)


class Stroke:
    """A path on its way through a mesh.

    Parameters
    ----------
    mesh : SimplexMesh
    path : ToolPath
    number : int
        Of the cut.
    strokes_near : (m,) int array
        Shared by all strokes: how many of them came near a cell.
    size : (m,) float array
        Longest edge of each cell, in metres.

    Attributes
    ----------
    front : float
        How far the blade has come, in metres; negative before it starts.
    shown : float
        Travel up to which the body may be divided, in metres: `front`, or less where elements that
        the blade has crossed through wait for their turn.
    waiting : int array
        Cells near those, to be asked again.
    entry, leave : (m,) float array
        Travel of the blade when it entered a cell and when it had crossed it through, in metres;
        infinite if it has not.
    near : (m,) bool array
        Cells near which the blade came.
    values : (n,) float array
        Nodal level sets, in metres; NaN where nobody has asked for them yet.
    recorded : (m,) bool array
        Cells whose crossing has been recorded.
    """

    def __init__(
        self, mesh: SimplexMesh, path: ToolPath, number: int, strokes_near: _Ints, size: _Floats
    ) -> None:
        self.path, self.number = path, number
        self.front = self.shown = -1.0
        self.waiting = np.empty(0, dtype=np.int64)
        self.near = np.zeros(len(mesh.cells), dtype=bool)
        self.entry = np.full(len(mesh.cells), np.inf)
        self.leave = np.full(len(mesh.cells), np.inf)
        self.recorded = np.zeros(len(mesh.cells), dtype=bool)
        self._mesh, self._strokes_near, self._size = mesh, strokes_near, size
        self._margin = REACH * float(size.max())
        self._snap = _ROUND_OFF * mesh.extent
        self.values = np.full(len(mesh.points), np.nan)
        self._fixed = np.zeros(len(mesh.points), dtype=bool)
        self._settled = np.zeros(len(mesh.cells), dtype=bool)
        self._turns = np.zeros(len(mesh.cells), dtype=np.int64)
        self._turn = 0
        self._frontier = np.empty(0, dtype=np.int64)
        self._longer: ToolPath | None = None  # the path from the next look on
        self._held = False

    def advance(self, time: float, elements: BoundingTree) -> _Ints:
        """Move the blade to where it is at that time; cells that may have to be split.

        Parameters
        ----------
        time : float
            In seconds.
        elements : BoundingTree
            Of the cells: where the blade comes in.
        """
        front = self.path.travel_at(time)
        if front <= self.front or not self.path.sweeps:
            return np.empty(0, dtype=np.int64)
        sweep = self.path.surface.arrays
        hit = cells_hit(
            sweep,
            self.front,
            front,
            self._margin,
            elements.low,
            elements.high,
            elements.order,
        )
        self.front = self.shown = front
        self._turn += 1
        candidates, self._frontier = walk(
            np.concatenate([self._frontier, hit]),
            front,
            self._mesh.cells,
            self._mesh.neighbours,
            self._mesh.points,
            self._size,
            self._snap,
            sweep,
            self.values,
            self._turn,
            self._turns,
            self._settled,
            self.recorded,
            self.near,
            self._strokes_near,
            self.entry,
            self.leave,
        )
        return candidates

    def admit(self, candidates: _Ints, most: int) -> _Ints:
        """Let at most some of the elements crossed through be split, the first first.

        Returns the candidates for that; if elements are left, all of these are `waiting`.
        """
        self.shown = self.front
        self.waiting = np.empty(0, dtype=np.int64)
        candidates = candidates[~self.recorded[candidates] | (self._strokes_near[candidates] > 1)]
        leave = self.leave[candidates[~self.recorded[candidates]]]
        leave = leave[np.isfinite(leave)]
        if len(leave) > most:
            self.shown = min(self.front, float(np.partition(leave, most - 1)[most - 1]))
            self.waiting = candidates
            return candidates[self.leave[candidates] <= self.shown]
        return candidates

    def extend(self, blades: ArrayLike, times: ArrayLike) -> None:
        """Add positions to the path; level sets of nodes already used for a cut stay."""
        self._longer = self.led.extended(blades, times)
        if not self._held:
            self.release()

    @property
    def led(self) -> ToolPath:
        """The path with all that has been added to it."""
        return self._longer or self.path

    def hold(self) -> None:
        """Keep the path as it is until `release`, though it may be extended meanwhile."""
        self._held = True

    def release(self) -> None:
        """Follow the path as it has been extended."""
        self._held = False
        if self._longer is not None:
            self.path, self._longer = self._longer, None
            self.values[~self._fixed] = np.nan

    def fix(self, nodes: _Ints) -> None:
        """From now on the level sets of these nodes do not change."""
        self._fixed[nodes] = True

    def level_sets(self, nodes: _Ints) -> _Floats:
        """Level sets of mesh nodes, computed where they have not been, in metres."""
        unknown = nodes[np.isnan(self.values[nodes])]
        if len(unknown):
            values = self.path.sweep.level_set(self._mesh.points[unknown])
            self.values[unknown] = np.where(np.abs(values) <= self._snap, 0.0, values)
        return self.values[nodes]

    def seen_by(self, patch: MeshPatch) -> Cut:
        """Give the cut so far, as a patch sees it."""
        values = self.level_sets(patch.whole_nodes)
        return SeenCut(patch.points, values, self.path.sweep, self.shown)

    @property
    def cut(self) -> Cut:
        """The cut so far, for `cut_mesh` on the whole mesh."""
        values = self.level_sets(np.arange(len(self._mesh.points)))
        return SeenCut(self._mesh.points, values, self.path.sweep, self.shown)
