"""Division of simplices by linear level sets, into sub-simplices with exact volume shares.

The part of a simplex on one side of a plane is a staircase of simplices. Take the grid of all pairs
of a plus vertex p and a minus vertex m; every lattice path through it gives one sub-simplex. Its
vertices are corners, or points z_pm = s p + r m of the zero set. Here r = φ_p/(φ_p − φ_m) and s =
−φ_m/(φ_p − φ_m). Along a path each vertex brings in one new corner, so the determinant is
triangular. The volume share is then a *product* of positive r and s: nothing cancels, however thin
the sliver. Paths follow the order of the corners; with corners ordered by their global number the
sub-simplices of neighbours match on shared faces.

A triangle with a above, b and c below, and zero points ab, ac, has three of them:

    above   a ab ac   r_ab r_ac
    below   b ab ac   s_ab r_ac
    below   b c ac    s_ac

The first zero point of a path lies on an edge from the corner before it (a, b or c). It brings in
the other end of that edge: m with r, p with s. Each step to a next m brings that m in with its r, a
step to a next p with its s. The quadrilateral ab ac c b has the diagonal b–ac: from the smaller
corner number.

Where a cut ends, the cells that it divides have points on faces and edges that their undivided
neighbours do not know of. Bisected at these (`bisected`), the neighbours match again.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import combinations, pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.compiled import njit
from verify.xfem.arrays import Bools, Floats, Ints, Sides
from verify.xfem.mesh import equal_rows, facets_of
from verify.xfem.zero_points import ZeroPoints

_Path = list[tuple[int, int]]

# Share in the volume of its cell up to which a piece is of round-off size: less is lost in the sum
# of the volumes of the pieces.
ROUND_OFF_SHARE = np.finfo(float).eps


class Staircase(NamedTuple):
    """Sub-simplices of a clipped simplex, for every pattern of signs: a table.

    The pattern of a simplex is Σ 2^k over the corners k on the plus side. Its sub-simplices are
    the entries ``start[pattern]`` to ``start[pattern + 1]`` of the other arrays.

    Attributes
    ----------
    start : (2^corners + 1,) int array
        First entry of each pattern; patterns without a sign change have none.
    plus, minus : (entries, corners) int array
        Sub-simplex vertex k is z_ab with a = plus, b = minus; a corner if a = b.
    factors : (entries, corners, 3) int array
        (0 for r or 1 for s, a, b): the volume share is the product over these.
    side : (entries,) int8 array
        +1 or −1.
    sign : (entries,) int8 array
        Orientation relative to the simplex: +1 or −1, the same wherever the zero points are.
    """

    start: Ints
    plus: Ints
    minus: Ints
    factors: Ints
    side: Sides
    sign: Sides


@cache
def staircase(corners: int) -> Staircase:
    """Make the staircase of a simplex with that many corners."""
    start, plus, minus, factors, side = [0], [], [], [], []
    for pattern in range(2**corners):
        above = [k for k in range(corners) if pattern >> k & 1]
        below = [k for k in range(corners) if not pattern >> k & 1]
        for sign, vertices, steps in _sub_simplices(above, below) if above and below else ():
            plus.append([a for a, _ in vertices])
            minus.append([b for _, b in vertices])
            # filled up with s_00, which `_set_parts` takes for one
            factors.append(steps + [(1, 0, 0)] * (corners - len(steps)))
            side.append(sign)
        start.append(len(side))
    ends = np.eye(corners)[np.array([plus, minus])]
    return Staircase(
        np.array(start),
        np.array(plus),
        np.array(minus),
        np.array(factors),
        np.array(side, dtype=np.int8),
        # with all zero points in the middle of their edges
        np.sign(np.linalg.det(0.5 * (ends[0] + ends[1]))).astype(np.int8),
    )


def _sub_simplices(
    above: list[int], below: list[int]
) -> Iterator[tuple[int, _Path, list[tuple[int, int, int]]]]:
    """Yield (side, vertices, factors) of all sub-simplices."""
    end = len(above) - 1, len(below) - 1
    for side, own in ((1, above), (-1, below)):
        for first in range(len(own)):
            corners = [(corner, corner) for corner in own[: first + 1]]
            for path in _lattice_paths((first, 0) if side > 0 else (0, first), end):
                points = [(above[i], below[j]) for i, j in path]
                # the coefficient with which each vertex of the path brings in its new corner
                steps = [(int(side < 0), *points[0])]
                steps += [(int(k > i), above[k], below[l]) for (i, _), (k, l) in pairwise(path)]
                yield side, corners + points, steps


def _lattice_paths(start: tuple[int, int], end: tuple[int, int]) -> Iterator[_Path]:
    """Yield monotone paths from start to end, one step in one direction at a time."""
    down, right = end[0] - start[0], end[1] - start[1]
    for turns in combinations(range(down + right), down):
        path = [start]
        for step in range(down + right):
            i, j = path[-1]
            path.append((i + 1, j) if step in turns else (i, j + 1))
        yield path


@dataclass(frozen=True)
class Simplices:
    """Simplices inside cells.

    Attributes
    ----------
    piece : (q,) int array
        Piece, or whatever else a simplex hands on to what it is divided into.
    points : (q, c) int array
        Numbers of the vertices.
    barycentric : (q, c, c) float array
        Barycentric coordinates of the vertices (second axis) in the cell.
    fraction : (q,) float array
        Share in the volume of the cell.
    sign : (q,) int8 array
        Orientation in the cell, +1 or −1: from how it came about, hence right for any sliver. It is
        for bodies whose cuts grow (`verify.simulator`); nothing here reads it.
    """

    piece: Ints
    points: Ints
    barycentric: Floats
    fraction: Floats
    sign: Sides

    @staticmethod
    def of_cells(piece: Ints, cells: Ints) -> "Simplices":
        """Take whole cells (q, c) as simplices."""
        count, corners = cells.shape
        eye = np.broadcast_to(np.eye(corners), (count, corners, corners))
        return Simplices(piece, cells, eye, np.ones(count), np.ones(count, dtype=np.int8))

    def __len__(self) -> int:
        return len(self.piece)

    def __getitem__(self, rows: NDArray) -> "Simplices":
        """Return some of them."""
        return Simplices(*(x[rows] for x in vars(self).values()))

    def __add__(self, other: "Simplices") -> "Simplices":
        """Return them and others."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Simplices(*(np.concatenate(pair) for pair in pairs))


