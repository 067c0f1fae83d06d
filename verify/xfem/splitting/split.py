"""Pieces of the elements that cuts go through: a binary space partition, one cut at a time.

A cut splits a piece only when it goes through: when the zero points on its edges lie inside the
extent of the cut. So tips end on element edges (2D) or faces (3D), and a branch splits only the
piece that it crosses. |φ| below round-off is exactly zero, and zero counts as the plus side: the
cut is in effect moved a little to its minus side, the same at every node. Pieces that have no
volume then still take their place at the face in which they lie, so that nothing else is joined
across it, and are left out afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple, get_args

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
from verify.xfem.splitting.junctions import (
    joint_cuts,
    meeting_cells,
    reached,
    tied_pieces,
    without_specks,
)
from verify.xfem.splitting.partition import Partition
from verify.xfem.splitting.split_kernels import (
    crossed_cells,
    crossed_edges,
    divide_simplices,
    gone_through,
    two_sides,
    whole_simplices,
)
from verify.xfem.splitting.zero_points import ZeroPoints

__all__ = ["ROUND_OFF", "Held", "split_cells"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

Held = Callable[[_Ints, NDArray[np.int8], int], NDArray[np.bool_]]

ROUND_OFF = 8.0 * np.finfo(float).eps


def split_cells(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    held: Held | None = None,
    opened: NDArray[np.bool_] | None = None,
    joint: NDArray[np.bool_] | None = None,
) -> Partition:
    """Split every cell that a cut goes through, or that several part together.

    The others do not appear in the result.

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
    joint : (m,) bool array, optional
        Cells that several cuts have parted together before.

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
    crossed = np.flatnonzero((plus.any(axis=1) & ~plus.all(axis=1)).any(axis=1))
    sizes = np.zeros(len(mesh.cells))
    sizes[crossed] = mesh.longest_edges(crossed)

    def divided(cells: _Ints, rules: _Rules) -> tuple[Partition, list[_Ints]]:
        points = ZeroPoints(mesh.points, values, snap)
        return _divided(_whole(mesh.cells, cells, len(cuts), points, snapped), rules)

    rules = _Rules(cuts, sizes, tip, held, opened)
    partition, ends = divided(crossed, rules)
    if tip != "inside":
        return _only_split(partition)
    # what all cuts part together they part when some of them are not open yet, too
    free = rules._replace(held=None, opened=None)
    alone, ends = (partition, ends) if opened is None else divided(crossed, free)
    meets = meeting_cells(alone, ends, len(mesh.cells), joint)
    suspects = np.flatnonzero(meets.any(axis=1))
    if len(suspects) == 0:
        return _only_split(partition)
    trial = divided(suspects, free._replace(through=meets))[0]
    through = joint_cuts(without_specks(trial, meets.any(axis=1)), alone, cuts, sizes, joint)
    if not through.any():
        return _only_split(partition)
    cells = through.any(axis=1)
    partition = divided(crossed, rules._replace(through=through))[0]
    partition = _only_split(without_specks(partition, cells))
    return replace(partition, tied=tied_pieces(partition, cuts, sizes, cells))


class _Rules(NamedTuple):
    """How cuts divide: what `split_cells` was given, and sizes of the cells."""

    cuts: Sequence[Cut]
    sizes: _Floats
    tip: TipRule
    held: Held | None
    opened: NDArray[np.bool_] | None
    through: NDArray[np.bool_] | None = None  # (m, cuts) cells in which a cut has no end


def _whole(cells: _Ints, chosen: _Ints, cuts: int, points: ZeroPoints, snapped: int) -> Partition:
    """Make one piece of each chosen cell."""
    count, corners = len(chosen), cells.shape[1]
    return Partition(
        parent=chosen,
        label=np.zeros((count, cuts), dtype=np.int8),
        sub_piece=np.arange(count),
        sub_points=cells[chosen],
        sub_barycentric=np.tile(np.eye(corners), (count, 1, 1)),
        sub_fraction=np.ones(count),
        sub_sign=np.ones(count, dtype=np.int8),
        points=points,
        snapped=snapped,
    )


def _divided(partition: Partition, rules: _Rules) -> tuple[Partition, list[_Ints]]:
    """Divide pieces by all cuts; also the cells in pieces of which each cut ends."""
    ends = [np.empty(0, dtype=np.int64)] * len(rules.cuts)
    # a branch given before its stem can split only once the stem has: hence more than one sweep
    for _ in range(max(1, len(rules.cuts))):
        before = len(partition.parent)
        for index in range(len(rules.cuts)):
            partition, ends[index] = _split_by(partition, index, rules)
        if len(partition.parent) == before:
            break
    return partition, ends


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


def _split_by(partition: Partition, index: int, rules: _Rules) -> tuple[Partition, _Ints]:
    """Divide pieces by one cut; also the cells in pieces of which it ends."""
    points, parent = partition.points, partition.parent
    edges, piece = crossed_edges(
        partition.sub_points, partition.sub_piece, partition.label, points.values, index
    )
    if len(edges) == 0:
        return partition, np.empty(0, dtype=np.int64)
    crossing = Crossing(
        zero=points.find(index, edges[:, 0], edges[:, 1]),
        piece=piece,
        size=rules.sizes[parent[piece]],
        pieces=len(parent),
    )
    further = None
    if rules.tip == "inside" and len(rules.cuts) > 1:

        def further(past: _Ints, size: _Floats) -> NDArray[np.bool_]:
            return reached(rules.cuts, index, points, past, size)

    active, ending = crossed_through(
        rules.cuts[index], points.positions, crossing, rules.tip, further
    )
    meets = np.bincount(piece, minlength=len(active)) > 0
    if rules.through is not None:
        active |= meets & rules.through[parent, index]
    if rules.held is not None:
        doubtful = np.flatnonzero(meets & ~active)
        active[doubtful] = rules.held(parent[doubtful], partition.label[doubtful], index)
    if rules.opened is not None:
        active &= rules.opened[parent, index]
    ends = parent[ending]
    if not active.any():
        return partition, ends
    return _bisect_beside(_divide(partition, index, active), index), ends


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
