"""Nodes near a cut, moved onto it as far as no cell suffers.

Whatever is chosen and moved, no cell shrinks below a given share of its volume, so none can turn
inside out; nodes leave neither the boundary of the body nor a cut onto which they were moved
before.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from verify.methods.cut_body import Change
from verify.methods.feet import feet_on_cut, free_directions
from verify.methods.nodal_cut import NodalCut, crossed_edges
from verify.xfem.cuts import Cut
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh

_Floats = NDArray[np.float64]
_Bools = NDArray[np.bool_]

_HALVINGS = 4


@dataclass(frozen=True)
class SnappedMesh:
    """A mesh of which some nodes were moved, and the cuts that go through them.

    Attributes
    ----------
    mesh : SimplexMesh
    cuts : list of NodalCut
    changes : list of Change
    """

    mesh: SimplexMesh
    cuts: list[NodalCut]
    changes: list[Change]


def snap_nodes(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    threshold: float = 0.5,
    quality: float = 0.2,
    move: Literal["partly", "wholly"] = "partly",
) -> SnappedMesh:
    """Move nodes onto the cuts.

    Parameters
    ----------
    mesh : SimplexMesh
        A solid: triangles in the plane or tetrahedra.
    cuts : sequence of Cut
        One after the other.
    threshold : float
        Share of a crossed edge, in (0, ½]: a node nearer to the crossing than that is snapped. At
        one half no crossed edge is left.
    quality : float
        No cell is left with less than this share of its volume, in (0, 1).
    move : {"partly", "wholly"}
        What becomes of a node that cannot go all the way: it goes a part of it, and the cut goes
        through where it then is; or it stays, and is not snapped.

    Raises
    ------
    XfemError
        If the mesh is a membrane, or a parameter is outside its bounds.
    """
    if mesh.is_membrane:
        raise XfemError("snapping of a membrane in space; expected triangles in the plane or tets")
    if not 0.0 < threshold <= 0.5:
        raise XfemError(f"snapping threshold {threshold:g}; expected a share of an edge in (0, ½]")
    if not 0.0 < quality < 1.0:
        raise XfemError(f"snapping quality {quality:g}; expected a share of the volume in (0, 1)")
    if move not in ("partly", "wholly"):
        raise XfemError(f"snapping '{move}'; expected partly or wholly")
    size = _node_sizes(mesh)
    points = mesh.points.copy()
    chosen: list[_Bools] = []
    pinned = np.zeros(len(points), dtype=bool)
    for cut in cuts:
        now = SimplexMesh(points, mesh.cells)
        wanted = np.zeros(len(points), dtype=bool)
        wanted[crossed_edges(now, NodalCut.on(now, [cut])[0]).nearest_ends(threshold)] = True
        at = np.flatnonzero(wanted & ~pinned)
        goal = points.copy()
        goal[at], _ = feet_on_cut(cut, points[at], size[at], free_directions(now, at))
        share = _bearable_shares(mesh, points, goal, quality, move == "wholly")
        if move == "wholly":
            wanted &= (share == 1.0) & (np.abs(cut.level_set(goal)) <= 1e-9 * size)
            goal = np.where(wanted[:, None], goal, points)
            share = _bearable_shares(mesh, points, goal, quality, True)
            wanted &= share == 1.0
        points = points + share[:, None] * (goal - points)
        pinned |= wanted
        chosen.append(wanted)
    moved = SimplexMesh(points, mesh.cells)
    nodal = [
        cut.through(nodes) for cut, nodes in zip(NodalCut.on(moved, cuts), chosen, strict=True)
    ]
    return SnappedMesh(moved, nodal, _moves(mesh, moved))


def take_near_nodes(snapped: SnappedMesh, threshold: float) -> SnappedMesh:
    """Let the cuts go through all nodes nearer than a share of a crossed edge, without a move."""
    mesh = snapped.mesh
    cuts, changes, size = [], list(snapped.changes), _node_sizes(mesh)
    for cut in snapped.cuts:
        cut = cut.through(crossed_edges(mesh, cut).nearest_ends(threshold))
        off = np.abs(cut.cut.level_set(mesh.points))
        taken = (cut.values == 0.0) & (off > 1e-12 * size)
        largest = float(off[taken].max(initial=0.0))
        changes.append(Change("node off the cut taken as on it", int(taken.sum()), largest, "m"))
        cuts.append(cut)
    return SnappedMesh(mesh, cuts, changes)


def _bearable_shares(
    mesh: SimplexMesh, points: _Floats, goal: _Floats, quality: float, all_or_none: bool
) -> _Floats:
    """(n,) share of the way that each node can go, so that all cells keep their quality."""
    before = _signed(mesh, mesh.points)
    share = np.ones(len(points))
    floor = 1.0 if all_or_none else 0.5**_HALVINGS
    while True:
        at = points + share[:, None] * (goal - points)
        # a cell that an earlier cut has left at the limit may stay where it is
        limit = np.minimum(quality, (1.0 - 1e-12) * _signed(mesh, points) / before)
        bad = _signed(mesh, at) / before < limit
        if not bad.any():
            return share
        nodes = np.unique(mesh.cells[bad])
        share[nodes] = np.where(share[nodes] <= floor, 0.0, 0.5 * share[nodes])


def _signed(mesh: SimplexMesh, points: _Floats) -> _Floats:
    corners = points[mesh.cells]
    return np.linalg.det(corners[:, 1:] - corners[:, :1])


def _node_sizes(mesh: SimplexMesh) -> _Floats:
    """(n,) longest edge at each node, in metres."""
    first, second = np.triu_indices(mesh.dim + 1, 1)
    ends = mesh.cells[:, first], mesh.cells[:, second]
    length = np.linalg.norm(mesh.points[ends[0]] - mesh.points[ends[1]], axis=2)
    size = np.zeros(len(mesh.points))
    for nodes in ends:
        np.maximum.at(size, nodes, length)
    return size


def _moves(before: SimplexMesh, after: SimplexMesh) -> list[Change]:
    distance = np.linalg.norm(after.points - before.points, axis=1)
    volume = before.measures.sum()
    changed = abs(after.measures.sum() - volume) / volume
    return [
        Change("node moved onto the cut", int((distance > 0).sum()), float(distance.max()), "m"),
        Change(
            "volume of the body changed by moved nodes", int(changed > 1e-12), changed, "fraction"
        ),
    ]
