"""Openings of a mesh that conforms to all cuts: when, what holds on, meshes before and after.

When facets open, a group of nodes that were tied falls into several. Each node is held on by the
force r = M a − f that it was held by before (f: loads less internal and viscous forces), multiplied
by what is not swept yet of the cut in its support. The sum over the group is zero, as its forces
were in balance: momentum is kept, and no acceleration jumps.
"""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.meshing import ConformingMesh, open_cut
from reference.space import ConformingSpace
from verify.errors import InputError
from verify.geometry.nearest import distance_to_pieces
from verify.geometry.swept_shares import CutSimplices, SweptShares
from verify.scene import Scene, ToolPathCut

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
_SAME = 1e-6  # of a facet: points that are one


class FacetOpenings(NamedTuple):
    """When the pairs of nodes that face each other across each of `mesh.cut_facets` open.

    Attributes
    ----------
    times : (f, q) array
        From when on each is open, s.
    passed : (f, q) array
        When the blade has passed all of its facet, s.
    shares : SweptShares or None
        Of the places of nodes on the cut; None where facets are released at once.
    place : (n,) int array
        Number of the place of each node.
    cut : (f,) int array
        Number of the cut that each facet is of.
    """

    times: Array
    passed: Array
    shares: SweptShares | None
    place: Numbers
    cut: Numbers

    def parted(
        self, before: Numbers, after: Numbers, facing: Numbers, due: NDArray[np.bool_]
    ) -> tuple[Numbers, Numbers]:
        """Give the nodes of groups that have fallen apart, and the cut (k,) that has parted each.

        Parameters
        ----------
        before, after : (n,) int array
            The leader of each node's group.
        facing : (f, q, 2) int array
            Pairs of nodes that face each other across each facet.
        due : (f, q) bool array
            Which have just opened. Where those of several cuts have, it is the first.
        """
        pairs = np.unique(np.column_stack([before, after]), axis=0)
        nodes = np.flatnonzero((np.bincount(pairs[:, 0], minlength=len(before)) > 1)[before])
        cut = np.full(len(before), len(self.cut))
        np.minimum.at(cut, before[facing[due][:, 0]], self.cut[np.nonzero(due)[0]])
        return nodes, cut[before[nodes]]


class Release(NamedTuple):
    """Forces (k, d) on nodes (k,), N, their factors (k,) from 1 to 0 at a time, and the cuts."""

    nodes: Numbers
    forces: Array
    factor: Callable[[float], Array]
    cut: Numbers


class TieForces:
    """Forces on all that has been released of a body.

    Parameters
    ----------
    shape : (n, d) tuple of int
        Of nodal arrays.
    cuts : int
        Number of cuts.
    """

    def __init__(self, shape: tuple[int, int], cuts: int) -> None:
        self._shape, self._releases = (cuts, *shape), list[Release]()

    def add(self, release: Release, time: float) -> None:
        """Add those of a release at a time, and drop those that have faded."""
        self._releases = [one for one in self._releases if one.factor(time).any()]
        self._releases.append(release)

    def at(self, time: float) -> Array:
        """Return the forces (cuts, n · d) at what each cut has released, at a time, N."""
        total, shape = np.zeros(self._shape), self._shape
        for nodes, forces, factor, cut in self._releases:
            total[cut, nodes] += factor(time)[:, None] * forces
        return total.reshape(len(total), shape[1] * shape[2])


