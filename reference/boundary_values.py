"""Supports of a scene as constrained unknowns, side-aware at the cut, and rigid motions by them.

A piece follows the nodes that are held in all components by Horn's quaternions.
"""

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


Array = NDArray[np.float64]
_OPEN = 1e-12  # of the spread of the points: what they leave open is turned as little as possible
_SMALL = 1e-2  # angle below which the linear response to a turn serves


class RigidMotions:
    """Rigid motions of the pieces of a body that go with the nodes held in all components.

    Parameters
    ----------
    space : ConformingSpace
    unknowns : (k,) int array
        Constrained scalar unknowns, by nodes.
    """

    def __init__(self, space: ConformingSpace, unknowns: NDArray[np.int32]) -> None:
        self._points = space.node_points
        place = np.full(self._points.shape, -1, dtype=np.int64)
        place.ravel()[unknowns] = np.arange(len(unknowns))
        whole = (place >= 0).all(axis=1)
        owner = space.piece_of_node
        self._parts = []
        for piece in range(int(owner.max()) + 1):
            held = np.flatnonzero(whole & (owner == piece))
            if len(held):
                self._parts.append((np.flatnonzero(owner == piece), held, place[held]))

    def follow(self, displacement: Array, values: Array) -> Array | None:
        """Displacement (n, d) of pieces that go with the `values` (k,) of the constrained unknowns.

        None if no piece turns by more than a small angle.
        """
        moved = displacement.copy()
        turned = False
        for nodes, held, place in self._parts:
            now = self._points[held] + displacement[held]
            wanted = self._points[held] + values[place]
            one, two = now.mean(axis=0), wanted.mean(axis=0)
            rotation = best_rotation(now - one, wanted - two)
            if np.abs(rotation - np.eye(len(rotation))).max() < _SMALL:
                continue
            here = self._points[nodes] + displacement[nodes]
            moved[nodes] = two + (here - one) @ rotation.T - self._points[nodes]
            turned = True
        return moved if turned else None


def best_rotation(now: Array, wanted: Array) -> Array:
    """Rotation (d, d) of centred points (k, d) that brings them nearest to others.

    In space the eigenvector of Horn's matrix (B. K. P. Horn, J. Opt. Soc. Am. A 4, 1987, 629).
    """
    d = now.shape[1]
    S = now.T @ wanted
    S += _OPEN * float(np.linalg.norm(now) * np.linalg.norm(wanted)) * np.eye(d)
    if d == 2:
        angle = np.arctan2(S[0, 1] - S[1, 0], S[0, 0] + S[1, 1])
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, -s], [s, c]])
    axial = np.array([S[1, 2] - S[2, 1], S[2, 0] - S[0, 2], S[0, 1] - S[1, 0]])
    N = np.empty((4, 4))
    N[0, 0] = np.trace(S)
    N[0, 1:] = N[1:, 0] = axial
    N[1:, 1:] = S + S.T - np.trace(S) * np.eye(3)
    w, x, y, z = np.linalg.eigh(N)[1][:, -1]
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
