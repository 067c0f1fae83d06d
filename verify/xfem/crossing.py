"""Crossing of pieces by cuts: by one alone, and by several that end on one another.

A cut alone divides a piece only if it goes through. That is read off the zero points on the edges
of the piece: are they inside the extent of the cut?

Where several end in one point (2D) or along one line (3D) inside an element, none goes through, and
yet together they part the material. There every cut divides whatever its plane crosses, on trial.
Of the facets between the pieces that this leaves, those inside the extent of a cut keep apart;
pieces that meet in another facet are *tied*: one part. If no more parts result than by each cut
alone, the trial is dropped.

The rules for a cut that ends in a cell (`TipRule`) are told by `verify.xfem.pieces.split_cells`,
which calls all of this.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.clip import Partition, facets_between
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import connected
from verify.xfem.zero_points import ZeroPoints

TipRule = Literal["inside", "through", "nearest"]
Reached = Callable[[Ints, Floats], Bools]
AT_END = 1e-9  # element sizes: an end as near as that to an edge lies on it
REACH = 0.5  # element sizes: a zero point farther from the cut than that is not on it
_ASIDE = 1e-4  # element sizes: steps of difference quotients, and to beside the end of a cut


class Crossing(NamedTuple):
    """Where the zero set of a cut crosses the edges of pieces.

    Attributes
    ----------
    zero : (q,) int array
        Numbers of the points; edges that several simplices share may come several times.
    piece : (q,) int array
    size : (q,) float array
        Length of the longest edges of the element of that piece, in metres.
    pieces : int
        Number of pieces.
    """

    zero: Ints
    piece: Ints
    size: Floats
    pieces: int


def level_and_depth(cut: Cut, points: Floats) -> tuple[Floats, Floats]:
    """Level set (n,) and depth (n,) of a cut at points (n, d), in metres.

    Raises
    ------
    XfemError
        If the cut gives arrays of another shape, or NaN.
    """
    found = []
    for name, function in (("level set", cut.level_set), ("depth", cut.depth)):
        values = np.asarray(function(points), dtype=float)
        if values.shape != (len(points),) or np.isnan(values).any():
            what = type(cut).__name__
            raise XfemError(
                f"{what}: {name} of shape {values.shape} or NaN; expected ({len(points)},)"
            )
        found.append(values)
    return found[0], found[1]


def crossed_through(
    cut: Cut,
    positions: Floats,
    crossing: Crossing,
    tip: TipRule,
    reached: Reached | None = None,
) -> tuple[Bools, Bools]:
    """Which pieces (p,) a cut goes through, and in which (p,) it ends by the rule `inside`.

    Parameters
    ----------
    cut : Cut
    positions : (n, d) float array
        All numbered points, in metres.
    crossing : Crossing
    tip : {"inside", "through", "nearest"}
    reached : callable, optional
        Given numbers of points past the end and sizes of their elements, tells which belong to the
        cut all the same.
    """
    zero, piece, size, pieces = crossing
    if tip == "nearest":
        return _mostly_crossed(cut, positions, crossing), np.zeros(pieces, dtype=bool)
    wanted, at = np.unique(zero, return_inverse=True)
    level, depth = level_and_depth(cut, positions[wanted])
    # an end on an edge has gone through the element before it, and not into the one behind it
    margin = 1.0 if tip == "through" else -1.0
    inside = (np.abs(level[at]) <= REACH * size) & (depth[at] >= margin * AT_END * size)
    if reached is not None:
        near = (np.abs(level[at]) <= REACH * size) & (depth[at] > -size)
        past = np.flatnonzero(near & ~inside)
        if len(past):
            inside[past] = reached(zero[past], size[past])
    some, every = np.zeros(pieces, dtype=bool), np.zeros(pieces, dtype=bool)
    some[piece[inside]] = True
    if tip == "through":
        return some, every
    every[piece] = True
    every[piece[~inside]] = False
    return every, some & ~every


def _mostly_crossed(cut: Cut, positions: Floats, crossing: Crossing) -> Bools:
    """Which pieces a cut crosses as far as the centre of its section."""
    pairs, first = np.unique(np.stack([crossing.piece, crossing.zero]), axis=1, return_index=True)
    count = np.bincount(pairs[0], minlength=crossing.pieces)
    found = np.flatnonzero(count)
    sums = [np.bincount(pairs[0], x, minlength=crossing.pieces) for x in positions[pairs[1]].T]
    centres = np.stack(sums, axis=1)[found] / count[found, None]
    size = np.zeros(crossing.pieces)
    size[pairs[0]] = crossing.size[first]
    level, depth = level_and_depth(cut, centres)
    inside = (np.abs(level) <= REACH * size[found]) & (depth >= -AT_END * size[found])
    mostly = np.zeros(crossing.pieces, dtype=bool)
    mostly[found] = inside
    return mostly


class _Facets(NamedTuple):
    """Facets between two pieces of one cell: points (f, d), pieces (f,) and (f,)."""

    points: Ints
    first: Ints
    second: Ints


def meeting_cells(
    partition: Partition, ends: Sequence[Ints], cells: int, joint: Bools | None
) -> Bools:
    """Which cuts (m, cuts) meet which cells, where several do and one at least ends.

    Parameters
    ----------
    partition : Partition
        By the rule that a cut divides what it goes through.
    ends : sequence of int arrays
        For each cut the cells in pieces of which it ends.
    cells : int
        Number of cells of the mesh.
    joint : (m,) bool array, optional
        Further cells, which several have parted together before.
    """
    meets = np.zeros((cells, len(ends)), dtype=bool)
    for cut, some in enumerate(ends):
        meets[some, cut] = True
    ending = meets.any(axis=1) if joint is None else meets.any(axis=1) | joint
    piece, cut = np.nonzero((partition.label != 0) & ending[partition.parent, None])
    meets[partition.parent[piece], cut] = True
    meets[meets.sum(axis=1) < 2] = False
    return meets


def joint_cuts(
    trial: Partition,
    alone: Partition,
    cuts: Sequence[Cut],
    sizes: Floats,
    joint: Bools | None,
) -> Bools:
    """Which cuts (m, cuts) part which cells together, into more pieces than each one alone.

    Parameters
    ----------
    trial : Partition
        Of the cells of `meeting_cells` alone: every cut that meets them divides whatever its plane
        crosses.
    alone : Partition
        By the rule that a cut divides what it goes through.
    cuts : sequence of Cut
    sizes : (m,) float array
        Longest edges of the cells, in metres.
    joint : (m,) bool array, optional
        Cells that several have parted together before: they stay parted as cuts grow.
    """
    cells = len(sizes)
    chosen = np.zeros(cells, dtype=bool)
    chosen[trial.parent] = True
    facets = _inner_facets(trial, chosen)
    borne = _borne(trial, facets, cuts, sizes)
    loose = ~borne.any(axis=1)
    part = connected(len(trial.parent), facets.first[loose], facets.second[loose])
    solid = trial.solid
    first = np.unique(part[solid], return_index=True)[1]
    parts = np.bincount(trial.parent[solid][first], minlength=cells)
    more = parts > np.bincount(alone.parent[alone.solid], minlength=cells)
    if joint is not None:
        more |= joint & chosen
    through = np.zeros((cells, len(cuts)), dtype=bool)
    apart = part[facets.first] != part[facets.second]
    facet, cut = np.nonzero(borne & apart[:, None])
    through[trial.parent[facets.first[facet]], cut] = True
    through[~more] = False
    return through


def tied_pieces(partition: Partition, cuts: Sequence[Cut], sizes: Floats, cells: Bools) -> Ints:
    """Pairs (t, 2) of pieces of some cells (m,) that no cut keeps apart."""
    facets = _inner_facets(partition, cells)
    loose = ~_borne(partition, facets, cuts, sizes).any(axis=1)
    pairs = np.stack([facets.first[loose], facets.second[loose]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _inner_facets(partition: Partition, cells: Bools) -> _Facets:
    """Facets between sub-simplices in different solid pieces of one of some cells (m,)."""
    sub = partition.simplices
    sub = sub[
        cells[partition.parent[sub.piece]] & partition.solid[sub.piece] & (sub.fraction > 0.0)
    ]
    return _Facets(*facets_between(partition.parent, sub.piece, sub.points))


def _borne(partition: Partition, facets: _Facets, cuts: Sequence[Cut], sizes: Floats) -> Bools:
    """Which facets lie inside the extent of each cut that has their pieces on its two sides."""
    label, positions = partition.label, partition.points.positions
    borne = np.zeros((len(facets.points), len(cuts)), dtype=bool)
    for index, cut in enumerate(cuts):
        rows = np.flatnonzero(label[facets.first, index] * label[facets.second, index] < 0)
        if len(rows) == 0:
            continue
        points = facets.points[rows]
        size = sizes[partition.parent[facets.first[rows]]][:, None]
        level, depth = (
            x.reshape(points.shape) for x in level_and_depth(cut, positions[points.ravel()])
        )
        inside = depth >= -AT_END * size
        if not inside.all():
            past = (depth < -AT_END * size) & (depth > depth.max(axis=1, keepdims=True) - size)
            past &= (depth > AT_END * size).any(axis=1, keepdims=True)
            row, corner = np.nonzero(past)
            if len(row):
                inside[row, corner] = reached(
                    cuts, index, partition.points, points[row, corner], size[row, 0]
                )
        borne[rows, index] = (inside & (np.abs(level) <= REACH * size)).all(axis=1)
    return borne


def reached(cuts: Sequence[Cut], index: int, zero: ZeroPoints, points: Ints, size: Floats) -> Bools:
    """Which points past the end of a cut it reaches all the same: it ends on another cut there.

    A cut that is bent inside an element is realised a little beside where it was given. A branch
    that ends on the given one goes on to the realised one, over the points between the two.

    Parameters
    ----------
    cuts : sequence of Cut
    index : int
        Of the cut that ends.
    zero : ZeroPoints
    points : (q,) int array
        Numbers of points of its plane past its end.
    size : (q,) float array
        Of the cells in which they lie, in metres.
    """
    found = np.zeros(len(points), dtype=bool)
    at, realised = zero.positions[points], zero.values[points]
    near = np.abs(realised) <= size[:, None]
    near[:, index] = False
    for other in np.flatnonzero(near.any(axis=0)).tolist():
        cut = cuts[other]
        given = level_and_depth(cut, at)[0]
        between = near[:, other] & (given * realised[:, other] <= 0.0)
        between &= np.abs(given - realised[:, other]) > AT_END * size
        rows = np.flatnonzero(between & ~found)
        if len(rows) == 0:
            continue
        end, inwards = _end(cuts[index], at[rows], size[rows])
        off = AT_END * size[rows] + np.abs(level_and_depth(cuts[index], end)[0])
        level, depth = level_and_depth(cut, end)
        before = level_and_depth(cut, end + _ASIDE * size[rows, None] * inwards)[0]
        found[rows] = (np.abs(level) <= off) & (depth >= -off) & (before * given[rows] < 0.0)
    return found


def _end(cut: Cut, points: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Nearest end (q, space) of a cut to points past it, and the unit vectors that lead inwards.

    The depth is a distance from the end: its slope is that direction.
    """
    step = _ASIDE * size
    slope = np.empty_like(points)
    for axis, unit in enumerate(np.eye(points.shape[1])):
        ahead, behind = (cut.depth(points + way * step[:, None] * unit) for way in (0.5, -0.5))
        slope[:, axis] = (ahead - behind) / step
    length = np.linalg.norm(slope, axis=1)
    slope /= np.where(length > 0.0, length, 1.0)[:, None]
    return points - cut.depth(points)[:, None] * slope, slope
