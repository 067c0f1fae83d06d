"""A body that is cut again and again: every cut costs what it touches.

The same pieces and the same joins as `verify.xfem.phantom.cut_mesh` gives for all cuts at once,
kept up to date cell by cell. Numbers of pieces and dof nodes never change: cells and nodes
keep theirs, new ones follow. A copy as `PhantomMesh` is for solvers that want all of it in one
piece.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from verify.simulator.division import (
    Division,
    MeshPatch,
    PatchCutter,
    Slots,
    StoredPieces,
    TiedParts,
    number_groups,
    slots_before,
)
from verify.simulator.point_numbers import GrowingArray, PointNumbers, distinct, ranges
from verify.xfem.arrays import Bools, Floats, Ints, Sides, XfemError
from verify.xfem.block_pattern import order_by_counting
from verify.xfem.clip import Partition
from verify.xfem.cuts import Cut
from verify.xfem.join import join_parts
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh, SubCells
from verify.xfem.pieces import Separated, split_cells
from verify.xfem.zero_points import ZeroPoints

# the cuts near a patch: the number of each, the cut as that patch sees it, and which cells each has
# opened, if not all
CutsNear = Callable[[MeshPatch], tuple[Ints, Sequence[Cut], Bools | None]]


@dataclass(frozen=True)
class Increment:
    """What one cut did to a body.

    Attributes
    ----------
    cells : int array
        Cells that were split, or whose pieces were.
    touched : int array
        Cells that share an edge with these and are not on one side of all cuts, have new unknowns,
        or have pieces left out beside those that have: their surfaces may change.
    moved : int array
        Cells among them that have new unknowns, or are split anew.
    nodes_before : int
        Number of dof nodes before.
    source : (new,) int array
        Dof node from which each new one inherits displacement and velocity.
    """

    cells: Ints
    touched: Ints
    moved: Ints
    nodes_before: int
    source: Ints

    def inherit(self, values: Floats) -> Floats:
        """Carry nodal values (N_before, ...) over to the cut body: new nodes move as their source.

        The displacement field does not change, and the lumped masses of the parts of a piece sum
        to its own: energy and momentum are continuous.

        Raises
        ------
        XfemError
            If the number of values differs from the number of dof nodes before the cut.
        """
        if len(values) != self.nodes_before:
            raise XfemError(f"{len(values)} nodal values; expected {self.nodes_before}")
        return np.concatenate([values, values[self.source]])


class GrowingBody:
    """Pieces and unknowns of a mesh under repeated cuts.

    Parameters
    ----------
    mesh : SimplexMesh

    Attributes
    ----------
    piece_cells : GrowingArray
        (p, d + 1) dof nodes of each piece.
    piece_parent, piece_fraction, piece_label : GrowingArray
        (p,), (p,), (p, cuts): as in `PhantomMesh`, in the order in which pieces came.
    first_piece, next_piece
        Pieces of a cell: the first, and after each the next or -1.
    node_parent : GrowingArray
        (N,) mesh node of each dof node.
    points : PointNumbers
        Points where cuts meet the mesh.
    sub_piece, sub_points, sub_barycentric, sub_fraction : GrowingArray
        Sub-simplices as in `SubCells`; piece -1 if no longer in use.
    sub_sign : GrowingArray
        (k,) orientation of the sub-simplices in their cells, +1 or -1.
    sub_range : (m, 2) int array
        First sub-simplex of each cell, and one past the last.
    split_cells : (m,) bool array
        Whether a cell is split.
    held : int
        How often a cut separated a piece only because it had done so before a later cut came:
        where that is not 0, the cuts at once would have left some element less divided.
    """

    def __init__(self, mesh: SimplexMesh) -> None:
        cells, corners = mesh.cells.shape
        self.mesh = mesh
        self.patches = PatchCutter(mesh)
        self.piece_cells = GrowingArray(mesh.cells)
        self.piece_parent = GrowingArray(np.arange(cells))
        self.piece_fraction = GrowingArray(np.ones(cells))
        self.piece_label = GrowingArray(np.zeros((cells, 0), dtype=np.int8))
        self.first_piece = np.arange(cells)
        self.next_piece = GrowingArray(np.full(cells, -1))
        self.node_parent = GrowingArray(np.arange(len(mesh.points)))
        self.points = PointNumbers(len(mesh.points), mesh.space)
        self.sub_piece = GrowingArray(np.empty(0, dtype=np.int64))
        self.sub_points = GrowingArray(np.empty((0, corners), dtype=np.int64))
        self.sub_barycentric = GrowingArray(np.empty((0, corners, corners)))
        self.sub_fraction = GrowingArray(np.empty(0))
        self.sub_sign = GrowingArray(np.empty(0, dtype=np.int8))
        self.sub_range = np.zeros((cells, 2), dtype=np.int64)
        self.cut_count = 0
        self.split_cells = np.zeros(cells, dtype=bool)
        self._dropped = np.zeros(cells, dtype=np.int64)
        self._tied = TiedParts(cells)
        self.held = 0

    @property
    def node_count(self) -> int:
        """Number of dof nodes."""
        return len(self.node_parent)

    @property
    def dropped(self) -> int:
        """Pieces of round-off size, which are left out."""
        return int(self._dropped.sum())

    @property
    def pieces(self) -> StoredPieces:
        """Stored pieces as they are now."""
        return StoredPieces(self.piece_label.rows, self.first_piece, self.next_piece.rows)

    def split_by(self, cells: Ints, cut: int) -> Bools:
        """Tell whether a cut has split cells, or pieces of them."""
        return self.pieces.labelled(cells, cut)

    def add_cut(self) -> int:
        """Make room for one more cut; its number."""
        label = np.zeros((len(self.piece_label), self.cut_count + 1), dtype=np.int8)
        label[:, :-1] = self.piece_label.rows
        self.piece_label = GrowingArray(label)
        self.cut_count += 1
        return self.cut_count - 1

    def division(self, candidates: Ints, cuts_near: CutsNear) -> Division | None:
        """Find how some cells are to be divided, None if they are not; the body stays as it is.

        Parameters
        ----------
        candidates : int array
            Cells that may have to be split.
        cuts_near : callable
            Gives the cuts near a patch as (number of each, cut as that patch sees it, cells (q,
            cuts) that each may split or None for all); it must contain every cut that splits a
            cell of the patch.

        Raises
        ------
        XfemError
            If a cut would join material that is already separate.
        """
        wanted = distinct(candidates)
        while len(wanted):
            patch = self.patches.patch(self.patches.cells_around(self.patches.nodes_of(wanted)))
            numbers, cuts, opened = cuts_near(patch)
            held, joint = self._held_in(patch, numbers), self._tied.joint[patch.whole_cells]
            partition = split_cells(
                patch, cuts, separated=held, opened=opened, junction_cells=joint
            )
            division = self._compare(patch, partition, numbers)
            all_wanted = distinct(np.concatenate([wanted, division.changed_cells]))
            if len(all_wanted) == len(wanted):
                return division if len(division.changed_cells) else None
            # a cell at the edge of the patch changes too: its own surroundings are needed
            wanted = all_wanted
        return None

    def divide(self, division: Division) -> Increment:
        """Divide cells as has been found, by the body as it still is.

        Raises
        ------
        XfemError
            If a cut would join material that is already separate.
        """
        cells = division.changed_cells
        before = self.node_count
        place = self._renumber(division)
        self._tied.store(division.partition.one_part, division.cell, place, len(self.piece_parent))
        self._store_simplices(division, cells, place)
        self.split_cells[cells] = True
        self._dropped[cells] = 0
        empty = division.cell[~division.solid]
        np.add.at(self._dropped, empty[_among(empty, cells)], 1)
        patch, level = division.patch, division.partition.points.values
        is_moved = _among(patch.whole_cells, distinct(np.concatenate([cells, self._moved])))
        # faces and edges on one side of all cuts are as they were where the unknowns are
        above, below = (sign * level[patch.cells] > 0.0 for sign in (1, -1))
        beside = ~(above.all(axis=1) | below.all(axis=1)).all(axis=1)
        shares_edge = division.at_changed_cells[patch.cells].sum(axis=1) > 1
        moved = patch.whole_cells[is_moved]
        # a piece that was left out has the unknowns of another: it does not move with its neighbour
        around = self.mesh.neighbours[moved]
        apart = (self._dropped[around] > 0) | (self._dropped[moved] > 0)[:, None]
        around = around[(around >= 0) & apart]
        touched = np.concatenate([patch.whole_cells[is_moved | (shares_edge & beside)], around])
        return Increment(cells, distinct(touched), moved, before, self._source)

    def _held_in(self, patch: MeshPatch, numbers: Ints) -> Separated:
        """Make the rule that what a cut has separated it separates, whatever came later."""

        def held(parent: Ints, label: Sides, index: int) -> Bools:
            cells = patch.whole_cells[parent]
            before = self.pieces.separated(cells, label, numbers, int(numbers[index]))
            self.held += int(before.sum())
            return before

        return held

    def _compare(self, patch: MeshPatch, partition: Partition, numbers: Ints) -> Division:
        """Match the pieces of a patch with the stored ones."""
        fraction, solid = partition.fraction, partition.solid
        label = np.zeros((len(solid), self.cut_count), dtype=np.int8)
        label[:, numbers] = partition.label
        cell = patch.whole_cells[partition.parent]
        old, changed = self.pieces.match(cell, label, label)
        if (solid & (old < 0)).any():
            # a piece on one side of a cut that does not split it is part of the material on that
            # side
            side = label.copy()
            side[:, numbers] = _sides(partition)
            old, changed = self.pieces.match(cell, label, side)
        orphans = np.flatnonzero(solid & (old < 0))
        if len(orphans):
            raise XfemError(f"a cut would join parts of cell {cell[orphans[0]]} that are separate")
        if len(partition.one_part) or self._tied.joint[cell].any():
            of = np.where(solid, old, -1)
            partition = replace(partition, one_part=self._tied.still(partition.one_part, of))
            changed |= self._tied.parted(partition.one_part, of)
        return Division(patch, partition, numbers, cell, label, fraction, solid, old, changed)

    def _renumber(self, division: Division) -> Ints:
        """Set the unknowns at the nodes of changed cells; return the stored place of each piece."""
        joined = join_parts(division.patch, division.partition, division.solid)
        local, group = joined.cells[joined.piece_cell], joined.group
        slots = slots_before(division, local, self.first_piece)
        number, self._source = number_groups(
            slots, group, self.piece_cells.rows, len(self.mesh.points), self.node_count
        )
        self.node_parent.append(self.node_parent.rows[self._source])
        place = self._store_pieces(division, slots)
        there = np.flatnonzero(slots.solid)
        rows, touched = place[there], slots.touched[there]
        before = self.piece_cells.rows[rows]
        after = np.where(touched, number[group[there]], before)
        self.piece_cells.rows[rows] = after
        self._moved = slots.cell[there[(before != after).any(axis=1)]]
        return place

    def _store_pieces(self, division: Division, slots: Slots) -> Ints:
        """Store pieces: the first part of a stored one takes its place, others are appended.

        Returns the place (p,) of each, -1 for those without volume.
        """
        there, count = np.flatnonzero(slots.solid), len(self.piece_cells)
        place = np.full(len(slots.old), -1)
        stored, first = np.unique(slots.old[there], return_index=True)
        place[there[first]] = stored
        more = there[place[there] < 0]
        source = slots.old[more]
        place[more] = count + np.arange(len(more))
        self.piece_cells.append(self.piece_cells.rows[source])
        self.piece_parent.append(slots.cell[more])
        self.piece_fraction.append(self.piece_fraction.rows[source])
        self.piece_label.append(self.piece_label.rows[source])
        self.next_piece.extend(len(more))
        chain = self.next_piece.rows
        for new, old in zip(place[more].tolist(), source.tolist(), strict=True):
            chain[new], chain[old] = chain[old], new
        changed = np.flatnonzero(division.changed & division.solid)
        self.piece_label.rows[place[changed]] = division.label[changed]
        # beside a piece that changes another may take its rest of round-off size
        renewed = np.flatnonzero(_among(division.cell, division.changed_cells) & division.solid)
        self.piece_fraction.rows[place[renewed]] = division.fraction[renewed]
        return place

    def _store_simplices(self, division: Division, cells: Ints, place: Ints) -> None:
        """Replace the sub-simplices of the changed cells."""
        patch, partition = division.patch, division.partition
        ids = self.points.number(partition.points, patch.whole_nodes, division.numbers)
        simplices = partition.simplices
        stored = place[simplices.piece]
        cell = patch.whole_cells[partition.parent[simplices.piece]]
        owner = np.searchsorted(cells, cell)
        mine = cells[np.minimum(owner, len(cells) - 1)] == cell
        rows = np.flatnonzero(mine & (simplices.fraction > 0.0) & (stored >= 0))
        rows = rows[np.argsort(owner[rows], kind="stable")]
        ends = np.cumsum(np.bincount(owner[rows], minlength=len(cells)))
        self.sub_piece.rows[ranges(self.sub_range[cells])] = -1
        begin = len(self.sub_piece)
        self.sub_piece.append(stored[rows])
        self.sub_points.append(ids[simplices.points[rows]])
        self.sub_barycentric.append(simplices.barycentric[rows])
        self.sub_fraction.append(simplices.fraction[rows])
        self.sub_sign.append(simplices.sign[rows])
        self.sub_range[cells] = begin + np.stack([np.concatenate([[0], ends[:-1]]), ends], axis=1)


def _sides(partition: Partition) -> Sides:
    """Find the side (p, cuts) of each cut on which a piece lies, 0 if it lies on both."""
    side, piece = partition.label.copy(), partition.simplices.piece
    plus = partition.points.values[partition.simplices.points] >= 0.0
    for cut in range(side.shape[1]):
        above = np.bincount(piece, plus[:, :, cut].any(axis=1), len(side)) > 0
        below = np.bincount(piece, ~plus[:, :, cut].all(axis=1), len(side)) > 0
        whole = partition.label[:, cut] == 0
        side[whole, cut] = above[whole].astype(np.int8) - below[whole].astype(np.int8)
    return side


def _among(values: Ints, ascending: Ints) -> Bools:
    """Tell whether each value is one of some ascending ones, of which there is at least one."""
    place = np.searchsorted(ascending, values)
    return ascending[np.minimum(place, len(ascending) - 1)] == values


def whole_mesh(body: GrowingBody, level_sets: Floats) -> PhantomMesh:
    """Copy a growing body into a phantom-node mesh; costs what the whole mesh is.

    Dof nodes keep their numbers; pieces are ordered by their cell.

    Parameters
    ----------
    body : GrowingBody
    level_sets : (n, cuts) float array
        Nodal level sets, in metres.
    """
    parent = body.piece_parent.rows
    order = order_by_counting(parent, len(body.mesh.cells))
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    used = np.flatnonzero(body.sub_piece.rows >= 0)
    return PhantomMesh(
        mesh=body.mesh,
        cells=body.piece_cells.rows[order],
        parent=parent[order],
        fraction=body.piece_fraction.rows[order],
        label=body.piece_label.rows[order],
        node_parent=body.node_parent.rows.copy(),
        level_sets=level_sets,
        sub_cells=_GrownSubCells(body, number, used, level_sets),
        snapped=int(np.count_nonzero(level_sets == 0.0)),
        dropped=body.dropped,
    )


class _GrownSubCells(SubCells):
    """Sub-simplices of a growing body; arrays that not every cut needs are made on demand."""

    _points: tuple[Floats, Ints, Ints]
    _nodes: tuple[Floats, Floats]

    def __init__(self, body: GrowingBody, number: Ints, used: Ints, level_sets: Floats) -> None:
        self.__dict__.update(
            piece=number[body.sub_piece.rows[used]],
            points=body.sub_points.rows[used],
            barycentric=body.sub_barycentric.rows[used],
            fraction=body.sub_fraction.rows[used],
            # existing rows never change, so these stay the rows of the body as it is now
            _points=(body.points.positions.rows, body.points.ends.rows, body.points.cut.rows),
            _nodes=(body.mesh.points, level_sets),
        )

    @cached_property
    def zero_points(self) -> ZeroPoints:
        """Positions of all numbered points, and the edges on which the new ones lie."""
        (nodes, level_sets), (positions, ends, cut) = self._nodes, self._points
        return _zero_points(nodes, level_sets, positions, ends, cut)


def _zero_points(
    nodes: Floats, level_sets: Floats, positions: Floats, ends: Ints, cut: Ints
) -> ZeroPoints:
    points = ZeroPoints(nodes, level_sets, 0.0)
    values = np.full((len(nodes) + len(cut), level_sets.shape[1]), np.nan)
    values[: len(nodes)] = level_sets
    missing = np.arange(len(cut))
    while len(missing):
        # ends that are zero points themselves come first
        ready = ~np.isnan(values[ends[missing], 0]).any(axis=1)
        rows, missing = missing[ready], missing[~ready]
        plus, minus = values[ends[rows, 0]], values[ends[rows, 1]]
        k = np.arange(len(rows))
        above, below = plus[k, cut[rows]], minus[k, cut[rows]]
        r = (above / (above - below))[:, None]
        values[len(nodes) + rows] = (1.0 - r) * plus + r * minus
        values[len(nodes) + rows, cut[rows]] = 0.0
    points.positions = np.concatenate([nodes, positions])
    points.values, points.ends, points.cut = values, ends.copy(), cut.copy()
    points.turn = points.cut  # cuts have divided in the order of their numbers
    return points