def staircase_entries(plus: Bools) -> tuple[Ints, Ints]:
    """Find entries (k,) of staircase for simplices with signs (q, c); the simplex (k,) of each."""
    stairs = staircase(plus.shape[1])
    pattern = plus @ (1 << np.arange(plus.shape[1]))
    count = stairs.start[pattern + 1] - stairs.start[pattern]
    of = np.repeat(np.arange(len(plus)), count)
    within = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
    return stairs.start[pattern][of] + within, of


def divided(simplices: Simplices, zero: ZeroPoints, cut: Ints, below: Ints) -> Simplices:
    """Divide simplices by cuts; those that are not clipped come first.

    Parameters
    ----------
    simplices : Simplices
    zero : ZeroPoints
        Of all cuts; points of these are added.
    cut : (p,) int array
        Cut that divides each piece; any if none does.
    below : (p,) int array
        Piece that takes the minus side of each piece; −1 if that is not divided.
    """
    touched = np.flatnonzero(below[simplices.piece] >= 0)
    piece = simplices.piece[touched]
    plus = zero.values[simplices.points[touched], cut[piece, None]] >= 0.0
    above, beneath = plus.all(axis=1), ~plus.any(axis=1)
    moved, clipped = simplices.piece.copy(), np.zeros(len(simplices), dtype=bool)
    moved[touched[beneath]] = below[piece[beneath]]
    clipped[touched] = ~above & ~beneath
    whole = Simplices(moved, *list(vars(simplices).values())[1:])[~clipped]
    crossed = simplices[clipped]
    if len(crossed) == 0:
        return whole
    own = cut[crossed.piece]
    order = np.argsort(crossed.points, axis=1, kind="stable")
    row = np.arange(len(crossed))[:, None]
    ids, corners = crossed.points[row, order], crossed.barycentric[row, order]
    level = zero.values[ids, own[:, None]]
    number = zero.on_edges(own, ids)
    entry, of = staircase_entries(level >= 0.0)
    stairs = staircase(ids.shape[1])
    points, share = np.empty((len(of), ids.shape[1]), dtype=np.int64), np.ones(len(of))
    places = np.empty((*points.shape, ids.shape[1]))
    _set_parts(
        level, corners, number, stairs.plus, stairs.minus, stairs.factors, entry, of, points,
        places, share,
    )  # fmt: skip
    swaps = sum(
        crossed.points[:, i] > crossed.points[:, j] for i, j in combinations(range(ids.shape[1]), 2)
    )
    turned = (1 - 2 * (np.asarray(swaps) % 2)).astype(np.int8)
    new = Simplices(
        np.where(stairs.side[entry] > 0, crossed.piece[of], below[crossed.piece[of]]),
        points,
        places,
        crossed.fraction[of] * share,
        crossed.sign[of] * turned[of] * stairs.sign[entry],
    )
    zero.divided(new.points)
    return whole + new


