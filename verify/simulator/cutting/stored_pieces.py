"""Pieces that a growing body has stored: one after the other in each cell, labelled by cuts."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Ints, Sides


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
