"""The walk of a sweep through the mesh: from the cells it was in to their neighbours.

For a cell the kernel asks where the zero set of the level set crosses its edges, and of each such
point whether it lies on the sweep and whether the blade has passed it. The tolerances are those of
`verify.xfem.pieces`, so that a cell that the walk calls crossed through is one that is split.
A sweep comes as its `arrays`, `verify.xfem.faceted_cuts.FacetArrays`.
"""

import numpy as np
from numba import njit

from verify.simulator.collision.tree_kernels import as_array, items_near_plane
from verify.xfem.crossing import AT_END, REACH
from verify.xfem.faceted_cuts import probe

__all__ = ["cells_hit", "walk"]


@njit(cache=True)
def _box_between(corners, travel, after, front, floor, ceiling):
    """Write the box of the part of a facet between two travels; whether there is any."""
    some = False
    for i in range(len(floor)):
        floor[i], ceiling[i] = np.inf, -np.inf
    for k in range(len(travel)):
        for j in range(k, len(travel)):
            # corners between the two, and where an edge passes one of them
            for limit in (after, front):
                share = 0.0
                if j == k:
                    if travel[k] < after or travel[k] > front:
                        continue
                elif (travel[k] < limit) == (travel[j] < limit):
                    continue
                else:
                    share = (limit - travel[k]) / (travel[j] - travel[k])
                some = True
                for i in range(len(floor)):
                    x = (1.0 - share) * corners[k, i] + share * corners[j, i]
                    floor[i], ceiling[i] = min(floor[i], x), max(ceiling[i], x)
    return some


@njit(cache=True)
def cells_hit(sweep, after, front, margin, low, high, order):
    """Items of a tree near what is swept between two travels; may hold doubles."""
    found = [np.int64(0) for _ in range(0)]
    corners = sweep.corners
    floor, ceiling = np.empty(corners.shape[2]), np.empty(corners.shape[2])
    for t in range(len(corners)):
        if not _box_between(corners[t], sweep.travel[t], after, front, floor, ceiling):
            continue
        for i in range(len(floor)):
            floor[i] -= margin
            ceiling[i] += margin
        for item in items_near_plane(
            low, high, order, floor, ceiling, sweep.normals[t], corners[t, 0], margin
        ):
            found.append(item)  # noqa: PERF402 - `extend` takes longer to compile
    return as_array(found)


@njit(cache=True)
def _cross(cell, front, cells, points, size, snap, sweep, phi, entry, leave, room):
    """(near the sweep, crossed through, latest travel) of a cell.

    Writes the travel at which the blade entered it, and crossed it through.
    """
    corners, space = cells.shape[1], points.shape[1]
    place = room[4, :space]
    near, through, any_zero, latest = False, True, False, 0.0
    for a in range(corners):
        node = cells[cell, a]
        if np.isnan(phi[node]):
            value = probe(points[node], sweep, room)[0]
            phi[node] = 0.0 if abs(value) <= snap else value
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
                entry[cell] = min(entry[cell], travel)
            else:
                through = False
    if any_zero and through:
        leave[cell] = latest
    return near, any_zero and through, latest


@njit(cache=True)
def walk(
    seeds,
    front,
    cells,
    neighbours,
    points,
    size,
    snap,
    sweep,
    phi,
    turn,
    turns,
    settled,
    recorded,
    near_cell,
    strokes_near,
    entry,
    leave,
):
    """Walk from the seeds to all cells near what has been swept.

    Returns the cells that may have to be split, and those from which to go on next time.
    `settled` marks cells that the blade has left behind, `recorded` those that it is known to have
    split, `near_cell` all that were ever near it.
    """
    queue, candidates = [np.int64(0) for _ in range(0)], [np.int64(0) for _ in range(0)]
    frontier, room = [np.int64(0) for _ in range(0)], np.empty((5, 3))
    for cell in seeds:
        if turns[cell] != turn:
            turns[cell] = turn
            queue.append(cell)
    at = 0
    while at < len(queue):
        cell = queue[at]
        at += 1
        if settled[cell]:
            continue
        near, through, latest = _cross(
            cell, front, cells, points, size, snap, sweep, phi, entry, leave, room
        )
        if not near:
            continue
        if not near_cell[cell]:
            near_cell[cell] = True
            strokes_near[cell] += 1
        alone = strokes_near[cell] == 1
        if (through and not recorded[cell]) or not alone:
            candidates.append(cell)
        # what other strokes have left of a cell may be crossed through later than its edges; and
        # what is crossed through only just may be split only when the blade is farther on
        if alone and (recorded[cell] or latest < front - size[cell]):
            settled[cell] = True
        else:
            frontier.append(cell)
        for other in neighbours[cell]:
            if other >= 0 and turns[other] != turn:
                turns[other] = turn
                queue.append(other)
    return as_array(candidates), as_array(frontier)
