"""Crossing of pieces by one cut each: it divides those that it goes through.

That is read off the zero points on the edges of a piece: are they inside the extent of the cut?
A branch on a stem that goes through is decided here, too: it splits what the stem leaves. Cuts
that part a cell only together are the matter of `verify.xfem.junctions`.
"""

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError

TipRule = Literal["inside", "through", "nearest"]
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


def levels_and_depths(cuts: Sequence[Cut], of: Ints, points: Floats) -> tuple[Floats, Floats]:
    """Level set (n,) and depth (n,) at points (n, d), each of one of the cuts, in metres.

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
) -> tuple[Bools, Bools]:
    """Which pieces (p,) their cuts go through, and in which (p,) they end by the rule `inside`.

    By the other rules they end in none. A piece is gone through if all of its zero points are
    inside the extent (`inside`), if one is (`through`), or if their mean is (`nearest`).

    Parameters
    ----------
    cuts : sequence of Cut
    positions : (n, d) float array
        All numbered points, in metres.
    crossing : Crossing
    tip : {"inside", "through", "nearest"}
    reached : callable, optional
        Given cuts, numbers of points past their ends and sizes of the elements, tells which points
        belong to the cut all the same.
    """
    cut, zero, piece, size, pieces = crossing
    if tip == "nearest":
        return _mostly_crossed(cuts, positions, crossing), np.zeros(pieces, dtype=bool)
    wanted, at = np.unique(zero * len(cuts) + cut, return_inverse=True)
    point, of = np.divmod(wanted, len(cuts))
    level, depth = levels_and_depths(cuts, of, positions[point])
    # an end on an edge is inside by the rule `inside`: it has gone through the element before it;
    # by `through` it is not: it has not gone into the one behind it
    margin = 1.0 if tip == "through" else -1.0
    inside = (np.abs(level[at]) <= REACH * size) & (depth[at] >= margin * AT_END * size)
    if reached is not None:
        near = (np.abs(level[at]) <= REACH * size) & (depth[at] > -size)
        past = np.flatnonzero(near & ~inside)
        if len(past):
            inside[past] = reached(cut[past], zero[past], size[past])
    some, every = np.zeros(pieces, dtype=bool), np.zeros(pieces, dtype=bool)
    some[piece[inside]] = True
    if tip == "through":
        return some, every
    every[piece] = True
    every[piece[~inside]] = False
    return every, some & ~every


def _mostly_crossed(cuts: Sequence[Cut], positions: Floats, crossing: Crossing) -> Bools:
    """Which pieces their cuts cross as far as the centre of the section."""
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
