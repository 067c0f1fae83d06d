"""Pieces of a growing body that no cut keeps apart, though planes of cuts divide them."""

import numpy as np

from verify.simulator.arrays import GrowingArray
from verify.xfem.arrays import Bools, Ints
from verify.xfem.mesh import connected


class TiedParts:
    """Which stored pieces are tied: see `verify.xfem.junctions`.

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
