"""The growing body as a `VirtualMesh`, for solvers that want all of it in one piece."""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.cutting.growing_body import GrowingBody
from verify.xfem.unknown_nodes import node_sides
from verify.xfem.virtual import SubCells, VirtualMesh
from verify.xfem.zero_points import ZeroPoints

__all__ = ["whole_mesh"]

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


def whole_mesh(body: GrowingBody, level_sets: _Floats) -> VirtualMesh:
    """Copy a growing body into a virtual mesh; costs what the whole mesh is.

    Unknown nodes keep their numbers; pieces are ordered by their cell.

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
    cells, label = body.piece_cells.rows[order], body.piece_label.rows[order]
    node_parent = body.node_parent.rows.copy()
    return VirtualMesh(
        mesh=body.mesh,
        cells=cells,
        parent=parent[order],
        fraction=body.piece_fraction.rows[order],
        label=label,
        node_parent=node_parent,
        level_sets=level_sets,
        node_side=node_sides(level_sets[node_parent], cells, label),
        sub_cells=SubCells(
            piece=number[body.sub_piece.rows[used]],
            points=body.sub_points.rows[used],
            barycentric=body.sub_barycentric.rows[used],
            fraction=body.sub_fraction.rows[used],
            zero_points=_zero_points(body, level_sets),
        ),
        snapped=int((level_sets == 0.0).sum()),
        dropped=body.dropped,
    )


def _zero_points(body: GrowingBody, level_sets: _Floats) -> ZeroPoints:
    points = ZeroPoints(body.mesh.points, level_sets, 0.0)
    ends, cut = body.points.ends.rows.copy(), body.points.cut.rows.copy()
    nodes, count = len(level_sets), len(cut)
    values = np.full((nodes + count, level_sets.shape[1]), np.nan)
    values[:nodes] = level_sets
    missing = np.arange(count)
    while len(missing):
        # ends that are zero points themselves come first
        ready = ~np.isnan(values[ends[missing], 0]).any(axis=1)
        rows, missing = missing[ready], missing[~ready]
        plus, minus = values[ends[rows, 0]], values[ends[rows, 1]]
        k = np.arange(len(rows))
        above, below = plus[k, cut[rows]], minus[k, cut[rows]]
        r = (above / (above - below))[:, None]
        values[nodes + rows] = (1.0 - r) * plus + r * minus
        values[nodes + rows, cut[rows]] = 0.0
    points.positions = np.concatenate([body.mesh.points, body.points.positions.rows])
    points.values, points.ends, points.cut = values, ends, cut
    return points
