"""Which pieces a cut goes through, and which cells are junctions.

A cut divides the pieces that it goes through: the zero points on the edges of such a piece lie
inside the extent of the cut. The same test serves a branch on a stem that goes through: the branch
splits the pieces that the stem leaves.

At a junction cuts end on one another inside an element. Each of them alone divides nothing there,
and yet together they part the material. There every cut divides whatever its plane crosses. Then
facets inside the extent of a cut keep their two pieces apart; pieces that meet in another facet are
one part. A cell is a junction if this leaves more parts than the cuts that go through it alone.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.clip import Partition, facets_between
from verify.xfem.cuts import Cut
from verify.xfem.mesh import connected
from verify.xfem.zero_points import ZeroPoints

TipRule = Literal["inside", "extended", "through", "nearest"]
Reached = Callable[[Ints, Ints, Floats], Bools]
AT_END = 1e-9  # element sizes: an end as near as that to an edge lies on it
REACH = 0.5  # element sizes: a zero point farther from the cut than that is not on it


class Crossing(NamedTuple):
    """Where the zero sets of cuts cross the edges of pieces, of each piece one cut.

    Attributes
    ----------
    cut : (q,) int array
    zero : (q,) int array
        Numbers of the points; edges that several simplices share may come several times.
    piece : (q,) int array
    size : (q,) float array
        Length of the longest edges of the element of that piece, in metres.
    pieces : int
        Number of pieces.
    """

    cut: Ints
    zero: Ints
    piece: Ints
    size: Floats
    pieces: int


def level_and_depth(cut: Cut, points: Floats) -> tuple[Floats, Floats]:
    """Compute the level set (n,) and depth (n,) of a cut at points (n, d), in metres.

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


def levels_and_depths(cuts: Sequence[Cut], of: Ints, points: Floats) -> tuple[Floats, Floats]:
    """Compute level set (n,) and depth (n,) at points (n, d), each of one of the cuts, in metres.

    Raises
    ------
    XfemError
        As `level_and_depth`.
    """
    found = np.empty((2, len(points)))
    order = np.argsort(of, kind="stable")
    for rows in np.split(order, np.flatnonzero(np.diff(of[order])) + 1):
        if len(rows):
            found[:, rows] = level_and_depth(cuts[of[rows[0]]], points[rows])
    return found[0], found[1]


def crossed_through(
    cuts: Sequence[Cut],
    positions: Floats,
    crossing: Crossing,
    tip: TipRule,
    reached: Reached | None = None,
    extensible: Callable[[Bools], Bools] | None = None,
) -> tuple[Bools, Bools]:
    """Tell which pieces (p,) their cuts go through, and in which (p,) they end.

    A cut goes through a piece by its zero points. By `inside` all must be inside the extent, by
    `through` one, by `nearest` their mean: by the last two it ends in none. By `extended` one is
    enough in a piece that may be divided past the end.

    Parameters
    ----------
    cuts : sequence of Cut
    positions : (n, d) float array
        All numbered points, in metres.
    crossing : Crossing
    tip : {"inside", "extended", "through", "nearest"}
    reached : callable, optional
        Given cuts, numbers of points past their ends and sizes of the elements, tells which points
        belong to the cut all the same.
    extensible : callable, optional
        Given which of the crossings (q,) are inside the extent, tells in which pieces (p,) a cut
        that ends there may be extended; for the rule `extended`.
    """
    cut, zero, piece, size, pieces = crossing
    if tip == "nearest":
        return _mostly_crossed(cuts, positions, crossing), np.zeros(pieces, dtype=bool)
    wanted, at = np.unique(zero * len(cuts) + cut, return_inverse=True)
    point, of = np.divmod(wanted, len(cuts))
    level, depth = levels_and_depths(cuts, of, positions[point])
    near, depth = np.abs(level[at]) <= REACH * size, depth[at]
    # an end on an edge has gone through the element before it, and not into the one behind it
    inside = near & (depth >= -AT_END * size)
    entered = near & (depth >= AT_END * size)
    if reached is not None:
        past = np.flatnonzero(near & (depth > -size) & ~inside)
        if len(past):
            inside[past] = entered[past] = reached(cut[past], zero[past], size[past])
    some, every = np.zeros(pieces, dtype=bool), np.zeros(pieces, dtype=bool)
    if tip == "through":
        some[piece[entered]] = True
        return some, every
    every[piece] = True
    every[piece[~inside]] = False
    if extensible is not None:
        some[piece[entered]] = True
        every |= some & extensible(inside)
    some[piece[inside]] = True
    return every, some & ~every


