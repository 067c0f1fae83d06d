"""Supports of a scene as constrained unknowns of a DOLFINx space, side-aware at the cut."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.linear_solvers import rigid_motions
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.scene import Scene
from verify.scene.parts import held_facets, held_nodes, shifted_ends
from verify.solution import Regularisation

_HELD = 1e-9  # lever of the supports over the size of the piece, below which it may turn


def constrained_values(
    scene: Scene, space: ConformingSpace, exact: Any, share: float = 1.0
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Unknowns that the supports hold, and their values.

    A discontinuous prescribed field is taken on the side of the cell that owns the node. A later
    support wins where two hold the same node. A `share` below 1 is a point on the way there: of
    displacements, and of the angle by which a support turns.

    Returns
    -------
    unknowns : (k,) int32 array
        Scalar unknowns, ascending.
    values : (k,) float array
        m.

    Raises
    ------
    InputError
        If a support holds no node, or a piece of the body is left a rigid motion.
    """
    d = space.dimension
    value = np.full((len(space.node_points), d), np.nan)
    for i, support in enumerate(scene.supports):
        nodes, near = nodes_on_part(scene, space, support.where, f"supports[{i}].where")
        points, held = space.node_points[nodes], list(support.held(d))
        if support.displacement == "exact":
            found = share * exact.displacement(points, near)[:, held]
        else:
            found = support.values(points, share)
        value[np.ix_(nodes, held)] = found
    _check_every_piece_is_held(scene, space, value)
    flat = value.ravel()
    unknowns = np.flatnonzero(~np.isnan(flat)).astype(np.int32)
    return unknowns, flat[unknowns]


def nodes_on_part(
    scene: Scene, space: ConformingSpace, where: str, key: str
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Nodes (k,) that a support on a part holds, each on its own side of the cuts.

    Returns
    -------
    nodes : (k,) int array
    near : (k, d) array
        Centroid of a cell of each: on its side of the cuts, m.
    """
    nodes, owner = space.boundary_nodes()
    of_facets, corners = space.boundary_facets
    facets = np.searchsorted(nodes, of_facets), corners
    chosen, _ = held_nodes(scene, where, space.node_points[nodes], facets, key)
    return nodes[chosen], space.centroids[owner[chosen]]


def support_ends(scene: Scene, space: ConformingSpace, size: float) -> list[Regularisation]:
    """Report where supports hold more than their parts; `size` is that of the elements, m."""
    corners = space.boundary_facets[1]
    found = [held_facets(scene.geometry, support.where, corners) for support in scene.supports]
    return shifted_ends(found, size)


def _check_every_piece_is_held(
    scene: Scene, space: ConformingSpace, value: NDArray[np.float64]
) -> None:
    """Refuse a piece that its supports leave a rigid motion, naming the piece and the motion."""
    pieces = space.mesh.pieces
    node, component = np.nonzero(~np.isnan(value))
    for piece in range(pieces.max() + 1):
        corners = space.mesh.points[np.unique(space.mesh.cells[pieces == piece])]
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        size = float(np.ptp(corners, axis=0).max())
        mine = space.piece_of_node[node] == piece
        free = _free_motion(space.node_points[node[mine]] - centre, component[mine], size)
        if free:
            raise InputError(
                f"supports: the piece around ({', '.join(f'{x:.4g}' for x in centre)}) {free}; "
                "a static scene needs every piece held",
                str(scene.file or ""),
            )


def _free_motion(points: NDArray[np.float64], component: NDArray[np.int64], size: float) -> str:
    """Say which rigid motion is left when `component` (k,) is held at `points` (k, d)."""
    if not len(points):
        return "is held by no support (the cut frees it)"
    d = points.shape[1]
    motions = rigid_motions(points / size, np.zeros(d)).reshape(-1, *points.shape)
    modes = motions[:, np.arange(len(points)), component]
    # the left singular vectors are motions
    columns, values, _ = np.linalg.svd(modes, full_matrices=modes.shape[1] < len(modes))
    rank = int(np.count_nonzero(values > _HELD * values[0]))
    if rank == len(modes):
        return ""
    left = columns[:, rank:]
    if np.abs(left[d:]).max() > 1e-6:
        return "can still turn: its supports hold too few points or components"
    axis = "xyz"[int(np.argmax(np.abs(left[:d]).max(axis=1)))]
    return f"can still move in {axis}: its supports do not hold that component"
