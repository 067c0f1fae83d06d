"""Pieces of the elements that cuts go through: a binary space partition, one cut at a time.

A cut splits a piece only when it goes through: when the zero points on its edges lie inside the
extent of the cut. So tips end on element edges (2D) or faces (3D), and a branch splits only the
piece that it crosses. |φ| below round-off is exactly zero, and zero counts as the plus side: the
cut is in effect moved a little to its minus side, the same at every node. Pieces that have no
volume then still take part in the connectivity and are left out afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.xfem.bisection import Simplices, bisect_at
from verify.xfem.clipping import staircase
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.zero_points import ZeroPoints

__all__ = ["Held", "Partition", "TipRule", "split_cells"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]

TipRule = Literal["inside", "through", "nearest"]
Held = Callable[[_Ints, NDArray[np.int8], int], NDArray[np.bool_]]

_ROUND_OFF = 8.0 * np.finfo(float).eps
_AT_END = 1e-9  # element sizes: an end as near as that to an edge lies on it
_REACH = 0.5  # element sizes: a zero point farther from the cut than that is not on it


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
    points: ZeroPoints
    snapped: int

    @property
    def fraction(self) -> _Floats:
        """(p,) share of each piece in the volume of its cell."""
        return np.bincount(self.sub_piece, self.sub_fraction, minlength=len(self.parent))


def split_cells(
    mesh: SimplexMesh, cuts: Sequence[Cut], tip: TipRule = "inside", held: Held | None = None
) -> Partition:
    """Split every cell that a cut goes through; the others do not appear in the result.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
        A branch may come before or after the cut from which it leaves.
    tip : {"inside", "through", "nearest"}
        What to do where a cut ends inside an element: leave the element whole (the rule of the
        thesis, 3.2.1), split it, or whichever of the two moves the tip less.
    held : callable, optional
        For a cut that grows: given the cells and labels of pieces that a cut meets but does not
        go through, and its number, tells which it shall split: those that it split before.

    Raises
    ------
    XfemError
        If a level set is not finite or has a wrong shape, or the tip rule is unknown.
    """
    if tip not in ("inside", "through", "nearest"):
        raise XfemError(f"tip rule '{tip}'; expected inside, through or nearest")
    values, snapped = _nodal_values(mesh, cuts)
    snap = _ROUND_OFF * mesh.extent
    plus = values[mesh.cells] >= 0.0
    candidates = np.flatnonzero((plus.any(axis=1) & ~plus.all(axis=1)).any(axis=1))
    corners = mesh.dim + 1
    whole = np.arange(len(candidates))
    partition = Partition(
        parent=candidates,
        label=np.zeros((len(candidates), len(cuts)), dtype=np.int8),
        sub_piece=whole,
        sub_points=mesh.cells[candidates],
        sub_barycentric=np.broadcast_to(np.eye(corners), (len(candidates), corners, corners)),
        sub_fraction=np.ones(len(candidates)),
        points=ZeroPoints(mesh.points, values, snap),
        snapped=snapped,
    )
    size = np.linalg.norm(mesh.edge_vectors[candidates], axis=2).max(axis=1, initial=0.0)
    sizes = np.zeros(len(mesh.cells))
    sizes[candidates] = size
    # a branch given before its stem can split only once the stem has: hence more than one sweep
    for _ in range(max(1, len(cuts))):
        before = len(partition.parent)
        for index, cut in enumerate(cuts):
            partition = _split_by(partition, index, cut, sizes, tip, held)
        if len(partition.parent) == before:
            break
    return _only_split(partition)


def _nodal_values(mesh: SimplexMesh, cuts: Sequence[Cut]) -> tuple[_Floats, int]:
    values = np.empty((len(mesh.points), len(cuts)))
    for index, cut in enumerate(cuts):
        column = np.asarray(cut.level_set(mesh.points))
        if column.shape != (len(mesh.points),) or not np.isfinite(column).all():
            raise XfemError(f"cut {index}: level set of shape {column.shape} or not finite")
        values[:, index] = column
    tiny = (np.abs(values) <= _ROUND_OFF * mesh.extent) & (values != 0.0)
    values[tiny] = 0.0
    return values, int(tiny.sum())


def _split_by(
    partition: Partition,
    index: int,
    cut: Cut,
    sizes: _Floats,
    tip: TipRule,
    held: Held | None,
) -> Partition:
    points = partition.points
    plus = points.values[partition.sub_points, index] >= 0.0
    mixed = (
        plus.any(axis=1) & ~plus.all(axis=1) & (partition.label[partition.sub_piece, index] == 0)
    )
    rows = np.flatnonzero(mixed)
    if len(rows) == 0:
        return partition
    row, a, b = np.nonzero(plus[rows][:, :, None] & ~plus[rows][:, None, :])
    ids = partition.sub_points[rows]
    zero = points.find(index, ids[row, a], ids[row, b])
    piece = partition.sub_piece[rows][row]
    active = _crossed_through(
        cut,
        points.positions,
        zero,
        piece,
        sizes[partition.parent[piece]],
        len(partition.parent),
        tip,
    )
    if held is not None:
        doubtful = np.flatnonzero((np.bincount(piece, minlength=len(active)) > 0) & ~active)
        active[doubtful] = held(partition.parent[doubtful], partition.label[doubtful], index)
    if not active.any():
        return partition
    return _bisect_beside(_divide(partition, index, active, plus), index)


def _bisect_beside(partition: Partition, index: int) -> Partition:
    """Bisect what a cut leaves whole where it ends, so that later cuts find matching edges."""
    zero = partition.points
    plus = zero.values[partition.sub_points, index] >= 0.0
    beside = plus.any(axis=1) & ~plus.all(axis=1)
    beside &= partition.label[partition.sub_piece, index] == 0
    if not beside.any():
        return partition
    nodes = len(zero.positions) - len(zero.ends)
    used = np.unique(partition.sub_points[partition.label[partition.sub_piece, index] != 0])
    numbers = used[used >= nodes] - nodes
    numbers = numbers[zero.cut[numbers] == index]
    simplices = Simplices(
        partition.sub_piece,
        partition.sub_points,
        partition.sub_barycentric,
        partition.sub_fraction,
    )
    parts = simplices.take(~beside).joined(bisect_at(zero, numbers, simplices.take(beside)))
    return replace(
        partition,
        sub_piece=parts.source,
        sub_points=parts.points,
        sub_barycentric=parts.barycentric,
        sub_fraction=parts.fraction,
    )


def _crossed_through(
    cut: Cut,
    positions: _Floats,
    zero: _Ints,
    piece: _Ints,
    size: _Floats,
    pieces: int,
    tip: TipRule,
) -> NDArray[np.bool_]:
    """Which pieces the cut goes through, from the zero points on their edges."""
    margin = 1.0 if tip == "through" else -1.0
    if tip == "nearest":
        pairs, first = np.unique(np.stack([piece, zero]), axis=1, return_index=True)
        piece, size = pairs[0], size[first]
        count = np.maximum(np.bincount(piece, minlength=pieces), 1)
        centres = [np.bincount(piece, x, minlength=pieces) / count for x in positions[pairs[1]].T]
        at, scale = np.stack(centres, axis=1)[piece], size
    else:
        at, scale = positions[zero], size
    places, back = np.unique(at, axis=0, return_inverse=True)
    inside = np.abs(cut.level_set(places))[back] <= _REACH * scale
    inside &= cut.depth(places)[back] >= margin * _AT_END * scale
    seen = np.bincount(piece, minlength=pieces) > 0
    if tip == "through":
        return np.bincount(piece, inside, minlength=pieces) > 0
    return seen & (np.bincount(piece, ~inside, minlength=pieces) == 0)


def _divide(
    partition: Partition, index: int, active: NDArray[np.bool_], plus: NDArray[np.bool_]
) -> Partition:
    """Replace each active piece by its part above (same place) and below (appended)."""
    above = np.arange(len(active))
    below = np.where(active, len(active) - 1 + np.cumsum(active), -1)
    parent = np.concatenate([partition.parent, partition.parent[active]])
    label = np.concatenate([partition.label, partition.label[active]])
    label[: len(active)][active, index] = 1
    label[len(active) :, index] = -1

    touched = active[partition.sub_piece]
    clipped = touched & plus.any(axis=1) & ~plus.all(axis=1)
    kept = ~clipped
    moved = np.where(
        touched & ~plus.any(axis=1), below[partition.sub_piece], above[partition.sub_piece]
    )
    new = _clip(partition, index, clipped)
    partition.points.divided(new["points"])
    source, side = new["source"], new["side"]
    piece = np.where(
        side > 0, above[partition.sub_piece[source]], below[partition.sub_piece[source]]
    )
    return replace(
        partition,
        parent=parent,
        label=label,
        sub_piece=np.concatenate([moved[kept], piece]),
        sub_points=np.concatenate([partition.sub_points[kept], new["points"]]),
        sub_barycentric=np.concatenate([partition.sub_barycentric[kept], new["barycentric"]]),
        sub_fraction=np.concatenate([partition.sub_fraction[kept], new["fraction"]]),
    )


def _clip(partition: Partition, index: int, clipped: NDArray[np.bool_]) -> dict[str, NDArray]:
    """Sub-simplices of the clipped sub-simplices."""
    rows = np.flatnonzero(clipped)
    points = partition.points
    order = np.argsort(partition.sub_points[rows], axis=1)
    ids = np.take_along_axis(partition.sub_points[rows], order, axis=1)
    barycentric = np.take_along_axis(partition.sub_barycentric[rows], order[:, :, None], axis=1)
    plus = points.values[ids, index] >= 0.0
    entry, local = clip_pattern(plus)
    stairs = staircase(ids.shape[1])
    r = np.zeros((*ids.shape, ids.shape[1]))
    s = np.zeros_like(r)
    row, a, b = np.nonzero(plus[:, :, None] & ~plus[:, None, :])
    r[row, a, b], s[row, a, b] = points.shares(index, ids[row, a], ids[row, b])
    corner = np.arange(ids.shape[1])
    s[:, corner, corner] = 1.0
    number = np.zeros(r.shape, dtype=np.int64)
    number[row, a, b] = points.find(index, ids[row, a], ids[row, b])
    number[:, corner, corner] = ids

    at, p, m = local[:, None], stairs.plus[entry], stairs.minus[entry]
    kind, fa, fb = (stairs.factors[entry][:, :, k] for k in range(3))
    factor = np.where(kind == 0, r[at, fa, fb], s[at, fa, fb])
    return {
        "source": rows[local],
        "side": stairs.side[entry],
        "points": number[at, p, m],
        "barycentric": s[at, p, m][..., None] * barycentric[at, p]
        + r[at, p, m][..., None] * barycentric[at, m],
        "fraction": partition.sub_fraction[rows[local]] * factor.prod(axis=1),
    }


def clip_pattern(plus: NDArray[np.bool_]) -> tuple[_Ints, _Ints]:
    """Staircase entries of simplices with these signs (q, corners), and the simplex of each."""
    stairs = staircase(plus.shape[1])
    pattern = plus @ (1 << np.arange(plus.shape[1]))
    count = stairs.start[pattern + 1] - stairs.start[pattern]
    local = np.repeat(np.arange(len(plus)), count)
    within = np.arange(len(local)) - np.repeat(np.cumsum(count) - count, count)
    return stairs.start[pattern][local] + within, local


def _only_split(partition: Partition) -> Partition:
    """Leave out the cells that no cut went through; order the pieces by cell."""
    split = (partition.label != 0).any(axis=1)
    order = np.flatnonzero(split)
    order = order[np.argsort(partition.parent[order], kind="stable")]
    number = np.full(len(split), -1)
    number[order] = np.arange(len(order))
    keep = split[partition.sub_piece]
    return replace(
        partition,
        parent=partition.parent[order],
        label=partition.label[order],
        sub_piece=number[partition.sub_piece[keep]],
        sub_points=partition.sub_points[keep],
        sub_barycentric=partition.sub_barycentric[keep],
        sub_fraction=partition.sub_fraction[keep],
    )
