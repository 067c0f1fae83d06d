"""Whether a cut goes through a piece: from where it crosses the piece's edges."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts.flat import Cut

__all__ = ["AT_END", "REACH", "Crossing", "TipRule", "crossed_through"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

TipRule = Literal["inside", "through", "nearest"]

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

    zero: _Ints
    piece: _Ints
    size: _Floats
    pieces: int


def crossed_through(
    cut: Cut, positions: _Floats, crossing: Crossing, tip: TipRule
) -> NDArray[np.bool_]:
    """Which pieces (p,) a cut goes through; `positions` are those of all numbered points."""
    zero, piece, size, pieces = crossing
    if tip == "nearest":
        return _mostly_crossed(cut, positions, crossing)
    mark = np.zeros(len(positions), dtype=bool)
    mark[zero] = True
    wanted = np.flatnonzero(mark)
    place = np.cumsum(mark) - 1
    level, depth = np.abs(cut.level_set(positions[wanted])), cut.depth(positions[wanted])
    at = place[zero]
    margin = 1.0 if tip == "through" else -1.0
    inside = (level[at] <= REACH * size) & (depth[at] >= margin * AT_END * size)
    found = np.zeros(pieces, dtype=bool)
    if tip == "through":
        found[piece[inside]] = True
    else:
        found[piece] = True
        found[piece[~inside]] = False
    return found


def _mostly_crossed(cut: Cut, positions: _Floats, crossing: Crossing) -> NDArray[np.bool_]:
    """Which pieces a cut crosses as far as the centre of its section."""
    pairs, first = np.unique(np.stack([crossing.piece, crossing.zero]), axis=1, return_index=True)
    count = np.bincount(pairs[0], minlength=crossing.pieces)
    found = np.flatnonzero(count)
    sums = [np.bincount(pairs[0], x, minlength=crossing.pieces) for x in positions[pairs[1]].T]
    centres = np.stack(sums, axis=1)[found] / count[found, None]
    size = np.zeros(crossing.pieces)
    size[pairs[0]] = crossing.size[first]
    inside = np.abs(cut.level_set(centres)) <= REACH * size[found]
    inside &= cut.depth(centres) >= -AT_END * size[found]
    mostly = np.zeros(crossing.pieces, dtype=bool)
    mostly[found] = inside
    return mostly