@njit(cache=True)
def _set_parts(level, corners, number, plus, minus, factors, entry, of, points, places, share):
    """Write points (k, c), their coordinates (k, c, c), the share (k,) of each part of a simplex.

    z_pm = s p + r m on the edge of p, above, and m, below; the share is Π r s along its path.
    """
    size = points.shape[1]
    for k in range(len(entry)):
        e, q = entry[k], of[k]
        for i in range(size):
            p, m = plus[e, i], minus[e, i]
            points[k, i] = number[q, p, m]
            s, r = 1.0, 0.0
            if p != m:
                across = level[q, p] - level[q, m]
                s, r = -level[q, m] / across, level[q, p] / across
            for j in range(size):
                places[k, i, j] = s * corners[q, p, j] + r * corners[q, m, j]
            kind, p, m = factors[e, i]
            if p != m:
                share[k] *= (-level[q, m] if kind else level[q, p]) / (level[q, p] - level[q, m])


def bisected(simplices: Simplices, zero: ZeroPoints, numbers: Ints) -> Simplices:
    """Bisect simplices at the given points that lie on their edges.

    Parameters
    ----------
    simplices : Simplices
    zero : ZeroPoints
    numbers : (k,) int array
        Places of the points in `zero.ends`.
    """
    order = zero.in_order(numbers)
    ends, none = zero.ends[order], len(order)
    key, rank = np.unique(_edge_keys(ends[:, 0], ends[:, 1]), return_index=True)
    near = np.zeros(len(zero.positions), dtype=bool)
    near[ends] = True
    some = near[simplices.points].sum(axis=1) >= 2
    done, rest = simplices[~some], simplices[some]
    pairs = np.array(list(combinations(range(simplices.points.shape[1]), 2)))
    while len(rest):
        # a simplex is bisected at the first of the points on its edges
        edges = _edge_keys(*rest.points[:, pairs.T].transpose(1, 0, 2))
        place = np.minimum(np.searchsorted(key, edges), len(key) - 1)
        first = np.where(key[place] == edges, rank[place], none)
        edge = first.argmin(axis=1)
        first = first[np.arange(len(rest)), edge]
        done, rest = done + rest[first == none], rest[first < none]
        first, edge = first[first < none], pairs[edge[first < none]]
        rest = _halves(rest, zero, order[first], edge)
    return done


def facets_between(parent: Ints, piece: Ints, points: Ints) -> tuple[Ints, Ints, Ints]:
    """Find facets (f, d) of sub-simplices between two pieces of a cell, and both pieces (f,), (f,).

    It relies on sub-simplices of a cell that match facet by facet: `divided` makes them so by the
    order of corners, `bisected` beside the ends of cuts.

    Parameters
    ----------
    parent : (p,) int array
        Cell of each piece.
    piece : (q,) int array
    points : (q, d + 1) int array
        Numbers of the vertices.
    """
    facets, piece = np.sort(facets_of(points), axis=1), np.repeat(piece, points.shape[1])
    first, second = equal_rows(np.column_stack([parent[piece], facets]))
    met = piece[first] != piece[second]
    return facets[first[met]], piece[first[met]], piece[second[met]]


def _edge_keys(one: Ints, other: Ints) -> Ints:
    return np.minimum(one, other) << 32 | np.maximum(one, other)


