"""Pieces that a growing body has stored: labelled by cuts, and which of them no cut keeps apart."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from verify.simulator.arrays import GrowingArray
from verify.xfem.arrays import Bools, Ints, Sides
from verify.xfem.mesh import connected


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
        """Whether any piece of each cell has a side of the cut."""
        found = np.zeros(len(cells), dtype=bool)
        for rows, pieces in self.in_turn(cells):
            found[rows] |= self.label[pieces, cut] != 0
        return found

    def separated(self, cells: Ints, label: Sides, numbers: Ints, cut: int) -> Bools:
        """Whether a cut has split every stored piece of which each given piece may be a part.

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
    """Which stored pieces are tied, though planes of cuts divide them: see `verify.xfem.junctions`.

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
        """Those of the pairs (t, 2) of new pieces that have not been apart before.

        `old` (p,) is the stored piece of each new one, -1 if it has none.
        """
        first, second = old[tied].T
        same = self._part.rows[first] == self._part.rows[second]
        return tied[same & (first >= 0) & (second >= 0)]

    def parted(self, tied: Ints, old: Ints) -> Bools:
        """Which new pieces (p,) come from a part that is several by now."""
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
