"""Pieces of cells: a binary space partition of the cells that cuts go through, one cut at a time.

A cut splits a piece only when it goes through: when the zero points on its edges lie inside the
extent of the cut (`verify.xfem.crossing`). So tips end on element edges (2D) or faces (3D), and a
branch splits only the piece that it crosses. `verify.xfem.clip` then divides the piece at these
points, numbered once for the mesh by `verify.xfem.zero_points`.

Cuts that meet in no cell divide in one round. A cut meets a cell if its level set changes sign
there, and the cell is near its extent: of a cut with ends most cells are on its extension only.

|φ| below round-off is exactly zero, and zero counts as the plus side: the cut is in effect moved a
little to its minus side, the same at every node. A piece of no more than round-off of the volume of
its cell is left to the other half of the division that made it. It still takes its place at the
face in which it lies, so that nothing else is joined across it.

Where cuts end, or meet, inside a cell:

===================  ========================  =======================  ==========================
place                who decides               labels                   who joins
===================  ========================  =======================  ==========================
the tip of a cut     `crossing`: not through   0: one piece             `join`: this whole cell is
                                                                        joined to both sides of
                                                                        the cell behind
a branch that ends   `crossing`: the branch    ±1 of the stem, and of   `join`, across faces
on a stem that goes  goes through the pieces   the branch on one side
through              on its side of the stem   of the stem only
cuts that together   `crossing`: those cuts    ±1 of each, also past    `one_part`, inside the
part what none goes  divide all that they      its end                  cell; `join`, across faces
through by itself    meet in this cell
===================  ========================  =======================  ==========================
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from verify.xfem.arrays import Bools, Floats, Ints, Sides, XfemError, check_choice, finite_array
from verify.xfem.clip import ROUND_OFF_SHARE, Partition, bisected, divided
from verify.xfem.crossing import (
    Crossing,
    TipRule,
    crossed_through,
    junction_cuts,
    pieces_of_one_part,
    reached,
)
from verify.xfem.cuts import Cut, boxes_of
from verify.xfem.mesh import SimplexMesh, neighbours_across
from verify.xfem.zero_points import ZeroPoints

# cells (q,) and labels (q, cuts) of pieces, and the number of a cut, to whether it splits them
Separated = Callable[[Ints, Sides, int], Bools]

_NONE = np.empty(0, dtype=np.int64)
MEETING = ("inside", "extended")  # tip rules by which cuts may end on one another in a cell
ROUND_OFF = 8.0 * np.finfo(float).eps  # of the extent of the mesh: a level set that is zero


class _Outline(NamedTuple):
    """Where a cut may be extended past its end, to the far side of the cell in which it ends.

    It may not where another cut meets the cell, nor where the extension alone would meet a facet
    of the outline. A body that hangs on its last cell would be parted there.

    Attributes
    ----------
    cells : (m, d + 1) int array
    alone : (m,) bool array
        Cells that one cut meets.
    facets : (m, d + 1) bool array
        Facets, opposite to each node, on the outline; of cells that cuts meet.
    """

    cells: Ints
    alone: Bools
    facets: Bools

    @classmethod
    def of(cls, cells: Ints, meets: Bools) -> "_Outline":
        """Find it for the cells that each cut meets (m, cuts)."""
        met = np.flatnonzero(meets.any(axis=1))
        facets = np.zeros(cells.shape, dtype=bool)
        facets[met] = neighbours_across(cells[met]) < 0
        return cls(cells, meets.sum(axis=1) == 1, facets)

    def extensible(self, parent: Ints, edges: Ints, piece: Ints, inside: Bools) -> Bools:
        """Tell in which pieces (p,) of cells `parent` the cut that crosses edges may be extended.

        Parameters
        ----------
        parent : (p,) int array
        edges : (q, 2) int array
        piece : (q,) int array
        inside : (q,) bool array
            Whether the cut itself crosses an edge.
        """
        allowed = self.alone[parent]
        rows = np.flatnonzero(allowed[piece])
        cell = parent[piece[rows]]
        nodes, ends = self.cells[cell], edges[rows]
        on_edge = (nodes == ends[:, :1]) | (nodes == ends[:, 1:])
        row, facet = np.nonzero(self.facets[cell] & ~on_edge)
        met = np.zeros((2, len(parent), self.cells.shape[1]), dtype=bool)
        at = rows[row]
        met[0, piece[at], facet] = True
        met[1, piece[at[inside[at]]], facet[inside[at]]] = True
        return allowed & ~(met[0] & ~met[1]).any(axis=1)


class _Rules(NamedTuple):
    """How cuts divide: what `split_cells` was given, boxes of the cuts and sizes of the cells.

    The cuts divide in rounds: of each round the cells that they meet, (q,), and which cut, (q,).
    """

    cuts: Sequence[Cut]
    boxes: Floats
    sizes: Floats
    rounds: list[tuple[Ints, Ints]]
    tip: TipRule
    separated: Separated | None
    opened: Bools | None
    outline: _Outline | None
    forced: Bools | None = None  # (m, cuts) cells in which a cut has no end


def split_cells(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "inside",
    separated: Separated | None = None,
    opened: Bools | None = None,
    junction_cells: Bools | None = None,
) -> Partition:
    """Split every cell that a cut goes through, or that several part at a junction.

    The others do not appear in the result. Crossed cells are divided up to four times, each time
    from the start. Numbers of zero points and pieces do not compare from one time to the next:

    1. by the rules given; note the cells in which a cut ends;
    2. if not all cells are opened, the same as if all were, for step 3;
    3. cells with an end of a cut and another cut, whatever the ends: which cuts make a junction;
    4. if some do, by the rules given once more; these cuts now go through the cells of junctions.

    On a first reading leave out `separated`, `opened` and `junction_cells`: they serve cuts that
    grow (`verify.simulator`).

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
        A branch may come before or after the cut from which it leaves.
    tip : {"inside", "extended", "through", "nearest"}
        What to do where a cut ends inside an element: leave the element whole (the rule of the
        thesis, 3.2.1); split it unless another cut meets it, or the outline of the body would be
        opened where the cut does not reach it; split it; or whichever of whole and split moves
        the tip less. With the last two the order of the cuts matters where one ends in an element
        that another divides: it splits what it finds, the element or a piece.
    separated : callable, optional
        For a cut that grows. Its arguments are cells and labels of pieces that a cut meets but does
        not go through, and the number of the cut. It tells which of them the cut split before, and
        splits again.
    opened : (m, cuts) bool array, optional
        Cells in which each cut may split anything; without it all.
    junction_cells : (m,) bool array, optional
        Cells with a junction before.

    Raises
    ------
    XfemError
        If the cuts are no sequence, the tip rule is unknown, or `opened` is of another mesh. If a
        level set is not finite, a depth is NaN, or either has a wrong shape.
    """
    check_choice(tip, TipRule, "tip rule")
    if not isinstance(cuts, Sequence):
        raise XfemError(f"cuts of type {type(cuts).__name__}; expected a list of cuts")
    if opened is not None and opened.shape != (len(mesh.cells), len(cuts)):
        raise XfemError(
            f"opened cells of shape {opened.shape}; expected ({len(mesh.cells)}, {len(cuts)})"
        )
    values, snapped = nodal_values(mesh, cuts)
    boxes = boxes_of(cuts, mesh.space)
    meets, sizes = _met_cells(mesh, values, boxes)
    crossed = np.flatnonzero(meets.any(axis=1))

    def divide(cells: Ints, rules: _Rules) -> tuple[Partition, tuple[Ints, Ints]]:
        points = ZeroPoints(mesh.points, values, ROUND_OFF * mesh.extent)
        return _split_by_all(Partition.whole(mesh.cells, cells, points, snapped), rules)

    outline = _Outline.of(mesh.cells, meets) if tip == "extended" else None
    rules = _Rules(cuts, boxes, sizes, _rounds(meets), tip, separated, opened, outline)
    partition, ends = divide(crossed, rules)
    at_junctions = np.zeros(len(mesh.cells), dtype=bool)
    if tip in MEETING and len(cuts) > 1:
        # a junction is one of all cuts, also when some of them are not open yet
        free = rules._replace(separated=None, opened=None)
        junctions = junction_cuts(
            *((partition, ends) if opened is None else divide(crossed, free)),
            lambda cells, forced: divide(cells, free._replace(forced=forced))[0],
            cuts,
            boxes,
            sizes,
            junction_cells,
        )
        at_junctions = junctions.any(axis=1)
        if at_junctions.any():
            partition = divide(crossed, rules._replace(forced=junctions))[0]
    partition = partition.only_split()
    pairs = pieces_of_one_part(partition, cuts, boxes, sizes, at_junctions)
    return replace(partition, one_part=pairs).absorbed()


def nodal_values(mesh: SimplexMesh, cuts: Sequence[Cut]) -> tuple[Floats, int]:
    """Evaluate level sets (n, cuts) at the nodes, zero within round-off; count the snapped ones.

    Raises
    ------
    XfemError
        If one is no cut, or its level set of a wrong shape or not finite.
    """
    values = np.empty((len(mesh.points), len(cuts)))
    for index, cut in enumerate(cuts):
        if not hasattr(cut, "level_set"):
            raise XfemError(f"cut {index} of type {type(cut).__name__}; expected a cut")
        try:
            values[:, index] = finite_array(
                cut.level_set(mesh.points), "level set", values.shape[:1]
            )
        except XfemError as error:
            raise XfemError(f"cut {index}: {error}") from None
    tiny = (np.abs(values) <= ROUND_OFF * mesh.extent) & (values != 0.0)
    values[tiny] = 0.0
    return values, int(tiny.sum())


def _met_cells(mesh: SimplexMesh, values: Floats, boxes: Floats) -> tuple[Bools, Floats]:
    """Find the cells that each cut meets (m, cuts), and their longest edges (m,), in metres.

    A cell that is crossed by the extension of a cut only, far from the cut itself, is left out.
    """
    plus = values >= 0.0
    first = plus[mesh.cells[:, 0]]
    meets = np.logical_or.reduce([plus[nodes] != first for nodes in mesh.cells.T[1:]])
    crossed = np.flatnonzero(meets.any(axis=1))
    sizes = np.zeros(len(mesh.cells))
    sizes[crossed] = mesh.longest_edges(crossed)
    # A cut concerns points at most 1.5 sizes from it: half a size to one side of a point on it
    # (`REACH`), and from there within the same cell. Two cells share a facet, hence the larger size
    # around.
    reach = np.zeros(len(mesh.points))
    np.maximum.at(reach, mesh.cells[crossed], 1.6 * sizes[crossed, None])
    for cut in np.flatnonzero(np.isfinite(boxes[:, 0, 0])).tolist():
        cells = np.flatnonzero(meets[:, cut])
        nodes = mesh.cells[cells]
        low, high = mesh.points[nodes].min(axis=1), mesh.points[nodes].max(axis=1)
        gap = np.maximum(boxes[cut, 0] - high, low - boxes[cut, 1]).max(axis=1)
        meets[cells, cut] = gap <= reach[nodes].max(axis=1)
    return meets, sizes


def _rounds(meets: Bools) -> list[tuple[Ints, Ints]]:
    """Find cells (q,) and cuts (q,) of each round: cuts that meet in no cell divide in same one.

    Of those that do the one given first divides in an earlier round.
    """
    cell, cut = np.nonzero(meets)
    after = np.zeros(len(meets), dtype=np.int64)
    number = np.zeros(meets.shape[1], dtype=np.int64)
    for index in range(len(number)):
        cells = np.flatnonzero(meets[:, index])
        number[index] = after[cells].max(initial=0)
        after[cells] = number[index] + 1
    order = np.argsort(number[cut], kind="stable")
    starts = np.flatnonzero(np.diff(number[cut[order]])) + 1
    return [(cell[now], cut[now]) for now in np.split(order, starts)]


def _split_by_all(partition: Partition, rules: _Rules) -> tuple[Partition, tuple[Ints, Ints]]:
    """Divide pieces by all cuts; also the cells in pieces of which cuts end, and which cut."""
    ends: list[tuple[Ints, Ints]] = []
    # a branch given before its stem can split only once the stem has: hence more than one pass
    for _ in rules.cuts:
        before, ends = len(partition.parent), []
        for cells, cuts in rules.rounds:
            partition, ending = _split_by(partition, cells, cuts, rules)
            ends.append(ending)
        if len(partition.parent) == before or len(rules.cuts) == 1:
            break
    cell, cut = np.concatenate([np.empty((2, 0), dtype=np.int64), *ends], axis=1)
    return partition, (cell, cut)


def _split_by(
    partition: Partition, cells: Ints, cuts: Ints, rules: _Rules
) -> tuple[Partition, tuple[Ints, Ints]]:
    """Divide the pieces of cells (q,) by cuts (q,); also the cells in which these end."""
    points, parent = partition.points, partition.parent
    of_cell = np.full(len(rules.sizes), -1)
    of_cell[cells] = cuts
    cut = of_cell[parent]
    edges, piece = partition.crossed_edges(cut)
    if len(edges) == 0:
        return partition, (_NONE, _NONE)
    crossing = Crossing(
        cut=cut[piece],
        zero=points.find(cut[piece], edges[:, 0], edges[:, 1]),
        piece=piece,
        size=rules.sizes[parent[piece]],
        pieces=len(parent),
    )
    on_others = extensible = None
    if rules.tip in MEETING and len(rules.cuts) > 1:
        on_others = partial(reached, rules.cuts, rules.boxes, points)
    if rules.outline is not None:
        # of a bisected cell: the point on an edge of the cell, not an edge from there to a corner
        half = np.flatnonzero(edges.max(axis=1) >= points.nodes)
        half = half[crossing.zero[half] >= points.nodes]
        edges[half] = points.ends[crossing.zero[half] - points.nodes]
        extensible = partial(rules.outline.extensible, parent, edges, piece)
    active, ending = crossed_through(
        rules.cuts, points.positions, crossing, rules.tip, on_others, extensible
    )
    meets = np.bincount(piece, minlength=len(active)) > 0
    if rules.forced is not None:
        active |= meets & rules.forced[parent, cut]
    if rules.separated is not None:
        for index in np.unique(cuts).tolist():
            doubtful = np.flatnonzero(meets & ~active & (cut == index))
            active[doubtful] = rules.separated(parent[doubtful], partition.label[doubtful], index)
    if rules.opened is not None:
        active &= rules.opened[parent, cut]
    ends = parent[ending], cut[ending]
    if not active.any():
        return partition, ends
    partition = _divide(partition, cut, active)
    return (partition if len(rules.cuts) == 1 else _bisect_beside(partition, of_cell)), ends


def _divide(partition: Partition, cut: Ints, active: Bools) -> Partition:
    """Replace each active piece by its half above its cut (same place) and below (appended).

    A piece of round-off size names another of its cell in `absorbed_by`, which may name a further
    one. The chain ends at a solid piece: a solid piece that is divided has a solid half.
    """
    below = np.where(active, len(active) - 1 + np.cumsum(active), -1)
    label = np.concatenate([partition.label, partition.label[active]])
    above = np.flatnonzero(active)
    label[above, cut[above]] = 1
    label[below[above], cut[above]] = -1
    parted = replace(
        partition,
        parent=np.concatenate([partition.parent, partition.parent[active]]),
        label=label,
        simplices=divided(partition.simplices, partition.points, cut, below),
        absorbed_by=np.concatenate([partition.absorbed_by, below[active]]),
    )
    # halves: the one that may absorb, the one to be absorbed. The larger half of a solid piece
    # absorbs the other if that is of round-off size; of a piece that is not solid, above absorbs
    # below.
    share, solid = parted.fraction, partition.solid[above]
    halves = np.stack([above, below[active]])
    swapped = solid & (share[halves[0]] <= share[halves[1]])
    halves[:, swapped] = halves[::-1, swapped]
    small = ~solid | (share[halves[1]] <= ROUND_OFF_SHARE)
    parted.absorbed_by[halves[1, small]] = halves[0, small]
    # a piece absorbed before, by a piece that is divided now, goes to the half on whose side it
    # lies, by the sign of its mean level set; if it is divided as well, its half below goes to the
    # half below
    taken = np.flatnonzero(~partition.solid & active[partition.absorbed_by])
    if len(taken):
        sub = partition.simplices
        level = partition.points.values[sub.points, cut[sub.piece, None]].sum(axis=1)
        under = active[taken] | (np.bincount(sub.piece, level, len(active))[taken] < 0.0)
        lower = np.where(active[taken], below[taken], taken)[under]
        parted.absorbed_by[lower] = below[partition.absorbed_by[taken[under]]]
    return parted


def _bisect_beside(partition: Partition, of_cell: Ints) -> Partition:
    """Bisect pieces that a cut leaves whole at its end, so that later cuts find matching edges.

    That changes sub-simplices, and no piece.
    """
    zero, simplices = partition.points, partition.simplices
    cut = of_cell[partition.parent]
    if len(partition.crossed_edges(cut)[0]) == 0:
        return partition
    divided_now = (cut >= 0) & (partition.label[np.arange(len(cut)), cut] != 0)
    labelled = divided_now[simplices.piece]
    on_cut = np.zeros(len(zero.positions), dtype=bool)
    on_cut[simplices.points[labelled]] = True
    of_round = np.zeros(partition.label.shape[1], dtype=bool)
    of_round[cut[divided_now]] = True
    numbers = np.flatnonzero(on_cut[zero.nodes :] & of_round[zero.cut])
    beside = bisected(simplices[~labelled], zero, numbers)
    return replace(partition, simplices=simplices[labelled] + beside)