def _halves(simplices: Simplices, zero: ZeroPoints, at: Ints, edge: Ints) -> Simplices:
    """Halve simplices at points (q,), by place in `ends`, on their edges (q, 2) of corners."""
    row, ends = np.arange(len(simplices)), zero.ends[at]
    turned = simplices.points[row, edge[:, 0]] != ends[:, 0]
    plus, minus = np.where(turned[:, None], edge[:, ::-1], edge).T
    r, s = zero.shares(zero.cut[at], ends[:, 0], ends[:, 1])
    corners = simplices.barycentric
    middle = s[:, None] * corners[row, plus] + r[:, None] * corners[row, minus]
    halves = []
    for corner, share in ((plus, s), (minus, r)):
        points, barycentric = simplices.points.copy(), corners.copy()
        points[row, corner], barycentric[row, corner] = zero.nodes + at, middle
        halves.append(
            Simplices(
                simplices.piece, points, barycentric, simplices.fraction * share, simplices.sign
            )
        )
    return halves[0] + halves[1]


@dataclass(frozen=True)
class Partition:
    """Pieces of some cells and their sub-simplices.

    Attributes
    ----------
    parent : (p,) int array
        Cell of each piece.
    label : (p, cuts) int8 array
        Side of each cut that split the piece off; 0 if the cut does not split its cell.
    simplices : Simplices
        Sub-simplices of the pieces; their vertices are numbers in `points`.
    points : ZeroPoints
        Mesh nodes and zero points.
    snapped : int
        How many nodal level-set values within round-off were taken as exactly zero.
    absorbed_by : (p,) int array
        Piece that takes each piece of round-off size (`ROUND_OFF_SHARE`); itself for the others.
    one_part : (t, 2) int array
        Pairs of pieces of one cell that no cut keeps apart: they are one part.
    """

    parent: Ints
    label: Sides
    simplices: Simplices
    points: ZeroPoints
    snapped: int
    absorbed_by: Ints
    one_part: Ints = field(default_factory=lambda: np.empty((0, 2), dtype=np.int64))

    @staticmethod
    def whole(cells: Ints, chosen: Ints, points: ZeroPoints, snapped: int) -> "Partition":
        """Make one piece of each chosen cell, before any cut."""
        label = np.zeros((len(chosen), points.values.shape[1]), dtype=np.int8)
        simplices = Simplices.of_cells(np.arange(len(chosen)), cells[chosen])
        return Partition(chosen, label, simplices, points, snapped, np.arange(len(chosen)))

    @property
    def solid(self) -> Bools:
        """(p,) whether a piece is there: it is not of round-off size."""
        return self.absorbed_by == np.arange(len(self.parent))

    @property
    def fraction(self) -> Floats:
        """(p,) share of each piece in the volume of its cell."""
        sub = self.simplices
        return np.bincount(sub.piece, sub.fraction, minlength=len(self.parent))

    def crossed_edges(self, cut: Ints) -> tuple[Ints, Ints]:
        """Find edges (q, 2) from plus to minus that the cut of a piece crosses, and the piece (q,).

        Parameters
        ----------
        cut : (p,) int array
            One cut for each piece, −1 for none. Of pieces that it has divided already no edges
            are given.
        """
        sub = self.simplices
        whole = (cut >= 0) & (self.label[np.arange(len(cut)), cut] == 0)
        rows = np.flatnonzero(whole[sub.piece])
        plus = self.points.values[sub.points[rows], cut[sub.piece[rows], None]] >= 0.0
        row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
        rows = rows[row]
        return np.stack([sub.points[rows, a], sub.points[rows, b]], axis=1), sub.piece[rows]

    def only_split(self) -> "Partition":
        """Leave out the cells that no cut went through; order the pieces by cell."""
        split = (self.label != 0).any(axis=1)
        order = np.flatnonzero(split)
        order = order[np.argsort(self.parent[order], kind="stable")]
        number = np.full(len(split), -1)
        number[order] = np.arange(len(order))
        kept = self.simplices[split[self.simplices.piece]]
        return replace(
            self,
            parent=self.parent[order],
            label=self.label[order],
            simplices=replace(kept, piece=number[kept.piece]),
            absorbed_by=number[self.absorbed_by[order]],
        )

    def absorbed(self) -> "Partition":
        """Give the sub-simplices of pieces of round-off size to the pieces that take them."""
        into = self.absorbed_by
        while not np.array_equal(further := into[into], into):
            into = further
        sub = self.simplices[self.simplices.fraction > 0.0]
        return replace(self, simplices=replace(sub, piece=into[sub.piece]), absorbed_by=into)
