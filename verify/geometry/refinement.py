"""Uniform (red) refinement of simplices: every edge is halved, shapes stay bounded.

Bey, Tetrahedral grid refinement, Computing 55 (1995): the octahedron that is left of a tetrahedron
is split along the diagonal 02–13; its descendants then have at most three shapes, on any level.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

# children by corners (single digits) and middles of edges
_CHILDREN = {
    2: ["0 01", "01 1"],
    3: ["0 01 02", "01 1 12", "02 12 2", "01 12 02"],
    4: [
        "0 01 02 03", "01 1 12 13", "02 12 2 23", "03 13 23 3",
        "01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23",
    ],
}  # fmt: skip


def mesh_edges(simplices: Cells) -> Cells:
    """Edges (e, 2) of simplices (m, k), each once, the smaller node first."""
    pairs = np.concatenate(
        [simplices[:, [i, j]] for i, j in combinations(range(simplices.shape[1]), 2)]
    )
    pairs.sort(axis=1)
    count = int(pairs.max(initial=0)) + 1
    return np.column_stack(np.divmod(np.unique(pairs[:, 0] * count + pairs[:, 1]), count))


def oriented(points: Array, cells: Cells) -> Cells:
    """Swap two corners of each cell of negative volume; triangles in space stay as they are."""
    if cells.shape[1] <= points.shape[1]:
        return cells
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells = cells.copy()
    cells[negative, 0], cells[negative, 1] = cells[negative, 1], cells[negative, 0].copy()
    return cells


def refine_uniformly(
    points: Array, cells: Cells, facets: Cells, times: int = 1
) -> tuple[Array, Cells, Cells]:
    """Halve all edges, once or several times.

    All times in one call: the descendants of a tetrahedron have three shapes only if its corners
    keep their order from level to level.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, k + 1) array
        Of positive orientation, if k = d.
    facets : (f, k) array
        Marked facets, refined with the cells.
    times : int

    Returns
    -------
    points : (…, d) array
        The given ones first.
    cells : (2^(k·times) m, k + 1) array
        Oriented as the given ones.
    facets : (2^((k−1)·times) f, k) array
    """
    for _ in range(times):
        edges, count = mesh_edges(cells), len(points)
        keys = edges[:, 0] * count + edges[:, 1]
        points = np.vstack([points, points[edges].mean(axis=1)])
        cells, facets = _children(cells, keys, count), _children(facets, keys, count)
    return points, oriented(points, cells), facets


def _children(simplices: Cells, keys: Cells, count: int) -> Cells:
    def node(name: str) -> Cells:
        if len(name) == 1:
            return simplices[:, int(name)]
        ends = np.sort(simplices[:, [int(name[0]), int(name[1])]], axis=1)
        return count + np.searchsorted(keys, ends[:, 0] * count + ends[:, 1])

    parts = [
        np.column_stack([node(name) for name in child.split()])
        for child in _CHILDREN[simplices.shape[1]]
    ]
    return np.concatenate(parts)
