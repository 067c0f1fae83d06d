"""Supports of a scene as constrained unknowns of a DOLFINx space, side-aware at the cut."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import on_part

__all__ = ["constrained_values"]


def constrained_values(
    scene: Scene, space: ConformingSpace, exact: Any
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Unknowns that the supports hold, and their values.

    A discontinuous prescribed field is taken on the side of the cell that owns the node. A later
    support wins where two hold the same node.

    Returns
    -------
    unknowns : (k,) int32 array
        Scalar unknowns, ascending.
    values : (k,) float array
        m.

    Raises
    ------
    InputError
        If a support holds no node, or a piece of the body is held by none.
    """
    nodes, owner = space.boundary_nodes()
    points = space.node_points[nodes]
    value = np.full((len(space.node_points), 2), np.nan)
    for i, support in enumerate(scene.supports):
        chosen = on_part(scene, support.where, points, f"supports[{i}].where")
        held = list(support.held(2))
        if support.displacement == "exact":
            near = space.centroids[owner[chosen]]
            value[np.ix_(nodes[chosen], held)] = exact.displacement(points[chosen], near)[:, held]
        else:
            value[np.ix_(nodes[chosen], held)] = np.asarray(support.displacement, dtype=float)
    _check_every_piece_is_held(scene, space, value)
    flat = value.ravel()
    unknowns = np.flatnonzero(~np.isnan(flat)).astype(np.int32)
    return unknowns, flat[unknowns]


def _check_every_piece_is_held(
    scene: Scene, space: ConformingSpace, value: NDArray[np.float64]
) -> None:
    pieces = space.mesh.pieces
    held = np.zeros(pieces.max() + 1, dtype=np.int64)
    owner = np.zeros(len(value), dtype=np.int64)
    owner[space.cell_nodes.ravel()] = np.repeat(pieces, space.cell_nodes.shape[1])
    np.add.at(held, owner, np.count_nonzero(~np.isnan(value), axis=1))
    loose = np.flatnonzero(held < 3)
    if loose.size:
        where = space.centroids[pieces == loose[0]].mean(axis=0)
        raise InputError(
            f"supports: the cut frees the piece around ({where[0]:.4g}, {where[1]:.4g}), which no "
            "support holds; a static scene needs every piece held",
            str(scene.file or ""),
        )
