"""One number for each point where cuts meet the mesh, however often and in whatever order.

A zero point belongs to the simplex spanned by some mesh nodes (its support) and to the zero sets
of some cuts. If the support has one node more than there are cuts, these sets say which point it
is; otherwise the edge on which it was found does.
"""

from typing import NamedTuple

import numpy as np

from verify.simulator.arrays import GrowingArray, RowNumbers
from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.zero_points import ZeroPoints

NODES, CUTS = 4, 3  # a point of a tetrahedron has at most that many
NONE = np.iinfo(np.int64).max  # no further node or cut
_WIDTH = NODES + CUTS


class FoundPoints(NamedTuple):
    """What is asked of the points of a patch, as in `ZeroPoints`."""

    positions: Floats
    values: Floats
    ends: Ints
    cut: Ints


class PointNumbers:
    """Numbers of zero points: mesh nodes keep theirs, zero points follow.

    Attributes
    ----------
    nodes : int
        Number of mesh nodes.
    positions : GrowingArray
        (k, s) of the zero points, in metres.
    ends : GrowingArray
        (k, 2) numbers of the ends (plus, minus) of an edge on which each lies.
    cut : GrowingArray
        (k,) cut whose zero it is on that edge.
    met : (nodes, cuts) bool array
        Whether a cut runs exactly through a mesh node; of a growing cut that may change.
    """

    def __init__(self, nodes: int, space: int) -> None:
        self.nodes = nodes
        self.positions = GrowingArray(np.empty((0, space)))
        self.ends = GrowingArray(np.empty((0, 2), dtype=np.int64))
        self.cut = GrowingArray(np.empty(0, dtype=np.int64))
        self._table = RowNumbers()
        self.met = np.zeros((nodes, 0), dtype=bool)
        self._supports = GrowingArray(np.empty((0, _WIDTH), dtype=np.int64))

    @property
    def supports(self) -> Ints:
        """(k, 7) mesh nodes (4) and cuts (3) of each zero point, ascending, padded at the end."""
        return self._supports.rows

    def number(self, points: ZeroPoints | FoundPoints, whole_nodes: Ints, cuts: Ints) -> Ints:
        """Numbers of all points of a patch: its nodes, then its zero points.

        Parameters
        ----------
        points : ZeroPoints or FoundPoints
            Of the patch.
        whole_nodes : int array
            Number in the whole mesh of each node of the patch.
        cuts : int array
            Number in the whole list of each cut of the patch.
        """
        local, ends = len(whole_nodes), points.ends
        numbers = np.concatenate([whole_nodes, np.full(len(ends), -1)])
        if len(ends) == 0:
            return numbers
        if (beyond := int(cuts.max()) + 1 - self.met.shape[1]) > 0:
            self.met = np.hstack([self.met, np.zeros((self.nodes, beyond), dtype=bool)])
        self.met[whole_nodes[:, None], cuts] = points.values[:local] == 0.0
        # ends that are zero points themselves come first
        while len(rest := np.flatnonzero(numbers[local:] < 0)):
            ready = rest[(numbers[ends[rest]] >= 0).all(axis=1)]
            own = numbers[ends[ready]]
            numbers[local + ready], new = self._number(own, cuts[points.cut[ready]])
            self.positions.append(points.positions[local + ready[new]])
            self.ends.append(own[new])
            self.cut.append(cuts[points.cut[ready[new]]])
        return numbers

    def _number(self, ends: Ints, cut: Ints) -> tuple[Ints, Ints]:
        """Numbers (k,) of the zero points of cuts (k,) on edges (k, 2), and the first new ones."""
        span, on = np.full((len(cut), NODES), NONE), np.full((len(cut), CUTS), NONE)
        span[:, :2], on[:, 0] = np.sort(ends, axis=1), cut
        if on_cuts := bool((ends >= self.nodes).any()):
            known = self.supports_of(ends)
            span = distinct_in_rows(known[:, :, :NODES].reshape(-1, 2 * NODES), NODES)
            first, second = known[:, 0, NODES:], known[:, 1, NODES:]
            common = np.where((first[:, :, None] == second[:, None, :]).any(axis=2), first, NONE)
            on = distinct_in_rows(np.hstack([on, common]), CUTS)
        key = np.hstack([span, on])
        if on_cuts:
            edge = (span < NONE).sum(axis=1) != (on < NONE).sum(axis=1) + 1
            key[edge] = -1
            key[edge, :3] = np.column_stack([cut, ends])[edge]
        number, new = self._table.number(key)
        on = on[new]
        if on_cuts:
            # a cut on which one end lies, and that runs exactly through the other
            others, ends = known[new, ::-1, NODES:], ends[new]
            at = np.nonzero((ends[:, :, None] < self.nodes) & (others < NONE))
            through = np.full(others.shape, NONE)
            through[at] = np.where(self.met[ends[at[:2]], others[at]], others[at], NONE)
            on = distinct_in_rows(np.hstack([on, through.reshape(-1, 2 * CUTS)]), CUTS)
        self._supports.append(np.hstack([span[new], on]))
        return self.nodes + number, new

    def supports_of(self, points: Ints) -> Ints:
        """(..., 7) mesh nodes and cuts of points (...), ascending, padded at the end."""
        found = np.full((*points.shape, _WIDTH), NONE)
        zero = points >= self.nodes
        found[..., 0] = points
        found[zero] = self.supports[points[zero] - self.nodes]
        return found

    def spans(self, nodes: Ints, points: Ints) -> Bools:
        """Whether each of some mesh nodes (q, c) spans the simplex of a point (q,).

        The weights of the others at the point are zero; its own may round to zero.
        """
        found = np.zeros(nodes.shape, dtype=bool)
        for spanned in self.supports_of(points)[:, :NODES].T:
            found |= nodes == spanned[:, None]
        return found


def distinct_in_rows(rows: Ints, most: int) -> Ints:
    """Distinct integers of each row, ascending, at most so many, padded with `NONE`."""
    found = np.sort(rows, axis=1)
    again = found[:, 1:] == found[:, :-1]
    again &= found[:, 1:] < NONE
    if again.any():
        found[:, 1:][again] = NONE
        found.sort(axis=1)
    return found[:, :most]
