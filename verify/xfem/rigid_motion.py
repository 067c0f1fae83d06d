"""Rigid motion of every free body, by its supports.

A body that is turned by its supports moves rigidly first. Only the motion of its supports beyond
that strains it. Rigid motion takes no energy, so a turn of any angle is one step. The linear
response to the whole turn would stretch the body by its arm times the angle.
"""

from collections.abc import Callable, Iterator
from itertools import combinations

import numpy as np
from scipy.spatial.transform import Rotation

from verify.xfem.arrays import Bools, Floats, Ints
from verify.xfem.phantom import PhantomMesh
from verify.xfem.polar import nearest_rotations

_UNDETERMINED = 1e-9  # of the spread of the points: turns that they do not determine stay near 1
_SMALL = 1e-2  # change of a vector of length one: smaller turns are the linear response's


class RigidMotions:
    """Rigid motions of the bodies of a cut mesh between two places of their supports.

    Parameters
    ----------
    phantom : PhantomMesh
    fixed : (N, d) bool array
        Components that are prescribed. Nodes held in all components determine the motion; a body
        without such a node stays where it is.
    """

    def __init__(self, phantom: PhantomMesh, fixed: Bools) -> None:
        self._points = phantom.node_points
        whole = fixed.all(axis=1)
        bodies = phantom.bodies
        ends = np.cumsum(np.bincount(bodies))[:-1]
        self._nodes = np.split(np.argsort(bodies, kind="stable"), ends)
        self._held = [nodes[whole[nodes]] for nodes in self._nodes]
        # corners that follow others have number −1: not held
        self._edges = _edges_within(phantom.corner_node[phantom.cells], np.append(whole, False))

    def follow(self, displacement: Floats, change: Floats) -> Floats:
        """Move each body with the `change` (N, d) of its supports; return displacements (N, d).

        It is the least-squares motion of the nodes that are held in all components: place x goes
        to c₁ + Q (x − c₀), with c₀, c₁ the centres of those nodes before and after.
        """
        moved = displacement.copy()
        for nodes, turn, centre, wanted in self._turns(displacement, change):
            here = self._points[nodes] + displacement[nodes]
            moved[nodes] = (here - centre) @ turn.T + wanted - self._points[nodes]
        return moved

    def turned_path(self, displacement: Floats) -> Callable[[float], Floats] | None:
        """Make the path to a prescribed displacement (N, d) along rotations; None if no body turns.

        Each body turns by a share of its angle, so that it does not shrink as on a straight path.
        The motion of its supports beyond that grows in proportion:

            x(s) = c₀ + s (c₁ − c₀) + Qˢ (X − c₀ + s e),  e = Qᵀ(X + u − c₁) − (X − c₀),

        with Qˢ the rotation by s times the angle (`part_of_rotation`).
        """
        turns = list(self._turns(np.zeros_like(displacement), displacement))
        if not turns:
            return None

        def at(s: float) -> Floats:
            values = s * displacement
            for nodes, turn, centre, wanted in turns:
                arm = self._points[nodes] - centre
                strained = (self._points[nodes] + displacement[nodes] - wanted) @ turn - arm
                part = part_of_rotation(turn, s)
                values[nodes] = (arm + s * strained) @ part.T - arm + s * (wanted - centre)
            return values

        return at

    def _turns(
        self, displacement: Floats, change: Floats
    ) -> Iterator[tuple[Ints, Floats, Floats, Floats]]:
        """Yield of each body that turns its nodes, rotation, and two centres of its held nodes.

        The centres are taken before and after the change. Bodies that turn by little are left to
        the linear response.
        """
        if not change.any():
            return
        for held, nodes in zip(self._held, self._nodes, strict=True):
            if len(held) == 0:
                continue
            before = self._points[held] + displacement[held]
            after = before + change[held]
            centre, wanted = before.mean(axis=0), after.mean(axis=0)
            turn = nearest_rotation(before - centre, after - wanted)
            if np.linalg.norm(turn - np.eye(len(turn))) >= _SMALL:
                yield nodes, turn, centre, wanted

    def strain(self, displacement: Floats, change: Floats) -> float:
        """Return the root mean square strain of edges between held nodes, rigid motion apart.

        Parts that turn against one another by an angle θ make it 2 sin(θ/4) or less.
        """
        if len(self._edges) == 0 or not change.any():
            return 0.0
        first, second = self._edges.T
        moved = self.follow(displacement, change)
        left = displacement + change - moved
        lengths = np.linalg.norm(
            (self._points + displacement)[second] - (self._points + displacement)[first], axis=1
        )
        apart = np.linalg.norm(left[second] - left[first], axis=1)
        sound = lengths > 0.0
        ratio = apart[sound] / lengths[sound]
        return float(np.sqrt(np.mean(ratio**2))) if len(ratio) else 0.0


def nearest_rotation(before: Floats, after: Floats) -> Floats:
    """Find the rotation (d, d) that takes centred points (k, d) nearest to others: least squares.

    It is the rotation nearest to their covariance (W. Kabsch, Acta Cryst. A 32, 1976). Rotations
    that the points leave open (one point, points on a line) are as small as possible.
    """
    d = before.shape[1]
    covariance = after.T @ before
    scale = float(np.linalg.norm(before) * np.linalg.norm(after))
    if scale == 0.0:
        return np.eye(d)
    turn = np.eye(d)
    for _ in range(2):  # the second time rotations that are determined are not pulled back
        turn = nearest_rotations(covariance[None] / scale + _UNDETERMINED * turn)[0]
    return turn


def part_of_rotation(turn: Floats, share: float) -> Floats:
    """Rotate about the same axis by a share of the angle, which is at most half a turn: (d, d)."""
    d = len(turn)
    in_space = np.eye(3)
    in_space[:d, :d] = turn
    part = Rotation.from_rotvec(share * Rotation.from_matrix(in_space).as_rotvec())
    rotation: Floats = part.as_matrix()[:d, :d]
    return rotation


def _edges_within(cells: Ints, chosen: Bools) -> Ints:
    """Find edges (e, 2) of cells both ends of which are chosen."""
    pairs = list(combinations(range(cells.shape[1]), 2))
    edges = cells[:, pairs].reshape(-1, 2)
    edges = edges[chosen[edges].all(axis=1)]
    return np.unique(np.sort(edges, axis=1), axis=0)
