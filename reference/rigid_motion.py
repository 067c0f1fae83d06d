"""Rigid motion that the supports of each piece of a body ask for, by Horn's quaternions."""

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace

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
