"""Semi-progressive cutting: an element is split when the tool has crossed it through.

The rule of the thesis (section 3.2.3): an element is split when *all* edges that the cut crosses
have been passed, each counted once. These are three or four in a tetrahedron, two in a triangle.
The walk of the thesis from element to neighbour is not needed. The tree of bounding boxes gives the
elements near the sweep since the last frame. Elements that were not crossed through yet are tested
again.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from verify.simulator.division import Division, MeshPatch
from verify.simulator.growing_body import GrowingBody, Increment, whole_mesh
from verify.simulator.places import BoundingTree
from verify.simulator.point_numbers import distinct
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.crossing import AT_END, REACH
from verify.xfem.cuts import Cut, Sweep, ToolPath
from verify.xfem.faceted_cuts import FacetArrays
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh

_ROUND_OFF = 8.0 * np.finfo(float).eps  # as in `verify.xfem.pieces`
# longest edges: so near to the sweep is every cell that it may part, alone (`REACH` off its facets)
# or with other cuts (up to 1 past its rim, too)
_NEAR = 1.125


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

    def __init__(self, nodes: Floats, values: Floats, sweep: Sweep, front: float) -> None:
        self._nodes, self._values = nodes, values
        self._sweep, self._front = sweep, front
        self._asked, self._found = np.empty((0, 0)), np.empty((0, 3))

    def level_set(self, points: Floats) -> Floats:
        """Return the values taken, at the nodes; the distance to the sweep elsewhere."""
        if points is self._nodes:
            return self._values
        if points.shape == self._nodes.shape and np.array_equal(points, self._nodes):
            return self._values
        return self._probed(points)[:, 0]

    def depth(self, points: Floats) -> Floats:
        """Compute the distance to the rim or to the blade, negative past it."""
        found = self._probed(points)
        return np.minimum(found[:, 1], self._front - found[:, 2])

    def _probed(self, points: Floats) -> Floats:
        """Ask once of points that are asked for level set and depth, one after the other."""
        if not np.array_equal(points, self._asked):
            self._asked, self._found = points.copy(), self._sweep.probed(points)
        return self._found


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
    entry, leave : (m,) float array
        Travel of the blade when it entered a cell and when it had crossed it through, in metres;
        infinite if it has not.
    near : (m,) bool array
        Cells near which the blade came.
    values : (n,) float array
        Nodal level sets, in metres; NaN where nobody has asked for them yet.
    recorded : (m,) bool array
        Cells whose crossing has been recorded.
    opens : (m,) float array or None
        When each cell opens ahead of a blade whose way is known, s; NaN: never.
    """

    def __init__(
        self, mesh: SimplexMesh, path: ToolPath, number: int, strokes_near: Ints, size: Floats
    ) -> None:
        self.path, self.number = path, number
        self.front = -1.0
        self.near, self.recorded, self._settled = np.zeros((3, len(mesh.cells)), dtype=bool)
        self.entry, self.leave = np.full((2, len(mesh.cells)), np.inf)
        self.values = np.full(len(mesh.points), np.nan)
        self._fixed = np.zeros(len(mesh.points), dtype=bool)
        self._mesh, self._size, self._strokes_near = mesh, size, strokes_near
        self._snap = _ROUND_OFF * mesh.extent
        self._under_way = np.empty(0, dtype=np.int64)
        self.opens: Floats | None = None
        self._time = -np.inf

    def open_ahead(self, opens: Floats, alike: "Stroke") -> None:
        """Open cells at given times (m,), in s, from now on; `alike` has gone the whole way."""
        self.opens, self.front = opens, alike.front
        self._first = float(np.nanmin(opens, initial=np.inf))
        self.near, self.entry, self.leave = alike.near, alike.entry, alike.leave
        self.values = alike.values
        self._strokes_near += self.near

    @property
    def has_begun(self) -> bool:
        """Whether the stroke may have split anything by now."""
        return self.front >= 0.0 if self.opens is None else self._time >= self._first

    def open_cells(self, cells: Ints) -> Bools:
        """Tell whether the stroke may split each of some cells by now."""
        if self.opens is None:
            return np.ones(len(cells), dtype=bool)
        return np.asarray(self.opens[cells] <= self._time)

    def advance(self, time: float, elements: BoundingTree) -> Ints:
        """Move the blade to where it is at that time; cells that may have to be split.

        Parameters
        ----------
        time : float
            In seconds.
        elements : BoundingTree
            Of the cells: where the blade comes in.
        """
        if self.opens is not None:
            due = np.flatnonzero((self.opens > self._time) & (self.opens <= time))
            self._time = max(self._time, time)
            return due
        front = self.path.travel_at(time)
        if front <= self.front or not self.path.sweeps:
            return np.empty(0, dtype=np.int64)
        margin = _NEAR * float(self._size.max())
        hit = _cells_hit(self.path.surface.arrays, self.front, front, margin, elements)
        self.front = front
        cells = distinct(np.concatenate([self._under_way, hit[~self._settled[hit]]]))
        cells, through, latest = self._crossed(cells)
        fresh = cells[~self.near[cells]]
        self.near[fresh] = True
        self._strokes_near[fresh] += 1
        alone, recorded = self._strokes_near[cells] == 1, self.recorded[cells]
        # pieces that other strokes have left of a cell may be crossed through later than its edges;
        # and a cell that is crossed through only just may be split only when the blade is farther
        # on
        settled = alone & (recorded | (latest < front - self._size[cells]))
        self._settled[cells[settled]] = True
        self._under_way = cells[~settled]
        return cells[(through & ~recorded) | ~alone]

    def _crossed(self, cells: Ints) -> tuple[Ints, Bools, Floats]:
        """Select from cells (q,) the ones near the blade: if crossed through, and latest travel.

        Writes the travel at which the blade entered each, and crossed it through. The tolerances of
        `verify.xfem.crossing` apply, so that every cell that is crossed through is split.
        """
        self.level_sets(distinct(self._mesh.cells[cells]))
        values = self.values[self._mesh.cells[cells]]
        above = values >= 0.0
        # a face that the blade goes along belongs to the cells on both sides: another stroke, of
        # the other sense, may end in the one that this stroke does not split
        whole = above.all(axis=1)
        above[whole] = values[whole] > 0.0
        mixed = above.any(axis=1) & ~above.all(axis=1)
        cells, above = cells[mixed], above[mixed]
        nodes = self._mesh.cells[cells]
        cell, one, other = np.nonzero(above[:, :, None] & ~above[:, None, :])
        edges, edge = np.unique(nodes[cell, one] << 32 | nodes[cell, other], return_inverse=True)
        plus, minus = edges >> 32, edges & 0xFFFFFFFF
        up, down = self.values[plus, None], self.values[minus, None]
        points = self._mesh.points
        place = (up * points[minus] - down * points[plus]) / (up - down)
        level, depth, travel = self.path.sweep.probed(place).T[:, edge]
        size, away, beyond = self._size[cells[cell]], np.abs(level), np.maximum(-depth, 0.0)
        beside = (away <= size) & (beyond <= size)
        passed = (away <= REACH * size) & (beyond <= AT_END * size)
        passed &= travel <= self.front + AT_END * size
        near = np.bincount(cell, beside & (travel <= self.front + size), len(cells)) > 0
        through = near & (np.bincount(cell, ~passed, len(cells)) == 0)
        latest = np.zeros(len(cells))
        np.maximum.at(latest, cell[beside], travel[beside])
        np.minimum.at(self.entry, cells[cell[passed]], travel[passed])
        self.leave[cells[through]] = latest[through]
        return cells[near], through[near], latest[near]

    def extend(self, blades: ArrayLike, times: ArrayLike) -> None:
        """Add positions to the path; level sets of nodes already used for a cut stay."""
        self.path = self.path.extended(blades, times)
        self.values[~self._fixed] = np.nan

    def fix(self, nodes: Ints) -> None:
        """Keep the level sets of these nodes as they are from now on."""
        self._fixed[nodes] = True

    def level_sets(self, nodes: Ints) -> Floats:
        """Compute level sets of mesh nodes, computed where they have not been, in metres."""
        unknown = nodes[np.isnan(self.values[nodes])]
        if len(unknown):
            values = self.path.sweep.level_set(self._mesh.points[unknown])
            self.values[unknown] = np.where(np.abs(values) <= self._snap, 0.0, values)
        return self.values[nodes]

    def seen_by(self, patch: MeshPatch) -> Cut:
        """Give the cut so far, as a patch sees it."""
        values = self.level_sets(patch.whole_nodes)
        return SeenCut(patch.points, values, self.path.sweep, self.front)

    @property
    def cut(self) -> Cut:
        """The cut so far, for `cut_mesh` on the whole mesh."""
        values = self.level_sets(np.arange(len(self._mesh.points)))
        return SeenCut(self._mesh.points, values, self.path.sweep, self.front)


