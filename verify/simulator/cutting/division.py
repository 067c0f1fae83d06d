"""Plan of a division of cells by a cut, found first and done later, and the dof nodes after it.

A slot is a corner of a piece; slots that move together are a group (`verify.xfem.join`).
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from verify.simulator.arrays import distinct
from verify.simulator.cutting.patch import MeshPatch
from verify.xfem.arrays import Bools, Floats, Ints, Sides
from verify.xfem.clip import Partition


@dataclass(frozen=True)
class Division:
    """Pieces of a patch of them against those of the body.

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


class Renumbered(NamedTuple):
    """Dof node of each group at touched nodes (-1: of others); sources of new ones; a conflict.

    The conflict is a piece whose slot descends from another dof node than its group, or -1.
    """

    number: Ints
    source: Ints
    conflict: int


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
) -> Renumbered:
    """Give every group (p, d + 1) of slots its dof node, new ones from `count` on.

    A group keeps the dof node from which it descends; if several descend from one, that in which
    the node lies keeps it (else the first), and the others get new numbers and it as source.
    """
    piece, corner = np.nonzero(slots.solid[:, None] & slots.touched)
    mine, before = group[piece, corner], piece_cells[slots.old[piece], corner]
    groups = int(group.max(initial=-1)) + 1
    ancestor, away = np.full(groups, -1), np.ones(groups, dtype=bool)
    ancestor[mine] = before
    conflicts = piece[ancestor[mine] != before]
    if len(conflicts):
        return Renumbered(ancestor, ancestor[:0], int(conflicts[0]))
    away[mine[slots.home[piece, corner] & (before < mesh_nodes)]] = False
    known = np.flatnonzero(ancestor >= 0)
    known = known[np.lexsort((known, away[known], ancestor[known]))]
    keeps = np.ones(len(known), dtype=bool)
    keeps[1:] = ancestor[known[1:]] != ancestor[known[:-1]]
    parted = known[~keeps]
    parted = parted[np.lexsort((parted, ancestor[parted]))]
    number = ancestor.copy()
    number[parted] = count + np.arange(len(parted))
    return Renumbered(number, ancestor[parted], -1)