def _mostly_crossed(cuts: Sequence[Cut], positions: Floats, crossing: Crossing) -> Bools:
    """Tell which pieces have the centre of their section inside the extent of their cut."""
    pairs, first = np.unique(np.stack([crossing.piece, crossing.zero]), axis=1, return_index=True)
    count = np.bincount(pairs[0], minlength=crossing.pieces)
    found = np.flatnonzero(count)
    sums = [np.bincount(pairs[0], x, minlength=crossing.pieces) for x in positions[pairs[1]].T]
    centres = np.stack(sums, axis=1)[found] / count[found, None]
    size, cut = np.zeros(crossing.pieces), np.zeros(crossing.pieces, dtype=np.int64)
    size[pairs[0]], cut[pairs[0]] = crossing.size[first], crossing.cut[first]
    level, depth = levels_and_depths(cuts, cut[found], centres)
    inside = (np.abs(level) <= REACH * size[found]) & (depth >= -AT_END * size[found])
    mostly = np.zeros(crossing.pieces, dtype=bool)
    mostly[found] = inside
    return mostly


_ASIDE = 1e-4  # element sizes: steps of difference quotients, and to beside the end of a cut


class _Facets(NamedTuple):
    """Facets between two pieces of one cell: points (f, d), pieces (f,) and (f,)."""

    points: Ints
    first: Ints
    second: Ints


def junction_cuts(
    partition: Partition,
    ends: tuple[Ints, Ints],
    divide_all: Callable[[Ints, Bools], Partition],
    cuts: Sequence[Cut],
    boxes: Floats,
    sizes: Floats,
    known: Bools | None = None,
) -> Bools:
    """Tell which cuts (m, cuts) part which cells at a junction.

    Parameters
    ----------
    partition : Partition
        Cells divided by the cuts that go through them.
    ends : (e,), (e,) int arrays
        Cells in pieces of which cuts end, and which cut.
    divide_all : callable
        Divides the cells (q,) by the cuts (m, cuts) whatever their ends.
    cuts : sequence of Cut
    boxes : (cuts, 2, space) float array
        From `verify.xfem.cuts.boxes_of`.
    sizes : (m,) float array
        Longest edges of the cells, in metres.
    known : (m,) bool array, optional
        Cells with a junction before: they keep one as cuts grow.
    """
    meets = np.zeros((len(sizes), len(cuts)), dtype=bool)
    meets[ends] = True
    _add_meeting_cuts(meets, partition, known)
    suspects = meets.any(axis=1)
    if not suspects.any():
        return meets
    divided = divide_all(np.flatnonzero(suspects), meets)
    # facets outside the extent of every cut join their pieces to parts
    facets = _inner_facets(divided, suspects)
    inside = _inside_extent(divided, facets, cuts, boxes, sizes)
    joining = ~inside.any(axis=1)
    part = connected(len(divided.parent), facets.first[joining], facets.second[joining])
    solid = divided.solid
    first = np.unique(part[solid], return_index=True)[1]
    parts = np.bincount(divided.parent[solid][first], minlength=len(sizes))
    more = parts > np.bincount(partition.parent[partition.solid], minlength=len(sizes))
    if known is not None:
        more |= known & suspects
    # of the cuts the ones that keep two parts apart
    forced = np.zeros_like(meets)
    apart = part[facets.first] != part[facets.second]
    facet, cut = np.nonzero(inside & apart[:, None])
    forced[divided.parent[facets.first[facet]], cut] = True
    forced[~more] = False
    return forced