def _cells_hit(
    sweep: FacetArrays, after: float, front: float, margin: float, elements: BoundingTree
) -> Ints:
    """Find cells near the sweep between two travels; may hold doubles."""
    corners, travel = sweep.corners, sweep.travel
    # corners there, and where an edge passes one of the two
    k, j = np.array(list(combinations(range(travel.shape[1]), 2))).T
    limits, begin = np.array([after, front])[:, None, None], travel[:, k]
    step = travel[:, j] - begin
    passes = (begin < limits) != (begin + step < limits)
    share = np.divide(limits - begin, step, out=np.zeros(passes.shape), where=passes)[..., None]
    on_edges = (1.0 - share) * corners[:, k] + share * corners[:, j]
    place = np.concatenate([corners, *on_edges], axis=1)
    known = np.concatenate([(travel >= after) & (travel <= front), *passes], axis=1)
    some = np.flatnonzero(known.any(axis=1))
    place, known = place[some], known[some, :, None]
    floor = np.where(known, place, np.inf).min(axis=1, initial=np.inf) - margin
    ceiling = np.where(known, place, -np.inf).max(axis=1, initial=-np.inf) + margin
    starts, cells = elements.meeting(floor, ceiling)
    # of these the ones that come near the plane of the facet
    facet = np.repeat(some, np.diff(starts))
    normal, low, high = sweep.normals[facet], elements.floor[cells], elements.ceiling[cells]
    away = np.einsum("qi,qi->q", normal, 0.5 * (low + high) - corners[facet, 0])
    reach = margin + 0.5 * np.einsum("qi,qi->q", np.abs(normal), high - low)
    return cells[np.abs(away) <= reach]


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
        Time of the `advance` that split the element: `leave`, rounded up to a frame; before
        `entry` where elements open ahead of the blade.
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

    def _cuts_near(self, patch: MeshPatch) -> tuple[Ints, list[Cut], Bools | None]:
        cells = patch.whole_cells
        near = [stroke for stroke in self.strokes if stroke.near[cells].any()]
        numbers = np.array([stroke.number for stroke in near], dtype=np.int64)
        opened = None
        if any(stroke.opens is not None for stroke in near):
            opened = np.stack([stroke.open_cells(cells) for stroke in near], axis=1)
        return numbers, [stroke.seen_by(patch) for stroke in near], opened

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
