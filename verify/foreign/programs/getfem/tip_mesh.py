"""Triangles that show tip functions: parted along the cuts up to the tips, fine towards them."""

import numpy as np

_FINE, _GRADED, _LEAST = 0.3, 0.15, 1e-4  # of an element; of the distance to the tip; of an element
_NEAR = 1e-9  # of an element


class TipMesh:
    """Cells of an answer.

    Parameters
    ----------
    case : Case
    body : CutBody
    split : SplitMesh
        Of the elements that are cut wholly.
    areas : TipAreas

    Attributes
    ----------
    points, cells : (n, 2), (m, 3) arrays
        With twin nodes along the cuts.
    parent : (m,) int array
        Element of each cell.
    """

    def __init__(self, case, body, split, areas):
        self._near = _NEAR * case.problem["size"]
        keys = (split.points / self._near).round()
        _, first, row = np.unique(keys, axis=0, return_index=True, return_inverse=True)
        self.points, self.cells = split.points[first], row.ravel()[split.cells]
        self.parent = split.parent
        for tip in areas.tips:
            self._part_to(tip)
        while self._refine(areas, case.problem["size"]):
            pass
        self._double(body.cuts, areas.tips)

    def _part_to(self, tip):
        """Divide the cells that a tip is in or on, so that it is a node of each."""
        gap = np.linalg.norm(self.points - tip, axis=1)
        if gap.min() > self._near:
            self.points = np.vstack([self.points, tip])
            gap = np.append(gap, 0.0)
        centre = int(gap.argmin())
        corners = self.points[self.cells]
        side = np.roll(corners, -1, axis=1) - corners  # from each corner to the next
        height = _cross(side, tip - corners) / np.linalg.norm(side, axis=2)
        here = (height > -self._near).all(axis=1) & (self.cells != centre).all(axis=1)
        fans = [(k, fan) for k in np.flatnonzero(here) for fan in self._fan(k, centre)]
        kept = np.flatnonzero(~here)
        source = np.concatenate([kept, [k for k, _ in fans]]).astype(int)
        self.cells = np.vstack([self.cells[kept], *(np.array([fan]) for _, fan in fans)])
        self.parent = self.parent[source]

    def _fan(self, cell, centre):
        """Triangles around a point of a cell, to all nodes that lie on its border."""
        a, b, c = corners = self.points[self.cells[cell]]
        height = np.array([
            _cross(end - start, self.points - start) / np.linalg.norm(end - start)
            for start, end in ((a, b), (b, c), (c, a))
        ])  # fmt: skip
        on = (height > -self._near).all(axis=0) & (np.abs(height) < self._near).any(axis=0)
        border, middle = np.flatnonzero(on), corners.mean(axis=0)
        arm = self.points[border] - middle
        border = border[np.argsort(np.arctan2(arm[:, 1], arm[:, 0]))]
        for start, end in zip(border, np.roll(border, -1), strict=True):
            edges = self.points[[start, end]] - self.points[centre]
            if _cross(*edges) > self._near * np.linalg.norm(edges, axis=1).max():
                yield [centre, start, end]

    def _refine(self, areas, size):
        """Halve longest edges (Rivara 1984) where cells are too large; say whether any was."""
        around, longest = [[0, 1], [1, 2], [2, 0]], np.arange(len(self.cells))
        edges = np.sort(self.cells[:, around], axis=2)
        ends, edge = np.unique(edges.reshape(-1, 2), axis=0, return_inverse=True)
        edge = edge.reshape(-1, 3)
        length = np.linalg.norm(np.diff(self.points[ends], axis=1)[:, 0], axis=1)
        turn = length[edge].argmax(axis=1)
        middle = self.points[self.cells].mean(axis=1)
        distance = np.min([np.linalg.norm(middle - tip, axis=1) for tip in areas.tips], axis=0)
        wanted = np.clip(_GRADED * distance, _LEAST * size, _FINE * size)
        large = areas.elements[self.parent] & (length[edge].max(axis=1) > wanted)
        halved = np.zeros(len(ends), dtype=bool)
        halved[edge[longest, turn][large]] = True
        while True:
            more = halved[edge].any(axis=1)
            if halved[edge[longest, turn][more]].all():
                break
            halved[edge[longest, turn][more]] = True
        if not halved.any():
            return False
        new = np.where(halved, len(self.points) + np.cumsum(halved) - 1, -1)
        self.points = np.vstack([self.points, self.points[ends[halved]].mean(axis=1)])
        order = (turn[:, None] + np.arange(3)) % 3
        a, b, c = np.take_along_axis(self.cells, order, axis=1).T
        ab, bc, ca = new[np.take_along_axis(edge, order, axis=1)].T
        pieces = [(ab < 0, (a, b, c))]
        for side, (start, end, tip) in ((ca, (c, a, ab)), (bc, (b, c, ab))):
            pieces += [((ab >= 0) & (side < 0), (start, end, tip))]
            pieces += [((ab >= 0) & (side >= 0), (start, side, tip))]
            pieces += [((ab >= 0) & (side >= 0), (side, end, tip))]
        self.cells = np.vstack([np.column_stack(part)[mark] for mark, part in pieces])
        self.parent = np.concatenate([self.parent[mark] for mark, _ in pieces])
        return True

    def _double(self, cuts, tips):
        """Give the nodes on the cuts, tips in the body left out, a twin below and above."""
        middle = self.points[self.cells].mean(axis=1)
        gap = np.linalg.norm(self.points[:, None] - tips, axis=2).min(axis=1)
        above, self._facets = np.zeros(self.cells.shape, dtype=int), []
        for cut in cuts:
            level, beyond = cut.level(self.points)[0], cut.beyond(self.points)
            flat = (np.abs(level) < self._near) & (beyond < self._near)
            inside = (flat & (gap > self._near))[self.cells]
            upper = cut.level(middle)[0] > 0
            above[inside & upper[:, None]] = 1
            on = flat[self.cells]
            rows = (on.sum(axis=1) == 2) & inside.any(axis=1) & ~upper
            self._facets.append(self.points[self.cells[rows][on[rows]].reshape(-1, 2)])
        keys = np.column_stack([self.cells.ravel(), above.ravel()])
        keys, row = np.unique(keys, axis=0, return_inverse=True)
        self.points, self.cells = self.points[keys[:, 0]], row.reshape(self.cells.shape)

    def facets(self):
        """Corners (f, 2, 2) of the facets on the cuts."""
        return np.vstack(self._facets)


def _cross(one, other):
    return one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
