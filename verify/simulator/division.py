"""Plan of a division of cells by a cut, found first and done later, the pieces before and after it.

Cells are divided as a patch, a few of them as a mesh of its own, so that work on them costs what
they are. A slot is a corner of a piece; slots that move together are a group (`verify.xfem.join`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from verify.simulator.point_numbers import GrowingArray, distinct, of_lists
from verify.xfem.arrays import Bools, Floats, Ints, Sides, XfemError
from verify.xfem.clip import Partition
from verify.xfem.mesh import SimplexMesh, connected


class MeshPatch(SimplexMesh):
    """Some cells of a mesh, with nodes and cells numbered in the order of the whole.

    Attributes
    ----------
    whole_cells, whole_nodes : int array
        Their numbers in the whole mesh, ascending.
    """

    whole_cells: Ints
    whole_nodes: Ints

    def __init__(
        self,
        points: Floats,
        extent: float,
        cells: Ints,
        nodes: Ints,
        local: Ints,
    ) -> None:
        # the whole mesh has been checked; its scale of round-off holds here too
        for name, value in (
            ("points", points[nodes]),
            ("cells", local),
            ("extent", extent),
            ("whole_cells", cells),
            ("whole_nodes", nodes),
        ):
            self.__dict__[name] = value


class PatchCutter:
    """Makes patches of a mesh without touching what lies outside them."""

    def __init__(self, mesh: SimplexMesh) -> None:
        self.mesh = mesh
        self._starts, self._around = mesh.node_cells

    def nodes_of(self, cells: Ints) -> Ints:
        """Find nodes of some cells, ascending."""
        return distinct(self.mesh.cells[cells])

    def cells_around(self, nodes: Ints) -> Ints:
        """Find cells that have one of the nodes, ascending."""
        return distinct(of_lists(self._starts, self._around, nodes))

    def patch(self, cells: Ints) -> MeshPatch:
        """Make the patch of these cells, given ascending."""
        mesh, nodes = self.mesh, self.nodes_of(cells)
        local = np.searchsorted(nodes, mesh.cells[cells])
        return MeshPatch(mesh.points, mesh.extent, cells, nodes, local)


class StoredPieces(NamedTuple):
    """Pieces of the cells of a mesh.

    Attributes
    ----------
    label : (p, cuts) int8 array
        Side of each cut on which a piece lies, 0 if the cut does not part it from anything.
    first : (m,) int array
        A piece of each cell.
    following : (p,) int array
        After each piece the next of its cell, or -1.
    """

    label: Sides
    first: Ints
    following: Ints

    def in_turn(self, cells: Ints) -> Iterator[tuple[Ints, Ints]]:
        """Go through the pieces of cells (q,): places in that list, and a piece of each."""
        rows, pieces = np.arange(len(cells)), self.first[cells]
        while len(rows):
            yield rows, pieces
            pieces = self.following[pieces]
            more = pieces >= 0
            rows, pieces = rows[more], pieces[more]

    def labelled(self, cells: Ints, cut: int) -> Bools:
        """Tell whether any piece of each cell has a side of the cut."""
        found = np.zeros(len(cells), dtype=bool)
        for rows, pieces in self.in_turn(cells):
            found[rows] |= self.label[pieces, cut] != 0
        return found

    def separated(self, cells: Ints, label: Sides, numbers: Ints, cut: int) -> Bools:
        """Tell whether a cut has split every stored piece of which each given piece may be a part.

        `numbers` says which cuts the columns of `label` (p, q) are.
        """
        every, some = np.ones(len(cells), dtype=bool), np.zeros(len(cells), dtype=bool)
        for rows, pieces in self.in_turn(cells):
            stored, side = self.label[pieces], label[rows]
            there = stored[:, numbers]
            fits = ((side == 0) | (there == 0) | (side == there)).all(axis=1)
            some[rows] |= fits
            every[rows] &= ~fits | (stored[:, cut] != 0)
        return some & every

    def match(self, cells: Ints, label: Sides, side: Sides) -> tuple[Ints, Bools]:
        """Find the stored piece (p,) of which each given one is a part, or -1; if labels differ.

        A piece is part of another of the same cell if every cut that made the other has it on the
        same `side`.
        """
        old, changed = np.full(len(cells), -1), np.zeros(len(cells), dtype=bool)
        for rows, pieces in self.in_turn(cells):
            stored = self.label[pieces]
            fits = (old[rows] < 0) & ((stored == 0) | (stored == side[rows])).all(axis=1)
            mine = rows[fits]
            old[mine] = pieces[fits]
            changed[mine] = (stored[fits] != label[mine]).any(axis=1)
        return old, changed


class TiedParts:
    """Which stored pieces are tied, though planes of cuts divide them: see `verify.xfem.crossing`.

    Parameters
    ----------
    cells : int
        Number of cells, of which each is a piece.

    Attributes
    ----------
    joint : (m,) bool array
        Cells that several cuts have parted together.
    """

    def __init__(self, cells: int) -> None:
        self.joint = np.zeros(cells, dtype=bool)
        self._part = GrowingArray(np.arange(cells))

    def still(self, tied: Ints, old: Ints) -> Ints:
        """Select pairs (t, 2) of new pieces that have not been apart before.

        `old` (p,) is the stored piece of each new one, -1 if it has none.
        """
        first, second = old[tied].T
        same = self._part.rows[first] == self._part.rows[second]
        return tied[same & (first >= 0) & (second >= 0)]

    def parted(self, tied: Ints, old: Ints) -> Bools:
        """Tell which new pieces (p,) come from a part that is several by now."""
        now = connected(len(old), *tied.T)
        known = np.flatnonzero(old >= 0)
        before = np.unique(self._part.rows[old[known]], return_inverse=True)[1]
        pairs = np.unique(np.stack([before, now[known]]), axis=1)
        found = np.zeros(len(old), dtype=bool)
        found[known] = (np.bincount(pairs[0]) > 1)[before]
        return found

    def store(self, tied: Ints, cell: Ints, place: Ints, count: int) -> None:
        """Take over new pieces, stored at `place` (p,), -1 if not at all.

        Parameters
        ----------
        tied : (t, 2) int array
        cell, place : (p,) int array
        count : int
            Number of stored pieces.
        """
        self._part.append(np.arange(len(self._part), count))
        if len(tied) == 0:
            self._part.rows[place[place >= 0]] = place[place >= 0]
            return
        now = connected(len(place), *tied.T)
        stored = np.flatnonzero(place >= 0)
        leader = np.full(len(place), count)
        np.minimum.at(leader, now[stored], place[stored])
        self._part.rows[place[stored]] = leader[now[stored]]
        self.joint[cell[tied[:, 0]]] = True


@dataclass(frozen=True)
class Division:
    """Pieces of a patch of the body, against the body's own.

    Attributes
    ----------
    patch : MeshPatch
    partition : Partition
        The patch, divided by the cuts near it.
    numbers : int array
        Of these cuts.
    cell, label, fraction, solid : (q,), (q, cuts), (q,), (q,) arrays
        Of each piece: cell, sides of all cuts, share of the cell, whether it has any.
    old : (q,) int array
        Piece of the body from which it comes.
    changed : (q,) bool array
        Whether it is not the same.
    """

    patch: MeshPatch
    partition: Partition
    numbers: Ints
    cell: Ints
    label: Sides
    fraction: Floats
    solid: Bools
    old: Ints
    changed: Bools

    @cached_property
    def changed_cells(self) -> Ints:
        """Cells of the pieces whose labels are new, ascending."""
        return distinct(self.cell[self.changed & self.solid])

    @cached_property
    def at_changed_cells(self) -> Bools:
        """Which nodes of the patch are nodes of these."""
        found = np.zeros(len(self.patch.whole_nodes), dtype=bool)
        found[self.patch.cells[np.searchsorted(self.patch.whole_cells, self.changed_cells)]] = True
        return found


class Slots(NamedTuple):
    """Pieces (p,) of a patch, the parts of split cells first, and their slots (p, d + 1).

    Attributes
    ----------
    cell, old : (p,) int array
        Cell of the mesh, and stored piece from which each comes.
    solid : (p,) bool array
        Whether it has a volume.
    touched, home : (p, d + 1) bool array
        Whether a slot is at a node of changed cells, and whether the node lies in the piece.
    """

    cell: Ints
    old: Ints
    solid: Bools
    touched: Bools
    home: Bools


def slots_before(division: Division, local: Ints, first_piece: Ints) -> Slots:
    """Find what the slots of a patch are before its dof nodes are numbered anew.

    Parameters
    ----------
    division : Division
    local : (p,) int array
        Place in the patch of the cell of each piece.
    first_piece : (m,) int array
        Of each cell.
    """
    patch, partition = division.patch, division.partition
    parts, cells = len(partition.parent), patch.cells[local]
    cell = patch.whole_cells[local]
    old, solid = first_piece[cell], np.ones(len(local), dtype=bool)
    old[:parts], solid[:parts] = division.old, division.solid
    home = np.ones(cells.shape, dtype=bool)
    above = partition.points.values[patch.cells[partition.parent]] >= 0.0
    label = partition.label[:, None]
    home[:parts] = ((label == 0) | ((label > 0) == above)).all(axis=2)
    return Slots(cell, old, solid, division.at_changed_cells[cells], home)


def number_groups(
    slots: Slots, group: Ints, piece_cells: Ints, mesh_nodes: int, count: int
) -> tuple[Ints, Ints]:
    """Give every group (p, d + 1) of slots its dof node, new ones from `count` on.

    A group keeps the dof node from which it descends. If several descend from one, the group in
    which the node lies keeps it, else the first. The others get new numbers, with it as source.
    Returns the dof node of each group at touched nodes (-1: of others), and the sources.

    Raises
    ------
    XfemError
        If a slot descends from another dof node than its group.
    """
    piece, corner = np.nonzero(slots.solid[:, None] & slots.touched)
    mine, before = group[piece, corner], piece_cells[slots.old[piece], corner]
    groups = int(group.max(initial=-1)) + 1
    ancestor, away = np.full(groups, -1), np.ones(groups, dtype=bool)
    ancestor[mine] = before
    conflicts = piece[ancestor[mine] != before]
    if len(conflicts):
        cell = slots.cell[conflicts[0]]
        raise XfemError(f"a cut would join parts of cell {cell} that are separate")
    away[mine[slots.home[piece, corner] & (before < mesh_nodes)]] = False
    known = np.flatnonzero(ancestor >= 0)
    known = known[np.lexsort((known, away[known], ancestor[known]))]
    keeps = np.ones(len(known), dtype=bool)
    keeps[1:] = ancestor[known[1:]] != ancestor[known[:-1]]
    parted = known[~keeps]
    parted = parted[np.lexsort((parted, ancestor[parted]))]
    number = ancestor.copy()
    number[parted] = count + np.arange(len(parted))
    return number, ancestor[parted]
