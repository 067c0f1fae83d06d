"""Crossing of pieces by one cut: it divides those that it goes through.

That is read off the zero points on the edges of a piece: are they inside the extent of the cut?
A branch on a stem that goes through is decided here, too: it splits what the stem leaves. Cuts
that part a cell only together are the matter of `verify.xfem.junctions`.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError

TipRule = Literal["inside", "through", "nearest"]
Reached = Callable[[Ints, Floats], Bools]
AT_END = 1e-9  # element sizes: an end as near as that to an edge lies on it
REACH = 0.5  # element sizes: a zero point farther from the cut than that is not on it


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

    By the other rules it ends in none. A piece is gone through if all of its zero points are inside
    the extent (`inside`), if one is (`through`), or if their mean is (`nearest`).

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
    # an end on an edge is inside by the rule `inside`: it has gone through the element before it;
    # by `through` it is not: it has not gone into the one behind it
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
