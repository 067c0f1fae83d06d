"""Elements in which cuts end on one another: what their union keeps apart.

A cut alone divides a piece only if it goes through. Where several end in one point (2D) or along
one line (3D) inside an element, none does, and yet together they part the material. There every
cut divides whatever its plane crosses. Of the facets between the pieces that this leaves, those
inside the extent of a cut keep apart; pieces that meet in another one are tied: one piece.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from verify.xfem.cuts.crossing import AT_END, REACH, level_and_depth
from verify.xfem.cuts.flat import Cut
from verify.xfem.splitting.partition import Partition

__all__ = ["joint_cuts", "meeting_cells", "tied_pieces", "without_specks"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]
_Bools = NDArray[np.bool_]

_SPECK = 1e-24  # of a cell: what rounding leaves between three planes with a common line


class _Facets(NamedTuple):
    """Facets between two pieces of one cell: points (f, d), pieces (f,) and (f,)."""

    points: _Ints
    first: _Ints
    second: _Ints


def meeting_cells(partition: Partition, ends: Sequence[_Ints], cells: int) -> _Bools:
    """Which cuts (m, cuts) meet cells, of those where several do and one at least ends.

    Parameters
    ----------
    partition : Partition
        By the rule that a cut divides what it goes through.
    ends : sequence of int arrays
        Cells in pieces of which each cut ends.
    cells : int
        Number of cells of the mesh.
    """
    meets = np.zeros((cells, len(ends)), dtype=bool)
    for cut, some in enumerate(ends):
        meets[some, cut] = True
    ending = meets.any(axis=1)
    piece, cut = np.nonzero((partition.label != 0) & ending[partition.parent, None])
    meets[partition.parent[piece], cut] = True
    meets[meets.sum(axis=1) < 2] = False
    return meets


def without_specks(partition: Partition, cells: _Bools) -> Partition:
    """Take the volume of the pieces of some cells (m,) that rounding alone has made."""
    speck = cells[partition.parent] & (partition.fraction <= _SPECK)
    if not speck.any():
        return partition
    fraction = np.where(speck[partition.sub_piece], 0.0, partition.sub_fraction)
    return replace(partition, sub_fraction=fraction)


def joint_cuts(
    trial: Partition,
    alone: Partition,
    cuts: Sequence[Cut],
    sizes: _Floats,
    joint: _Bools | None,
) -> _Bools:
    """Which cuts (m, cuts) part which cells together, into more pieces than each one alone.

    Parameters
    ----------
    trial : Partition
        Of suspicious cells: every cut that meets them divides whatever its plane crosses.
    alone : Partition
        By the rule that a cut divides what it goes through.
    cuts : sequence of Cut
    sizes : (m,) float array
        Longest edges of the cells, in metres.
    joint : (m,) bool array, optional
        Cells that have been parted so before.
    """
    cells = len(sizes)
    chosen = np.zeros(cells, dtype=bool)
    chosen[trial.parent] = True
    facets = _inner_facets(trial, chosen)
    borne = _borne(trial, facets, cuts, sizes)
    loose = ~borne.any(axis=1)
    part = _components(len(trial.parent), facets.first[loose], facets.second[loose])
    solid = trial.fraction > 0.0
    first = np.unique(part[solid], return_index=True)[1]
    parts = np.bincount(trial.parent[solid][first], minlength=cells)
    more = parts > np.bincount(alone.parent[alone.fraction > 0.0], minlength=cells)
    if joint is not None:
        more |= joint & chosen
    through = np.zeros((cells, len(cuts)), dtype=bool)
    apart = part[facets.first] != part[facets.second]
    facet, cut = np.nonzero(borne & apart[:, None])
    through[trial.parent[facets.first[facet]], cut] = True
    through[~more] = False
    return through


def tied_pieces(partition: Partition, cuts: Sequence[Cut], sizes: _Floats, cells: _Bools) -> _Ints:
    """Pairs (t, 2) of pieces of some cells (m,) that no cut keeps apart."""
    facets = _inner_facets(partition, cells)
    loose = ~_borne(partition, facets, cuts, sizes).any(axis=1)
    pairs = np.stack([facets.first[loose], facets.second[loose]], axis=1)
    return np.unique(np.sort(pairs, axis=1), axis=0)


def _components(count: int, first: _Ints, second: _Ints) -> _Ints:
    graph = coo_array((np.ones(len(first), np.int8), (first, second)), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _inner_facets(partition: Partition, cells: _Bools) -> _Facets:
    """Facets between sub-simplices with a volume, in different pieces of one of some cells (m,)."""
    cell = partition.parent[partition.sub_piece]
    rows = np.flatnonzero(cells[cell] & (partition.sub_fraction > 0.0))
    corners = partition.sub_points.shape[1]
    keep = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    points = np.sort(partition.sub_points[rows][:, keep].reshape(-1, corners - 1), axis=1)
    piece, cell = np.repeat(partition.sub_piece[rows], corners), np.repeat(cell[rows], corners)
    order = np.lexsort([*points.T[::-1], cell])
    points, piece, cell = points[order], piece[order], cell[order]
    met = (points[1:] == points[:-1]).all(axis=1) & (cell[1:] == cell[:-1])
    met &= piece[1:] != piece[:-1]
    return _Facets(points[1:][met], piece[:-1][met], piece[1:][met])


def _borne(partition: Partition, facets: _Facets, cuts: Sequence[Cut], sizes: _Floats) -> _Bools:
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
        doubtful = np.flatnonzero(inside.any(axis=1) & ~inside.all(axis=1))
        if len(doubtful):
            of = label[facets.first[rows[doubtful]]] != 0
            inside[doubtful] |= _reaching(
                partition, cuts, index, points[doubtful], depth[doubtful], size[doubtful], of
            )
        borne[rows, index] = (inside & (np.abs(level) <= REACH * size)).all(axis=1)
    return borne


def _reaching(
    partition: Partition,
    cuts: Sequence[Cut],
    index: int,
    points: _Ints,
    depth: _Floats,
    size: _Floats,
    dividing: _Bools,
) -> _Bools:
    """Which corners of facets a cut reaches: past its end, which is on the cut in which they lie.

    A cut that is bent inside an element is realised beside itself, and what ends on it must go on
    to where it is.

    Parameters
    ----------
    partition : Partition
    cuts : sequence of Cut
    index : int
        Of the cut on which the facets lie.
    points, depth, size : (q, d), (q, d), (q, 1) arrays
        Corners of the facets, depth of the cut there, and size of their cells, in metres.
    dividing : (q, cuts) bool array
        Cuts that divide their cells.
    """
    positions, values = partition.points.positions, partition.points.values
    reached = np.zeros(points.shape, dtype=bool)
    row = np.arange(len(points))
    deepest = depth.argmax(axis=1)
    start, inner = positions[points[row, deepest]], depth[row, deepest]
    for corner in range(points.shape[1]):
        past = depth[:, corner] < -AT_END * size[:, 0]
        share = np.where(past, inner / np.where(past, inner - depth[:, corner], 1.0), 0.0)
        end = start + share[:, None] * (positions[points[:, corner]] - start)
        level, left = level_and_depth(cuts[index], end)
        off = AT_END * size[:, 0] + np.abs(level) + np.abs(left)
        for other, cut in enumerate(cuts):
            rows = np.flatnonzero(
                past & dividing[:, other] & (values[points[:, corner], other] == 0.0)
            )
            if other == index or len(rows) == 0:
                continue
            there, inside = level_and_depth(cut, end[rows])
            before = level_and_depth(cut, start[rows])[0]
            on = (np.abs(there) <= off[rows]) | (before * there < 0.0)
            reached[rows, corner] |= on & (inside >= -off[rows])
    return reached
