"""Splitting edges of a simplicial mesh: every cell around an edge is halved, none is left behind.

Whatever edges are asked for, in the plane or in space, the mesh stays conforming.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from reference.meshing.opening import doubled_nodes

Array = NDArray[np.float64]
Cells = NDArray[np.int64]


def mesh_edges(simplices: Cells) -> Cells:
    """Edges (e, 2) of simplices (m, k), each once, the smaller node first."""
    pairs = np.concatenate([simplices[:, [i, j]] for i, j in _pairs(simplices.shape[1])])
    pairs.sort(axis=1)
    count = int(pairs.max(initial=0)) + 1
    return np.column_stack(np.divmod(np.unique(pairs[:, 0] * count + pairs[:, 1]), count))


def barycentric(corners: Array, x: Array) -> Array:
    """Barycentric coordinates (m, 3) of a point in plane triangles (m, 3, 2)."""
    a, b, c = corners.swapaxes(0, 1)
    u, v, w = b - a, c - a, x - a
    det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / det
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / det
    return np.column_stack([1 - s - t, s, t])


def split_edges(
    points: Array, cells: Cells, facets: Cells, edges: Cells, places: Array
) -> tuple[Array, Cells, Cells]:
    """Put a node on each of some edges and halve all cells and facets that have the edge.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, d + 1) array
    facets : (f, d) array
        Marked facets; they are split with the cells.
    edges : (e, 2) array
        Nodes of distinct edges, the smaller one first.
    places : (e, d) array
        Where the new nodes lie, m.

    Returns
    -------
    points : (n + e, d) array
        The new nodes come last, in the order of `edges`.
    cells : (…, d + 1) array
        Of the same orientation.
    facets : (…, d) array
    """
    count = len(points) + len(edges)
    keys = edges[:, 0] * count + edges[:, 1]
    order = np.argsort(keys)
    keys, number = keys[order], len(points) + order
    resting, facets = [], facets.copy()
    while len(keys):
        # an edge that comes first in all cells around it can be split together with its like
        first = _first_edge(cells, keys, count)
        resting.append(cells[first < 0])
        cells, first = cells[first >= 0], first[first >= 0]
        ready = _first_everywhere(cells, first, keys, count)
        mine = ready[first]
        cells = np.concatenate(
            [cells[~mine], _halves(cells[mine], first[mine], keys, number, count)]
        )
        if len(facets):
            of_facet = _first_edge(facets, np.where(ready, keys, -1 - np.arange(len(keys))), count)
            cut = of_facet >= 0
            halves = _halves(facets[cut], of_facet[cut], keys, number, count)
            facets = np.concatenate([facets[~cut], halves])
        keys, number = keys[~ready], number[~ready]
    return np.vstack([points, places]), np.concatenate([*resting, cells]), facets


def loosen_front(points: Array, cells: Cells, facets: Cells) -> tuple[Array, Cells, Cells]:
    """Split each edge inside a cut whose two ends both lie on a front or are tips.

    Its ends stay single, so the cut could not open along it, nor could a facet in a corner of a
    front open at all.
    """
    if not len(facets):
        return points, cells, facets
    opened = np.zeros(len(points), dtype=bool)
    opened[doubled_nodes(cells, facets)] = True
    corners = facets.shape[1]
    pairs = np.concatenate([facets[:, [i, j]] for i, j in _pairs(corners)])
    edges, times = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    tied = edges[~opened[edges].any(axis=1) & (times >= corners - 1)]
    return split_edges(points, cells, facets, tied, points[tied].mean(axis=1))


def _pairs(corners: int) -> list[tuple[int, int]]:
    return list(combinations(range(corners), 2))


def _keys_of(simplices: Cells, i: int, j: int, count: int) -> Cells:
    low = np.minimum(simplices[:, i], simplices[:, j])
    high = np.maximum(simplices[:, i], simplices[:, j])
    return low * count + high


def _first_edge(simplices: Cells, keys: Cells, count: int) -> Cells:
    """Find the first of `keys` (ascending where not negative) that a simplex has, or −1."""
    found = np.full(len(simplices), len(keys), dtype=np.int64)
    for at in _edge_numbers(simplices, keys, count):
        found = np.where(at >= 0, np.minimum(found, at), found)
    return np.where(found < len(keys), found, -1)


def _edge_numbers(simplices: Cells, keys: Cells, count: int) -> list[Cells]:
    """For each pair of corners: the index into `keys` of each simplex' edge, or −1."""
    known = np.flatnonzero(keys >= 0)
    values = keys[known]
    numbers = []
    for i, j in _pairs(simplices.shape[1]):
        mine = _keys_of(simplices, i, j, count)
        at = np.minimum(np.searchsorted(values, mine), max(len(values) - 1, 0))
        hit = values[at] == mine if len(values) else np.zeros(len(mine), dtype=bool)
        numbers.append(np.where(hit, known[at] if len(values) else 0, -1))
    return numbers


def _first_everywhere(cells: Cells, first: Cells, keys: Cells, count: int) -> NDArray[np.bool_]:
    """Which of the edges come first in all cells that have them."""
    ready = np.ones(len(keys), dtype=bool)
    for at in _edge_numbers(cells, keys, count):
        ready[at[(at >= 0) & (at != first)]] = False
    return ready


def _halves(simplices: Cells, edge: Cells, keys: Cells, number: Cells, count: int) -> Cells:
    a, b = np.divmod(keys[edge], count)
    new = number[edge]
    one = np.where(simplices == a[:, None], new[:, None], simplices)
    two = np.where(simplices == b[:, None], new[:, None], simplices)
    return np.concatenate([one, two])
