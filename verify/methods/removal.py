"""Cutting by removal: cells that the cut touches go, with their material.

Cotin, Delingette & Ayache, *A hybrid elastic model for real-time cutting, deformations, and
force feedback for surgery training and simulation*, The Visual Computer 16 (2000); with local
refinement first: Forest, Delingette & Ayache, *Removing tetrahedra from manifold
tetrahedralisation: application to real-time surgical simulation*, Medical Image Analysis 9 (2005).

The refinement bisects longest edges and leaves no hanging nodes (Rivara, *Algorithms for refining
triangular grids suitable for adaptive and multigrid techniques*, IJNME 20 (1984)): where an edge is
bisected, the longest edge of every cell at it is, too. All edges of the mesh have one order
(length, then node numbers); each cell is bisected at its marked edges in that order, so that two
cells divide their common face in the same way.
"""

from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from verify.methods.cut_body import (
    Change,
    CutBody,
    OpenedCells,
    OpenedMesh,
    conforming_to,
    cut_so_far,
    make_body,
    whole_cells,
)
from verify.xfem.arrays import Bools, Floats, Ints, XfemError
from verify.xfem.contacts import face_contacts
from verify.xfem.crossing import TipRule
from verify.xfem.cuts import Cut
from verify.xfem.mesh import SimplexMesh, connected
from verify.xfem.phantom import PhantomMesh, cut_mesh


def bisect_cells(mesh: SimplexMesh, marked: NDArray[np.bool_]) -> tuple[SimplexMesh, Ints]:
    """Bisect the marked cells at their longest edges, and what must follow.

    Parameters
    ----------
    mesh : SimplexMesh
    marked : (m,) bool array

    Returns
    -------
    mesh : SimplexMesh
        The nodes of the given mesh first.
    origin : (k,) int array
        Cell of the given mesh in which each cell lies.
    """
    first, second = np.triu_indices(mesh.dim + 1, 1)
    keys = _keys(mesh.cells, first, second)
    edges, edge_of = np.unique(keys, return_inverse=True)
    edge_of = edge_of.reshape(keys.shape)
    ends = np.stack([edges >> 32, edges & 0xFFFFFFFF], axis=1)
    length = np.linalg.norm(mesh.points[ends[:, 0]] - mesh.points[ends[:, 1]], axis=1)
    rank = np.empty(len(edges), dtype=np.int64)
    # lengths that differ by round-off are equal
    rank[np.lexsort([edges, np.round(length / length.max(), 9)])] = np.arange(len(edges))
    longest = edge_of[np.arange(len(edge_of)), rank[edge_of].argmax(axis=1)]

    bisected = np.zeros(len(edges), dtype=bool)
    bisected[longest[marked]] = True
    while True:
        count = bisected.sum()
        bisected[longest[bisected[edge_of].any(axis=1)]] = True
        if bisected.sum() == count:
            break

    chosen = np.flatnonzero(bisected)
    middle = np.full(len(edges), -1)
    middle[chosen] = len(mesh.points) + np.arange(len(chosen))
    cells, origin = mesh.cells, np.arange(len(mesh.cells))
    while True:
        found = _keys(cells, first, second)
        at = np.minimum(np.searchsorted(edges, found), len(edges) - 1)
        order = np.where((edges[at] == found) & bisected[at], rank[at], -1)
        local = order.argmax(axis=1)
        row = np.flatnonzero(order.max(axis=1) >= 0)
        if len(row) == 0:
            break
        local, edge = local[row], at[row, local[row]]
        halves = [cells[row], cells[row].copy()]
        halves[0] = halves[0].copy()
        for half, end in zip(halves, (first, second), strict=True):
            half[np.arange(len(row)), end[local]] = middle[edge]
        rest = np.ones(len(cells), dtype=bool)
        rest[row] = False
        cells = np.concatenate([cells[rest], *halves])
        origin = np.concatenate([origin[rest], origin[row], origin[row]])
    points = np.concatenate([mesh.points, 0.5 * mesh.points[ends[chosen]].sum(axis=1)])
    return SimplexMesh(points, cells), origin


def _keys(cells: Ints, first: NDArray, second: NDArray) -> Ints:
    """Return each edge of the cells as one number, (q, e)."""
    low = np.minimum(cells[:, first], cells[:, second])
    high = np.maximum(cells[:, first], cells[:, second])
    return low << 32 | high


# A cell of which the cut takes off less than this share is not touched: the cut runs along a face.
_TOUCHED = 1e-9
_UNITS = {2: "m²", 3: "m³"}


def removal(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "through",
    *,
    opened: OpenedCells | None = None,
) -> CutBody:
    """Remove every cell through whose interior the cut goes.

    Cells that hang on the rest by a node or an edge only are taken off there, as such a hinge
    bears no moment; parts that the removal has so isolated, and that have no cell away from the
    gap, go as well ("debris").

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
    tip : {"inside", "extended", "through", "nearest"}
        "through" removes the cells in which the cut ends.
    opened : callable, optional
        Without it all cells go through which the cut goes; else those that a cut has opened.

    Raises
    ------
    XfemError
        If nothing is left.
    """
    start = perf_counter()
    cut = cut_so_far(mesh, cuts, tip, opened)
    return _remove(mesh, cut, np.arange(len(mesh.cells)), start, [])


