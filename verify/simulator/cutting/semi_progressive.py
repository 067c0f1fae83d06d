"""Semi-progressive cutting: an element is split when the tool has crossed it through.

The rule of the thesis (section 3.2.3): an element is split when *all* edges that the cut crosses
have been passed (three or four in a tetrahedron, two in a triangle), each counted once. Its walk
from element to neighbour is not needed: the tree of bounding boxes gives the elements near what was
swept since the last frame, and those that were not crossed through yet are tested again.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.simulator.cutting.division import Division, MeshPatch
from verify.simulator.cutting.growing_body import GrowingBody, Increment, whole_mesh
from verify.simulator.cutting.stroke import Stroke
from verify.simulator.places import BoundingTree
from verify.xfem.arrays import Floats, Ints
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh
from verify.xfem.tool_path import ToolPath

_NONE = np.empty(0, dtype=np.int64)


@dataclass(frozen=True)
class Crossings:
    """Elements that strokes have split, in the order in which they were (Table 4.6).

    Attributes
    ----------
    cell, stroke : (k,) int array
        Element, and stroke that split it.
    entry : (k,) float array
        When the blade first passed one of the edges that the cut crosses, in seconds.
    leave : (k,) float array
        When it had passed all of them, in seconds.
    seen : (k,) float array
        Time of the `advance` that split the element: `leave`, rounded up to a frame.
    """

    cell: Ints
    stroke: Ints
    entry: Floats
    leave: Floats
    seen: Floats

    @property
    def delay(self) -> Floats:
        """Time (k,) from the first to the last edge: element size over tool speed, in seconds."""
        return self.leave - self.entry


class SemiProgressiveCutter:
    """A body under a tool.

    Parameters
    ----------
    mesh : SimplexMesh
        In the material frame, in which the paths are given as well.

    Attributes
    ----------
    body : GrowingBody
        The pieces and unknowns as they are now.
    strokes : list of Stroke
    interior : BoundingTree
        Of the elements, in the material frame.
    """

    def __init__(self, mesh: SimplexMesh) -> None:
        self.mesh = mesh
        self.body = GrowingBody(mesh)
        self.strokes: list[Stroke] = []
        self._size = mesh.longest_edges(np.arange(len(mesh.cells)))
        self.interior = BoundingTree(mesh.points, mesh.cells)
        self._strokes_near = np.zeros(len(mesh.cells), dtype=np.int64)
        self._records: list[_Record] = []
        self._crossings = Crossings(_NONE, _NONE, np.empty(0), np.empty(0), np.empty(0))

    def begin(self, path: ToolPath) -> Stroke:
        """Begin a stroke along a path, known whole or to be extended as the tool moves.

        Raises
        ------
        XfemError
            If the path is not in the space of the mesh.
        """
        if path.blades.shape[2] != self.mesh.space:
            raise XfemError(
                f"tool path in {path.blades.shape[2]}D; the mesh has points in {self.mesh.space}D"
            )
        stroke = Stroke(self.mesh, path, self.body.add_cut(), self._strokes_near, self._size)
        self.strokes.append(stroke)
        return stroke

    def extend(self, blades: ArrayLike, times: ArrayLike) -> None:
        """Add positions to the path of the last stroke.

        Raises
        ------
        XfemError
            If no stroke has begun, or the longer path is not valid (see `ToolPath`).
        """
        if not self.strokes:
            raise XfemError("no stroke to extend; begin one first")
        self.strokes[-1].extend(blades, times)

    def advance(self, time: float) -> Increment | None:
        """Move all tools to where they are at that time, and split what they have crossed.

        Parameters
        ----------
        time : float
            In seconds; time does not run backwards, a smaller one than before changes nothing.

        Returns
        -------
        Increment or None
            None if no element was split.

        Raises
        ------
        XfemError
            If the time is no number.
        """
        if np.ndim(time) != 0 or not isinstance(time, int | float | np.number) or np.isnan(time):
            raise XfemError(f"time {time!r}; expected a number of seconds")
        found = [stroke.advance(time, self.interior) for stroke in self.strokes]
        candidates = np.concatenate([_NONE, *found])
        division = self.body.division(candidates, self._cuts_near) if len(candidates) else None
        if division is None:
            return None
        self._fix(division)
        increment = self.body.divide(division)
        self._record(increment, time)
        return increment

    @property
    def cuts(self) -> list[Cut]:
        """What has been cut so far; `cut_mesh` with these gives the same pieces and joins."""
        return [stroke.cut for stroke in self.strokes]

    @property
    def level_sets(self) -> Floats:
        """(n, cuts) nodal level sets in metres, NaN where no cut has come near."""
        columns = [stroke.values for stroke in self.strokes]
        return np.stack(columns, axis=1) if columns else np.zeros((len(self.mesh.points), 0))

    def phantom_mesh(self) -> PhantomMesh:
        """Copy the body as it is now; dof nodes keep their numbers."""
        nodes = np.arange(len(self.mesh.points))
        columns = [stroke.level_sets(nodes) for stroke in self.strokes]
        level_sets = np.stack(columns, axis=1) if columns else np.zeros((len(nodes), 0))
        return whole_mesh(self.body, level_sets)

    @property
    def crossings(self) -> Crossings:
        """When each element was entered and split."""
        rows, before = self._records, self._crossings
        if rows:
            count = [len(row.cell) for row in rows]
            self._crossings = Crossings(
                np.concatenate([before.cell, *(row.cell for row in rows)]),
                np.concatenate([before.stroke, np.repeat([row.stroke for row in rows], count)]),
                np.concatenate([before.entry, *(row.path.time_at(row.entry) for row in rows)]),
                np.concatenate([before.leave, *(row.path.time_at(row.leave) for row in rows)]),
                np.concatenate([before.seen, np.repeat([row.seen for row in rows], count)]),
            )
            self._records = []
        return self._crossings

    def _cuts_near(self, patch: MeshPatch) -> tuple[Ints, list[Cut]]:
        near = [stroke for stroke in self.strokes if stroke.near[patch.whole_cells].any()]
        numbers = np.array([stroke.number for stroke in near], dtype=np.int64)
        return numbers, [stroke.seen_by(patch) for stroke in near]

    def _fix(self, division: Division) -> None:
        """Let the level sets of strokes stay what they are where they divide cells."""
        nodes = self.body.patches.nodes_of(division.changed_cells)
        split = (division.label[division.changed & division.solid] != 0).any(axis=0)
        for stroke in self.strokes:
            if split[stroke.number]:
                stroke.fix(nodes)

    def _record(self, increment: Increment, time: float) -> None:
        cells = increment.cells
        for stroke in self.strokes:
            mine = cells[self.body.split_by(cells, stroke.number) & ~stroke.recorded[cells]]
            if len(mine) == 0:
                continue
            stroke.recorded[mine] = True
            # a stroke that splits only a piece has not passed all edges of the element
            leave = np.minimum(stroke.leave[mine], stroke.front)
            entry = np.minimum(stroke.entry[mine], leave)
            self._records.append(_Record(mine, stroke.number, entry, leave, time, stroke.path))


class _Record(NamedTuple):
    """Elements split by a stroke, with travels of the blade that are times only if asked for."""

    cell: Ints
    stroke: int
    entry: Floats
    leave: Floats
    seen: float
    path: ToolPath