def facet_openings(
    scene: Scene,
    space: ConformingSpace,
    facing: Numbers,
    swept: bool,
    delay: float = 0.0,
) -> FacetOpenings:
    """Find when each facet of the cut opens.

    Those of a cut open with it. One on a tool path opens when the blade has passed all of it, the
    last of its corners; or if `swept` at each node as the first facet there begins to be swept. A
    facet belongs to the cut that it is closest to: one on a curved cut is
    off by its own sagitta, and cuts do not lie on each other.

    Parameters
    ----------
    scene : Scene
    space : ConformingSpace
        With all final cuts open.
    facing : (f, q, 2) int array
        Of `reference.nodal_algebra.facing_nodes`.
    swept : bool
    delay : float
        By which facets on tool paths open late, s.
    """
    mesh = space.mesh
    corners = mesh.realised_cut
    places = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
    points = places.reshape(-1, mesh.dimension)
    off = [
        distance_to_pieces(points, cut.pieces()).reshape(places.shape[:2]).max(axis=1)
        for cut in scene.final_cuts
    ]
    _, place = np.unique(space.node_points, axis=0, return_inverse=True)
    shares = SweptShares(len(corners), by_node=True)
    times, passed = np.zeros((2, *facing.shape[:2]))
    nearest = np.argmin(off, axis=0) if off else np.zeros(0, dtype=np.int64)
    for i, cut in enumerate(scene.cuts):
        mine = nearest == i
        if isinstance(cut, ToolPathCut):
            which, nodes = np.flatnonzero(mine), facing[mine, :, 0]
            shape = _weights(corners[mine], space.node_points[nodes])
            simplices = CutSimplices(corners[mine], which, place.ravel()[nodes], shape)
            found = shares.add(simplices, partial(_passed_at, cut, delay))
            times[mine], passed[mine] = found.begins, found.passed[mine, None]
        else:
            times[mine] = passed[mine] = cut.opens_at
    known = shares if swept and shares.used else None
    return FacetOpenings(times if known else passed, passed, known, place.ravel(), nearest)


def _passed_at(cut: ToolPathCut, delay: float, points: Array) -> Array:
    return cut.passed_at(points) + delay


def _weights(corners: Array, nodes: Array) -> Array:
    """Weights (f, d, q) of the nodes (f, q, d) of facets at their corners.

    That of the corner a node is at; of one between two corners both, the same as N over a segment
    but for its shape, and never negative.
    """
    away = np.linalg.norm(corners[:, :, None] - nodes[:, None], axis=3)
    size = away.max(axis=(1, 2), keepdims=True)
    at = away <= _SAME * size
    between = np.zeros_like(at)
    count = corners.shape[1]
    for a in range(count):
        for b in range(a + 1, count):
            middle = 0.5 * (corners[:, a] + corners[:, b])
            off = np.linalg.norm(middle[:, None] - nodes, axis=2) <= _SAME * size[:, 0]
            between[:, a] |= off
            between[:, b] |= off
    return np.asarray(at | between, dtype=float)


def partly_opened(mesh: ConformingMesh, opened: NDArray[np.bool_]) -> ConformingMesh:
    """Give a mesh with all cuts open again, with some facets open only; cells stay in order.

    Parameters
    ----------
    mesh : ConformingMesh
    opened : (f,) bool array
        Whether each of `mesh.cut_facets` is.
    """
    if opened.all():
        return mesh
    points = np.empty((int(mesh.parent.max()) + 1, mesh.dimension))
    points[mesh.parent] = mesh.points
    return open_cut(points, mesh.parent[mesh.cells], mesh.cut_facets[opened])


def inherit(closed: ConformingSpace, opened: ConformingSpace, field: Array) -> Array:
    """Carry nodal values (n, d) over to the same mesh with more of its cuts open.

    Every copy of a node starts with the value that the node had: nothing jumps when a cut
    opens, so energy and momentum go on.

    Raises
    ------
    InputError
        If the two are not the same cells.
    """
    same = closed.cell_nodes.shape == opened.cell_nodes.shape and np.allclose(
        closed.node_points[closed.cell_nodes],
        opened.node_points[opened.cell_nodes],
        rtol=0.0,
        atol=1e-12 * float(np.ptp(closed.node_points, axis=0).max()),
    )
    if not same:
        raise InputError("the opened mesh does not have the cells of the closed one")
    values = np.empty((len(opened.node_points), field.shape[1]))
    values[opened.cell_nodes] = field[closed.cell_nodes]
    return values
