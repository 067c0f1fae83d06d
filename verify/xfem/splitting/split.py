"""Pieces of the elements that cuts go through: a binary space partition, one cut at a time.

A cut splits a piece only when it goes through: when the zero points on its edges lie inside the
extent of the cut. So tips end on element edges (2D) or faces (3D), and a branch splits only the
piece that it crosses. |φ| below round-off is exactly zero, and zero counts as the plus side: the
cut is in effect moved a little to its minus side, the same at every node. Pieces that have no
volume then still take their place at the face in which they lie, so that nothing else is joined
across it, and are left out afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cuts.crossing import (
    AT_END,
    REACH,
    Crossing,
    TipRule,
    crossed_through,
    level_and_depth,
)
from verify.xfem.cuts.flat import Cut
from verify.xfem.errors import XfemError
from verify.xfem.given_arrays import real_array
from verify.xfem.mesh import SimplexMesh
from verify.xfem.splitting.bisection import Simplices, bisect_at
from verify.xfem.splitting.clipping import staircase
from verify.xfem.splitting.split_kernels import (
    crossed_cells,
    crossed_edges,
    divide_simplices,
    gone_through,
    two_sides,
    whole_simplices,
)
from verify.xfem.splitting.zero_points import ZeroPoints

__all__ = ["ROUND_OFF", "Held", "Partition", "split_cells"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

Held = Callable[[_Ints, NDArray[np.int8], int], NDArray[np.bool_]]

ROUND_OFF = 8.0 * np.finfo(float).eps


@dataclass(frozen=True)
class Partition:
    """Pieces of some cells and their sub-simplices.

    Attributes
    ----------
    parent : (p,) int array
        Cell of each piece.
    label : (p, cuts) int8 array
        Side of each cut that split the piece off; 0 if the cut does not split its cell.
    sub_piece : (k,) int array
        Piece of each sub-simplex.
    sub_points : (k, d + 1) int array
        Its vertices, as numbers in `points`.
    sub_barycentric : (k, d + 1, d + 1) float array
        Barycentric coordinates of its vertices (second axis) in its cell.
    sub_fraction : (k,) float array
        Its share of the volume of its cell.
    sub_sign : (k,) int8 array
        Its orientation in its cell, +1 or -1: from how it came about, hence right for any sliver.
    points : ZeroPoints
        Mesh nodes and zero points.
    snapped : int
        Nodal level-set values that were taken as exactly zero.
    """

    parent: _Ints
    label: NDArray[np.int8]
    sub_piece: _Ints
    sub_points: _Ints
    sub_barycentric: _Floats
    sub_fraction: _Floats
    sub_sign: NDArray[np.int8]
    points: ZeroPoints
    snapped: int

    @property
    def fraction(self) -> _Floats:
        """(p,) share of each piece in the volume of its cell."""
        return np.bincount(self.sub_piece, self.sub_fraction, minlength=len(self.parent))

    @property
    def simplices(self) -> tuple[_Ints, _Ints, _Floats, _Floats, NDArray[np.int8]]:
        """Piece, points, barycentric corners, share and sign of the sub-simplices."""
        return (
            self.sub_piece,
            self.sub_points,
            self.sub_barycentric,
            self.sub_fraction,
            self.sub_sign,
        )

    def with_simplices(
        self,
        piece: _Ints,
        points: _Ints,
        barycentric: _Floats,
        fraction: _Floats,
        sign: NDArray[np.int8],
    ) -> "Partition":
        """Return the same with other sub-simplices."""
        return replace(
            self,
            sub_piece=piece,
            sub_points=points,
            sub_barycentric=barycentric,
            sub_fraction=fraction,
            sub_sign=sign,
        )


def split_cells(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    held: Held | None = None,
    opened: NDArray[np.bool_] | None = None,
) -> Partition:
    """Split every cell that a cut goes through; the others do not appear in the result.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
        A branch may come before or after the cut from which it leaves.
    tip : {"inside", "through", "nearest"}
        What to do where a cut ends inside an element: leave the element whole (the rule of the
        thesis, 3.2.1), split it, or whichever of the two moves the tip less. With the last two
        the order of the cuts matters where one ends in an element that another divides: it splits
        what it finds, the element or a piece.
    held : callable, optional
        For a cut that grows: given the cells and labels of pieces that a cut meets but does not
        go through, and its number, tells which it shall split: those that it split before.
    opened : (m, cuts) bool array, optional
        Cells in which each cut may split anything; without it all.

    Raises
    ------
    XfemError
        If the cuts are no sequence, a level set is not finite, a depth is NaN, either has a wrong
        shape, the tip rule is unknown, or `opened` is of another mesh.
    """
    if tip not in get_args(TipRule):
        raise XfemError(f"tip rule '{tip}'; expected inside, through or nearest")
    if not isinstance(cuts, Sequence):
        raise XfemError(f"cuts of type {type(cuts).__name__}; expected a list of cuts")
    if opened is not None and opened.shape != (len(mesh.cells), len(cuts)):
        raise XfemError(
            f"opened cells of shape {opened.shape}; expected ({len(mesh.cells)}, {len(cuts)})"
        )
    values, snapped = _nodal_values(mesh, cuts)
    snap = ROUND_OFF * mesh.extent
    if len(cuts) == 1 and tip != "nearest":
        return _split_by_one(
            mesh, cuts[0], ZeroPoints(mesh.points, values, snap), snapped, tip, held, opened
        )
    plus = values[mesh.cells] >= 0.0
    candidates = np.flatnonzero((plus.any(axis=1) & ~plus.all(axis=1)).any(axis=1))
    corners = mesh.dim + 1
    whole = np.arange(len(candidates))
    partition = Partition(
        parent=candidates,
        label=np.zeros((len(candidates), len(cuts)), dtype=np.int8),
        sub_piece=whole,
        sub_points=mesh.cells[candidates],
        sub_barycentric=np.tile(np.eye(corners), (len(candidates), 1, 1)),
        sub_fraction=np.ones(len(candidates)),
        sub_sign=np.ones(len(candidates), dtype=np.int8),
        points=ZeroPoints(mesh.points, values, snap),
        snapped=snapped,
    )
    sizes = np.zeros(len(mesh.cells))
    sizes[candidates] = mesh.longest_edges(candidates)
    # a branch given before its stem can split only once the stem has: hence more than one sweep
    for _ in range(max(1, len(cuts))):
        before = len(partition.parent)
        for index, cut in enumerate(cuts):
            partition = _split_by(partition, index, cut, sizes, tip, held, opened)
        if len(partition.parent) == before:
            break
    return _only_split(partition)


def _split_by_one(
    mesh: SimplexMesh,
    cut: Cut,
    points: ZeroPoints,
    snapped: int,
    tip: TipRule,
    held: Held | None,
    opened: NDArray[np.bool_] | None,
) -> Partition:
    """Do the same for a single cut: whole cells are divided, once, and nothing lies beside.

    A blade meets a few dozen cells at a step, and with so few only the number of calls costs.
    """
    crossed = crossed_cells(mesh.cells, points.values)
    edges, places, size = points.cross(crossed, mesh.cells)
    active = np.zeros(len(crossed), dtype=bool)
    if len(crossed):
        margin = AT_END if tip == "through" else -AT_END
        level, depth = level_and_depth(cut, places)
        active = gone_through(edges, level, depth, size, REACH, margin, tip == "through")
    if held is not None and not active.all():
        doubtful = np.flatnonzero(~active)
        label = np.zeros((len(doubtful), 1), dtype=np.int8)
        active[doubtful] = held(crossed[doubtful], label, 0)
    if opened is not None:
        active &= opened[crossed, 0]
    cells = crossed[active]
    whole, every, below = whole_simplices(cells, mesh.cells)
    stairs = staircase(mesh.dim + 1)
    simplices, kept = divide_simplices(whole, points.values, 0, every, below, stairs, points.table)
    piece, ids, at, share, sign = simplices
    points.divided(ids[kept:])
    parent, label = two_sides(cells, piece)
    return Partition(parent, label, piece, ids, at, share, sign, points, snapped)


def _nodal_values(mesh: SimplexMesh, cuts: Sequence[Cut]) -> tuple[_Floats, int]:
    values = np.empty((len(mesh.points), len(cuts)))
    for index, cut in enumerate(cuts):
        if not hasattr(cut, "level_set"):
            raise XfemError(f"cut {index} of type {type(cut).__name__}; expected a cut")
        try:
            column = real_array(cut.level_set(mesh.points), "level set")
        except XfemError as error:
            raise XfemError(f"cut {index}: {error}") from None
        if column.shape != (len(mesh.points),) or not np.isfinite(column).all():
            raise XfemError(f"cut {index}: level set of shape {column.shape} or not finite")
        values[:, index] = column
    tiny = (np.abs(values) <= ROUND_OFF * mesh.extent) & (values != 0.0)
    values[tiny] = 0.0
    return values, int(tiny.sum())


def _split_by(
    partition: Partition,
    index: int,
    cut: Cut,
    sizes: _Floats,
    tip: TipRule,
    held: Held | None,
    opened: NDArray[np.bool_] | None,
) -> Partition:
    points = partition.points
    edges, piece = crossed_edges(
        partition.sub_points, partition.sub_piece, partition.label, points.values, index
    )
    if len(edges) == 0:
        return partition
    crossing = Crossing(
        zero=points.find(index, edges[:, 0], edges[:, 1]),
        piece=piece,
        size=sizes[partition.parent[piece]],
        pieces=len(partition.parent),
    )
    active = crossed_through(cut, points.positions, crossing, tip)
    if held is not None:
        doubtful = np.flatnonzero((np.bincount(piece, minlength=len(active)) > 0) & ~active)
        active[doubtful] = held(partition.parent[doubtful], partition.label[doubtful], index)
    if opened is not None:
        active &= opened[partition.parent, index]
    if not active.any():
        return partition
    divided = _divide(partition, index, active)
    return _bisect_beside(divided, index)


def _divide(partition: Partition, index: int, active: NDArray[np.bool_]) -> Partition:
    """Replace each active piece by its part above (same place) and below (appended)."""
    below = np.where(active, len(active) - 1 + np.cumsum(active), -1)
    label = np.concatenate([partition.label, partition.label[active]])
    label[: len(active)][active, index] = 1
    label[len(active) :, index] = -1
    points = partition.points
    simplices, kept = divide_simplices(
        partition.simplices,
        points.values,
        index,
        active,
        below,
        staircase(partition.sub_points.shape[1]),
        points.table,
    )
    points.divided(simplices[1][kept:])
    return replace(
        partition,
        parent=np.concatenate([partition.parent, partition.parent[active]]),
        label=label,
    ).with_simplices(*simplices)


def _bisect_beside(partition: Partition, index: int) -> Partition:
    """Bisect what a cut leaves whole where it ends, so that later cuts find matching edges."""
    zero = partition.points
    beside, _ = crossed_edges(
        partition.sub_points, partition.sub_piece, partition.label, zero.values, index
    )
    if len(beside) == 0:
        return partition
    labelled = partition.label[partition.sub_piece, index] != 0
    on_cut = np.zeros(len(zero.positions), dtype=bool)
    on_cut[partition.sub_points[labelled]] = True
    numbers = np.flatnonzero(on_cut[zero.nodes :] & (zero.cut == index))
    simplices = Simplices(
        np.arange(len(partition.sub_piece)),
        partition.sub_points,
        partition.sub_barycentric,
        partition.sub_fraction,
    )
    parts = simplices.take(labelled).joined(bisect_at(zero, numbers, simplices.take(~labelled)))
    return partition.with_simplices(
        partition.sub_piece[parts.source],
        parts.points,
        parts.barycentric,
        parts.fraction,
        partition.sub_sign[parts.source],
    )


def _only_split(partition: Partition) -> Partition:
    """Leave out the cells that no cut went through; order the pieces by cell."""
    split = (partition.label != 0).any(axis=1)
    order = np.flatnonzero(split)
    order = order[np.argsort(partition.parent[order], kind="stable")]
    number = np.full(len(split), -1)
    number[order] = np.arange(len(order))
    keep = split[partition.sub_piece]
    return replace(
        partition, parent=partition.parent[order], label=partition.label[order]
    ).with_simplices(
        number[partition.sub_piece[keep]],
        partition.sub_points[keep],
        partition.sub_barycentric[keep],
        partition.sub_fraction[keep],
        partition.sub_sign[keep],
    )