def pieces_of_one_part(
    partition: Partition, cuts: Sequence[Cut], boxes: Floats, sizes: Floats, cells: Bools
) -> Ints:
    """Find pairs (t, 2) of pieces of some cells (m,) that no cut keeps apart."""
    if not cells.any():
        return np.empty((0, 2), dtype=np.int64)
    facets = _inner_facets(partition, cells)
    joining = ~_inside_extent(partition, facets, cuts, boxes, sizes).any(axis=1)
    pairs = np.stack([facets.first[joining], facets.second[joining]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _add_meeting_cuts(meets: Bools, partition: Partition, known: Bools | None) -> None:
    """Add to the cuts (m, cuts) that end in cells those that divide them; leave single ones out."""
    ending = meets.any(axis=1) if known is None else meets.any(axis=1) | known
    piece, cut = np.nonzero((partition.label != 0) & ending[partition.parent, None])
    meets[partition.parent[piece], cut] = True
    meets[meets.sum(axis=1) < 2] = False


def _inner_facets(partition: Partition, cells: Bools) -> _Facets:
    """Find facets between sub-simplices in different solid pieces of one of some cells (m,)."""
    sub = partition.simplices
    sub = sub[
        cells[partition.parent[sub.piece]] & partition.solid[sub.piece] & (sub.fraction > 0.0)
    ]
    return _Facets(*facets_between(partition.parent, sub.piece, sub.points))


def _inside_extent(
    partition: Partition, facets: _Facets, cuts: Sequence[Cut], boxes: Floats, sizes: Floats
) -> Bools:
    """Tell which facets lie inside extent of each cut that has their pieces on its two sides."""
    label, zero = partition.label, partition.points
    found = np.zeros((len(facets.points), len(cuts)), dtype=bool)
    facet, cut = np.nonzero(label[facets.first] * label[facets.second] < 0)
    points = facets.points[facet]
    size = sizes[partition.parent[facets.first[facet]]][:, None]
    at, of = zero.positions[points.ravel()], np.repeat(cut, points.shape[1])
    level, depth = (x.reshape(points.shape) for x in levels_and_depths(cuts, of, at))
    inside = depth >= -AT_END * size
    # corners past the end of a facet that begins inside the extent
    past = ~inside & (depth > depth.max(axis=1, keepdims=True, initial=-np.inf) - size)
    past &= (depth > AT_END * size).any(axis=1, keepdims=True)
    row, corner = np.nonzero(past)
    inside[row, corner] = reached(cuts, boxes, zero, cut[row], points[row, corner], size[row, 0])
    found[facet, cut] = (inside & (np.abs(level) <= REACH * size)).all(axis=1)
    return found


def reached(
    cuts: Sequence[Cut], boxes: Floats, zero: ZeroPoints, own: Ints, points: Ints, size: Floats
) -> Bools:
    """Tell which points past the end of a cut belong to it, as it ends on another cut there.

    A cut that is bent inside an element is realised a little beside where it was given. A branch
    that ends on the given one goes on to the realised one, over the points between the two.

    ::

        branch ──────────┤     ×     ┆
                 its end, on   point  realised stem
              the given stem

    So a point × counts under three conditions. The stem as given and the stem as realised lie on
    its two sides; the end is on the given stem; and the branch just inside its end lies beyond the
    given stem, seen from ×. Plain branches need this as well as junctions.

    Where another cut goes straight on from the end, × lies on both to round-off, and counts.

    Parameters
    ----------
    cuts : sequence of Cut
    boxes : (cuts, 2, space) float array
    zero : ZeroPoints
    own : (q,) int array
        Cuts that end.
    points : (q,) int array
        Numbers of points of their planes past their ends.
    size : (q,) float array
        Of the cells in which they lie, in metres.
    """
    found = np.zeros(len(points), dtype=bool)
    near = np.abs(zero.values[points]) <= size[:, None]
    near[np.arange(len(own)), own] = False
    row, other = np.nonzero(near)
    # the end is on the other cut, and no farther from the point than the size
    at = zero.positions[points[row]]
    gap = np.maximum(boxes[other, 0] - at, at - boxes[other, 1]).max(axis=1)
    close = gap <= 2.0 * size[row]
    row, other, at = row[close], other[close], at[close]
    given, realised = levels_and_depths(cuts, other, at)[0], zero.values[points[row], other]
    nearly = AT_END * size[row]
    between = (given * realised <= 0.0) & (np.abs(given - realised) > nearly)
    along = (np.abs(given) <= nearly) & (realised == 0.0)
    along[along] = levels_and_depths(cuts, other[along], at[along])[1] >= -nearly[along]
    kept = between | along
    row, other, at, given, along = (x[kept] for x in (row, other, at, given, along))
    mine, size = own[row], size[row]
    end, inwards = _end(cuts, mine, at, size)
    off = AT_END * size + np.abs(levels_and_depths(cuts, mine, end)[0])
    level, depth = levels_and_depths(cuts, other, end)
    before = levels_and_depths(cuts, other, end + _ASIDE * size[:, None] * inwards)[0]
    joined = np.where(along, depth <= off, before * given < 0.0)
    found[row[(np.abs(level) <= off) & (depth >= -off) & joined]] = True
    return found


def _end(cuts: Sequence[Cut], of: Ints, points: Floats, size: Floats) -> tuple[Floats, Floats]:
    """Find the ends (q, space) of cuts nearest to points past them, and unit vectors inwards.

    The depth t is a distance from the end, negative here: its slope is that direction, and the end
    x − t ∇t/‖∇t‖. Where two ends are equally near, the difference quotient is a mean of both.
    """
    step = _ASIDE * size
    slope = np.empty_like(points)
    for axis, unit in enumerate(np.eye(points.shape[1])):
        ahead, behind = (
            levels_and_depths(cuts, of, points + way * step[:, None] * unit)[1]
            for way in (0.5, -0.5)
        )
        slope[:, axis] = (ahead - behind) / step
    length = np.linalg.norm(slope, axis=1)
    slope /= np.where(length > 0.0, length, 1.0)[:, None]
    return points - levels_and_depths(cuts, of, points)[1][:, None] * slope, slope