def removal_refined(
    mesh: SimplexMesh,
    cuts: Sequence[Cut],
    tip: TipRule = "through",
    levels: int = 2,
    *,
    opened: OpenedCells | None = None,
) -> CutBody:
    """Refine the cells that the cut touches, then remove those that it still touches.

    Parameters
    ----------
    mesh : SimplexMesh
    cuts : sequence of Cut
    tip : {"inside", "extended", "through", "nearest"}
    levels : int
        Touched cells have their longest edge halved so many times.
    opened : callable, optional
        As of `removal`; the mesh is refined along all of the cuts from the start.

    Raises
    ------
    XfemError
        If nothing is left, or the number of levels is negative.
    """
    if levels < 0:
        raise XfemError(f"{levels} levels of refinement; expected 0 or more")
    start = perf_counter()
    wanted = _longest_edges(mesh) * 0.5**levels * (1.0 + 1e-9)
    refined, origin = mesh, np.arange(len(mesh.cells))
    while True:
        cut = cut_mesh(refined, cuts, tip)
        coarse = _touched(cut) & (_longest_edges(refined) > wanted[origin])
        if not coarse.any():
            break
        refined, before = bisect_cells(refined, coarse)
        origin = origin[before]
    added = len(refined.cells) - len(mesh.cells)
    changes = [Change("cell added by refinement", added, 0.5**levels, "of the edge")]
    if opened is not None:
        cut = cut_mesh(refined, cuts, tip, opened(cut))
    return _remove(mesh, cut, origin, start, changes)


def _remove(
    given: SimplexMesh,
    cut: PhantomMesh,
    origin: Ints,
    start: float,
    changes: list[Change],
) -> CutBody:
    mesh, touched = cut.mesh, _touched(cut)
    kept = ~touched[cut.parent] & (cut.fraction > 0.5)
    if not kept.any():
        raise XfemError("the cut touches every cell of the mesh: removal leaves nothing")
    bodies = cut.bodies[cut.cells[:, 0]]
    debris = _debris(whole_cells(cut, kept), bodies[kept], touched)
    remaining = kept.copy()
    remaining[np.flatnonzero(kept)[debris]] = False
    cells, node_parent = _without_hinges(whole_cells(cut, remaining))
    parents = cut.parent[remaining]
    outer = np.zeros(mesh.cells.shape, dtype=bool)
    outer[tuple(mesh.boundary_facets.T)] = True
    opened = OpenedMesh(mesh.points[node_parent], cells, np.argwhere(outer[parents]))
    phantom = cut_mesh(opened, [])
    seconds = {"cutting": perf_counter() - start}
    lost = mesh.measures[cut.parent[kept & ~remaining]].sum()
    gone = float(mesh.measures[touched].sum())
    changes += [
        Change("touched cell removed, volume in all", int(touched.sum()), gone, _UNITS[mesh.dim]),
        Change(
            "cell removed as debris, volume in all",
            int(debris.sum()),
            float(lost),
            _UNITS[mesh.dim],
        ),
    ]
    faces = np.argwhere((opened.neighbours < 0) & ~outer[parents])
    on_face = np.arange(mesh.dim + 1) != faces[:, 1:]
    facets = opened.points[opened.cells[faces[:, 0]][on_face].reshape(-1, mesh.dim)]
    return make_body(
        given,
        phantom,
        tuple(changes),
        conforming=conforming_to(opened, origin[parents], facets),
        cell_origin=origin[parents],
        seconds=seconds,
        cell_number=parents,
    )


def _touched(cut: PhantomMesh) -> Bools:
    """Return the (m,) cells of which no piece has all the volume."""
    largest = np.zeros(len(cut.mesh.cells))
    np.maximum.at(largest, cut.parent, cut.fraction)
    return largest < 1.0 - _TOUCHED


def _longest_edges(mesh: SimplexMesh) -> Floats:
    first, second = np.triu_indices(mesh.dim + 1, 1)
    ends = mesh.points[mesh.cells]
    return np.linalg.norm(ends[:, first] - ends[:, second], axis=2).max(axis=1)


def _debris(phantom: PhantomMesh, bodies: Ints, touched: Bools) -> Bools:
    """(p,) cells that only the removed ones joined to their body and that all lie at the gap."""
    first, second = face_contacts(phantom)
    part = connected(len(phantom.cells), first, second)
    at_gap = np.zeros(len(phantom.mesh.points), dtype=bool)
    at_gap[phantom.mesh.cells[touched]] = True
    beside = at_gap[phantom.mesh.cells[phantom.parent]].any(axis=1)
    volume = np.bincount(part, phantom.volumes)
    away = np.bincount(part, ~beside) > 0
    body = np.zeros(len(volume), dtype=np.int64)
    body[part] = bodies
    largest = np.zeros(bodies.max() + 1)
    np.maximum.at(largest, body, volume)
    loose = (volume < largest[body]) & ~away
    return loose[part]


def _without_hinges(phantom: PhantomMesh) -> tuple[Ints, Ints]:
    """Find cells (p, d + 1) joined across faces only, and the mesh node of each of their nodes."""
    corners = phantom.cells.shape[1]
    first, second = face_contacts(phantom)
    pair, a, b = np.nonzero(phantom.cells[first][:, :, None] == phantom.cells[second][:, None, :])
    rows, columns = first[pair] * corners + a, second[pair] * corners + b
    group = connected(phantom.cells.size, rows, columns)
    old = np.zeros(group.max() + 1, dtype=np.int64)
    old[group] = phantom.cells.ravel()
    order = np.argsort(old, kind="stable")
    number = np.empty_like(order)
    number[order] = np.arange(len(order))
    return number[group].reshape(-1, corners), phantom.node_parent[old[order]]
