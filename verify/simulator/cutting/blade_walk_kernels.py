"""The walk of a sweep through the mesh: from the cells it was in to their neighbours.

For a cell the kernel asks where the zero set of the level set crosses its edges, and of each such
point whether it lies on the sweep and whether the blade has passed it. The tolerances are those of
`verify.xfem.crossing`, so that a cell that the walk calls crossed through is one that is split.
A sweep comes as its `arrays`, `verify.xfem.faceted_cuts.FacetArrays`.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from verify.xfem.crossing import AT_END, REACH
from verify.xfem.faceted_cuts import probe


class WalkedMesh(NamedTuple):
    """Mesh, the longest edge (m,) of each cell, and below what a level set is zero, in metres."""

    cells: NDArray[np.int64]
    neighbours: NDArray[np.int64]
    points: NDArray[np.float64]
    size: NDArray[np.float64]
    snap: float


class WalkState(NamedTuple):
    """What a stroke knows of nodes and cells; see `verify.simulator.cutting.stroke.Stroke`.

    Attributes
    ----------
    phi : (n,) float array
        Level sets, NaN where nobody has asked for them yet.
    entry, leave : (m,) float arrays
    turns : (m,) int array
        Look at which a cell was last met.
    settled, recorded, near : (m,) bool arrays
        Cells that the blade has left behind, those that it is known to have split, and all that
        were ever near it.
    strokes_near : (m,) int array
        Of all strokes.
    """

    phi: NDArray[np.float64]
    entry: NDArray[np.float64]
    leave: NDArray[np.float64]
    turns: NDArray[np.int64]
    settled: NDArray[np.bool_]
    recorded: NDArray[np.bool_]
    near: NDArray[np.bool_]
    strokes_near: NDArray[np.int64]


@njit(inline="always")
def _cross(cell, front, mesh, sweep, state, room):
    """(near the sweep, crossed through, latest travel) of a cell.

    Writes the travel at which the blade entered it, and crossed it through.
    """
    cells, points, size, phi = mesh.cells, mesh.points, mesh.size, state.phi
    corners, space = cells.shape[1], points.shape[1]
    place = room[4, :space]
    near, through, any_zero, latest = False, True, False, 0.0
    for a in range(corners):
        node = cells[cell, a]
        if np.isnan(phi[node]):
            value = probe(points[node], sweep, room)[0]
            phi[node] = 0.0 if abs(value) <= mesh.snap else value
    for a in range(corners):
        for b in range(a + 1, corners):
            p, m = cells[cell, a], cells[cell, b]
            above, below = phi[p], phi[m]
            if (above >= 0.0) == (below >= 0.0):
                continue
            if above < 0.0:
                p, m, above, below = m, p, below, above
            any_zero = True
            for i in range(space):
                place[i] = (above * points[m, i] - below * points[p, i]) / (above - below)
            level, beyond, travel = probe(place, sweep, room)
            if abs(level) <= size[cell] and beyond <= size[cell]:
                near = near or travel <= front + size[cell]
                latest = max(latest, travel)
            on = abs(level) <= REACH * size[cell] and beyond <= AT_END * size[cell]
            if on and travel <= front + AT_END * size[cell]:
                state.entry[cell] = min(state.entry[cell], travel)
            else:
                through = False
    if any_zero and through:
        state.leave[cell] = latest
    return near, any_zero and through, latest


@njit(cache=True)
def walk(seeds, front, turn, mesh, sweep, state):
    """Walk from the seeds to all cells near what has been swept, at the look of that number.

    Returns the cells that may have to be split, and those from which to go on next time.
    """
    turns, settled, recorded, near_cell = state.turns, state.settled, state.recorded, state.near
    room, count, total = np.empty((5, 3)), 0, 0
    queue = np.empty(len(turns), dtype=np.int64)
    candidates, frontier = np.empty_like(queue), np.empty_like(queue)
    for cell in seeds:
        if turns[cell] != turn:
            turns[cell] = turn
            queue[total] = cell
            total += 1
    at, wanted = 0, 0
    while at < total:
        cell = queue[at]
        at += 1
        if settled[cell]:
            continue
        near, through, latest = _cross(cell, front, mesh, sweep, state, room)
        if not near:
            continue
        if not near_cell[cell]:
            near_cell[cell] = True
            state.strokes_near[cell] += 1
        alone = state.strokes_near[cell] == 1
        if (through and not recorded[cell]) or not alone:
            candidates[wanted] = cell
            wanted += 1
        # what other strokes have left of a cell may be crossed through later than its edges; and
        # what is crossed through only just may be split only when the blade is farther on
        if alone and (recorded[cell] or latest < front - mesh.size[cell]):
            settled[cell] = True
        else:
            frontier[count] = cell
            count += 1
        for other in mesh.neighbours[cell]:
            if other >= 0 and turns[other] != turn:
                turns[other] = turn
                queue[total] = other
                total += 1
    return candidates[:wanted], frontier[:count]
