"""Junctions: cuts that end on one another inside an element.

Each of them alone divides nothing there, and yet together they part the material. At a junction
every cut divides whatever its plane crosses. Of the facets between the pieces that this leaves,
those inside the extent of a cut keep apart; pieces that meet in another facet are one part. Several
cuts make a junction of a cell if that leaves more parts than what each goes through by itself.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.clip import Partition, facets_between
from verify.xfem.crossing import AT_END, REACH, level_and_depth
from verify.xfem.cuts import Cut
from verify.xfem.mesh import connected
from verify.xfem.zero_points import ZeroPoints

_ASIDE = 1e-4  # element sizes: steps of difference quotients, and to beside the end of a cut


class _Facets(NamedTuple):
    """Facets between two pieces of one cell: points (f, d), pieces (f,) and (f,)."""

    points: Ints
    first: Ints
    second: Ints


def junction_cuts(
    partition: Partition,
    ends: Sequence[Ints],
    divide_all: Callable[[Ints, Bools], Partition],
    cuts: Sequence[Cut],
    sizes: Floats,
    known: Bools | None = None,
) -> Bools:
    """Which cuts (m, cuts) part which cells at a junction.

    Parameters
    ----------
    partition : Partition
        Cells divided by the cuts that go through them.
    ends : sequence of int arrays
        For each cut the cells in pieces of which it ends.
    divide_all : callable
        Divides the cells (q,) by the cuts (m, cuts) whatever their ends.
    cuts : sequence of Cut
    sizes : (m,) float array
        Longest edges of the cells, in metres.
    known : (m,) bool array, optional
        Cells with a junction before: they keep one as cuts grow.
    """
    meets = _meeting_cuts(partition, ends, len(sizes), known)
    suspects = meets.any(axis=1)
    if not suspects.any():
        return meets
    divided = divide_all(np.flatnonzero(suspects), meets)
    # facets outside the extent of every cut join their pieces to parts
    facets = _inner_facets(divided, suspects)
    inside = _inside_extent(divided, facets, cuts, sizes)
    joining = ~inside.any(axis=1)
    part = connected(len(divided.parent), facets.first[joining], facets.second[joining])
    solid = divided.solid
    first = np.unique(part[solid], return_index=True)[1]
    parts = np.bincount(divided.parent[solid][first], minlength=len(sizes))
    more = parts > np.bincount(partition.parent[partition.solid], minlength=len(sizes))
    if known is not None:
        more |= known & suspects
    # of the cuts those that keep two parts asunder
    forced = np.zeros_like(meets)
    apart = part[facets.first] != part[facets.second]
    facet, cut = np.nonzero(inside & apart[:, None])
    forced[divided.parent[facets.first[facet]], cut] = True
    forced[~more] = False
    return forced


def pieces_of_one_part(
    partition: Partition, cuts: Sequence[Cut], sizes: Floats, cells: Bools
) -> Ints:
    """Pairs (t, 2) of pieces of some cells (m,) that no cut keeps apart."""
    if not cells.any():
        return np.empty((0, 2), dtype=np.int64)
    facets = _inner_facets(partition, cells)
    joining = ~_inside_extent(partition, facets, cuts, sizes).any(axis=1)
    pairs = np.stack([facets.first[joining], facets.second[joining]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _meeting_cuts(
    partition: Partition, ends: Sequence[Ints], cells: int, known: Bools | None
) -> Bools:
    """Which cuts (m, cuts) meet which cells, where several do and one at least ends."""
    meets = np.zeros((cells, len(ends)), dtype=bool)
    for cut, some in enumerate(ends):
        meets[some, cut] = True
    ending = meets.any(axis=1) if known is None else meets.any(axis=1) | known
    piece, cut = np.nonzero((partition.label != 0) & ending[partition.parent, None])
    meets[partition.parent[piece], cut] = True
    meets[meets.sum(axis=1) < 2] = False
    return meets


def _inner_facets(partition: Partition, cells: Bools) -> _Facets:
    """Facets between sub-simplices in different solid pieces of one of some cells (m,)."""
    sub = partition.simplices
    sub = sub[
        cells[partition.parent[sub.piece]] & partition.solid[sub.piece] & (sub.fraction > 0.0)
    ]
    return _Facets(*facets_between(partition.parent, sub.piece, sub.points))


def _inside_extent(
    partition: Partition, facets: _Facets, cuts: Sequence[Cut], sizes: Floats
) -> Bools:
    """Which facets lie inside the extent of each cut that has their pieces on its two sides."""
    label, positions = partition.label, partition.points.positions
    found = np.zeros((len(facets.points), len(cuts)), dtype=bool)
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
            # corners past the end of a facet that begins inside the extent
            past = (depth < -AT_END * size) & (depth > depth.max(axis=1, keepdims=True) - size)
            past &= (depth > AT_END * size).any(axis=1, keepdims=True)
            row, corner = np.nonzero(past)
            if len(row):
                inside[row, corner] = reached(
                    cuts, index, partition.points, points[row, corner], size[row, 0]
                )
        found[rows, index] = (inside & (np.abs(level) <= REACH * size)).all(axis=1)
    return found


def reached(cuts: Sequence[Cut], index: int, zero: ZeroPoints, points: Ints, size: Floats) -> Bools:
    """Which points past the end of a cut it reaches all the same: it ends on another cut there.

    A cut that is bent inside an element is realised a little beside where it was given. A branch
    that ends on the given one goes on to the realised one, over the points between the two.

    ::

        branch ──────────┤     ×     ┆
                 its end, on   point  realised stem
              the given stem

    So a point × counts if the stem as given and as realised lie on its two sides, the end is on the
    given stem, and what is just inside of the end lies beyond the given stem, seen from ×.
    Plain branches need this as well as junctions.

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

    The depth t is a distance from the end, negative here: its slope is that direction, and the end
    x − t ∇t/‖∇t‖. Where two ends are equally near, the difference quotient is a mean of both.
    """
    step = _ASIDE * size
    slope = np.empty_like(points)
    for axis, unit in enumerate(np.eye(points.shape[1])):
        ahead, behind = (cut.depth(points + way * step[:, None] * unit) for way in (0.5, -0.5))
        slope[:, axis] = (ahead - behind) / step
    length = np.linalg.norm(slope, axis=1)
    slope /= np.where(length > 0.0, length, 1.0)[:, None]
    return points - cut.depth(points)[:, None] * slope, slope
