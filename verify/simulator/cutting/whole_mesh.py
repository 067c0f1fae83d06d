"""The growing body as a `PhantomMesh`, for solvers that want all of it in one piece."""

from functools import cached_property

import numpy as np

from verify.simulator.cutting.growing_body import GrowingBody
from verify.xfem.arrays import Floats, Ints
from verify.xfem.phantom import PhantomMesh, SubCells
from verify.xfem.zero_points import ZeroPoints


def whole_mesh(body: GrowingBody, level_sets: Floats) -> PhantomMesh:
    """Copy a growing body into a phantom-node mesh; costs what the whole mesh is.

    Dof nodes keep their numbers; pieces are ordered by their cell.

    Parameters
    ----------
    body : GrowingBody
    level_sets : (n, cuts) float array
        Nodal level sets, in metres.
    """
    parent = body.piece_parent.rows
    order = np.argsort(parent, kind="stable")
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    used = np.flatnonzero(body.sub_piece.rows >= 0)
    return PhantomMesh(
        mesh=body.mesh,
        cells=body.piece_cells.rows[order],
        parent=parent[order],
        fraction=body.piece_fraction.rows[order],
        label=body.piece_label.rows[order],
        node_parent=body.node_parent.rows.copy(),
        level_sets=level_sets,
        sub_cells=_GrownSubCells(body, number, used, level_sets),
        snapped=int(np.count_nonzero(level_sets == 0.0)),
        dropped=body.dropped,
    )


class _GrownSubCells(SubCells):
    """Sub-simplices of a growing body; what is not asked for at every cut is made when it is."""

    _points: tuple[Floats, Ints, Ints]
    _nodes: tuple[Floats, Floats]

    def __init__(self, body: GrowingBody, number: Ints, used: Ints, level_sets: Floats) -> None:
        self.__dict__.update(
            piece=number[body.sub_piece.rows[used]],
            points=body.sub_points.rows[used],
            barycentric=body.sub_barycentric.rows[used],
            fraction=body.sub_fraction.rows[used],
            # rows that are there never change, so these stay those of the body as it is now
            _points=(body.points.positions.rows, body.points.ends.rows, body.points.cut.rows),
            _nodes=(body.mesh.points, level_sets),
        )

    @cached_property
    def zero_points(self) -> ZeroPoints:
        """Positions of all numbered points, and the edges on which the new ones lie."""
        (nodes, level_sets), (positions, ends, cut) = self._nodes, self._points
        return _zero_points(nodes, level_sets, positions, ends, cut)


def _zero_points(
    nodes: Floats, level_sets: Floats, positions: Floats, ends: Ints, cut: Ints
) -> ZeroPoints:
    points = ZeroPoints(nodes, level_sets, 0.0)
    values = np.full((len(nodes) + len(cut), level_sets.shape[1]), np.nan)
    values[: len(nodes)] = level_sets
    missing = np.arange(len(cut))
    while len(missing):
        # ends that are zero points themselves come first
        ready = ~np.isnan(values[ends[missing], 0]).any(axis=1)
        rows, missing = missing[ready], missing[~ready]
        plus, minus = values[ends[rows, 0]], values[ends[rows, 1]]
        k = np.arange(len(rows))
        above, below = plus[k, cut[rows]], minus[k, cut[rows]]
        r = (above / (above - below))[:, None]
        values[len(nodes) + rows] = (1.0 - r) * plus + r * minus
        values[len(nodes) + rows, cut[rows]] = 0.0
    points.positions = np.concatenate([nodes, positions])
    points.values, points.ends, points.cut = values, ends.copy(), cut.copy()
    points.turn = points.cut  # cuts have divided in the order of their numbers
    return points
