"""Plan of a division of cells by a cut: found first, done later."""

from dataclasses import dataclass
from functools import cached_property

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
