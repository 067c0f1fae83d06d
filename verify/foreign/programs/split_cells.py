"""Simplices divided along a level set that is linear in each, and the answer on them."""

import numpy as np


def split_cells(cells, phi):
    """Divide simplices in which the level set has both signs.

    Parameters
    ----------
    cells : (m, k) int array
    phi : (n,) array
        At the nodes.

    Returns
    -------
    ends : (p, k, 2) int array
        The nodes between which each corner lies on the level set; twice the same for a node.
    number : (p,) int array
        Row of the cell that each part comes from.
    side : (p,) int array
        0 below, 1 above.
    """
    found = []
    for row, cell in enumerate(np.sort(cells, axis=1)):
        for side, sign in enumerate((-1, 1)):
            own = [int(v) for v in cell if sign * phi[v] > 0]
            others = [int(v) for v in cell if sign * phi[v] <= 0]
            if len(own) == 1:
                simplices = [[_end(own[0], own[0], phi)] + [_end(own[0], x, phi) for x in others]]
            else:
                if len(own) == 2:  # columns: the node, then the points towards the others
                    low, high = ([_end(o, o, phi)] + [_end(o, x, phi) for x in others] for o in own)
                else:
                    low = [_end(o, o, phi) for o in own]
                    high = [_end(o, others[0], phi) for o in own]
                simplices = [low[: j + 1] + high[j:] for j in range(len(low))]
            found += [(s, row, side) for s in simplices if len(set(s)) == len(s)]
    ends = np.array([row[0] for row in found], dtype=int)
    ends = ends.reshape(len(found), cells.shape[1], 2)
    number, side = (np.array([row[k] for row in found], dtype=int) for k in (1, 2))
    return ends, number, side


def _end(node, other, phi):
    if phi[other] == 0:
        return (other, other)
    return (min(node, other), max(node, other))


def place(ends, points, phi):
    """Points (…, d) on the level set between two nodes each."""
    return _between(ends, points[ends[..., 0]], points[ends[..., 1]], phi)


def _between(ends, first, second, phi):
    a, b = phi[ends[..., 0]], phi[ends[..., 1]]
    at_node = ends[..., 0] == ends[..., 1]
    t = np.where(at_node, 0.0, a / np.where(at_node, 1.0, a - b))[..., None]
    return (1 - t) * first + t * second


class SplitMesh:
    """The mesh divided along its cuts, with the nodes of the answer.

    Parameters
    ----------
    points, cells, phi : (n, d), (m, k), (n,) arrays
    cut : (m,) bool array
        Which cells are divided.
    side : (m,) int array
        Row of `group` for the others.
    group : (r, n) int array
        Number of the value that each node has below, above, …

    Attributes
    ----------
    points, cells : arrays
        Of the answer.
    """

    def __init__(self, points, cells, phi, cut, side, group):
        ends, number, part = split_cells(cells[cut], phi)
        whole = np.repeat(cells[~cut][:, :, None], 2, axis=2)
        ends = np.concatenate([whole, ends])
        self.side = np.concatenate([side[~cut], part])
        self.parent = np.concatenate([np.flatnonzero(~cut), np.flatnonzero(cut)[number]])
        values = group[self.side[:, None, None], ends]
        keys, row = np.unique(
            np.concatenate([ends, values], axis=2).reshape(-1, 4), axis=0, return_inverse=True
        )
        self._ends, self._groups, self._phi = keys[:, :2], keys[:, 2:], phi
        self.points = place(self._ends, points, phi)
        self.cells = row.reshape(ends.shape[:2])
        corners = self.points[self.cells]
        turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
        self.cells[turned, :2] = self.cells[turned, 1::-1]

    def values(self, u):
        """Values (p, c) at the nodes of the answer, of those (groups, c) of the groups."""
        return _between(self._ends, u[self._groups[:, 0]], u[self._groups[:, 1]], self._phi)

    def used(self, count):
        """Which of `count` groups an answer's node follows."""
        mark = np.zeros(count, dtype=bool)
        mark[self._groups] = True
        return mark

    def held(self, held):
        """Which components of the answer's nodes follow from what is held."""
        return held[self._groups].all(axis=1)

    def facets(self, real):
        """Corners (f, d, d) of the facets on the level set, seen from below, that are `real`."""
        on = np.where(self._ends[:, 0] == self._ends[:, 1], self._phi[self._ends[:, 0]] == 0, True)
        cells = self.cells[self.side == 0]
        flat = on[cells]
        rows = flat.sum(axis=1) == cells.shape[1] - 1
        corners = self.points[cells[rows][flat[rows]].reshape(-1, cells.shape[1] - 1)]
        return corners[real(corners.mean(axis=1))]
