"""Local refinement of simplices by bisection of longest edges, without hanging nodes.

Rivara, *Algorithms for refining triangular grids suitable for adaptive and multigrid techniques*,
IJNME 20 (1984): where an edge is bisected, the longest edge of every cell at it is, too. All
edges of the mesh have one order (length, then node numbers); each cell is bisected at its marked
edges in that order, so that two cells divide their common face in the same way.
"""

import numpy as np
from numpy.typing import NDArray

from verify.xfem.mesh import SimplexMesh

_Ints = NDArray[np.int64]


def bisect_cells(mesh: SimplexMesh, marked: NDArray[np.bool_]) -> tuple[SimplexMesh, _Ints]:
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


def _keys(cells: _Ints, first: NDArray, second: NDArray) -> _Ints:
    """(q, e) each edge of the cells as one number."""
    low = np.minimum(cells[:, first], cells[:, second])
    high = np.maximum(cells[:, first], cells[:, second])
    return low << 32 | high
