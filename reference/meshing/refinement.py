"""Uniform refinement: a triangle into four, a tetrahedron into eight, all of a few shapes."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import mesh_edges
from reference.meshing.session import oriented

Array = NDArray[np.float64]
Cells = NDArray[np.int64]

# children by corners (single digits) and middles of edges; the octahedron that is left of a
# tetrahedron is split along the diagonal 02–13 (J. Bey, Computing 55, 1995)
_CHILDREN = {
    2: ["0 01", "01 1"],
    3: ["0 01 02", "01 1 12", "02 12 2", "01 12 02"],
    4: [
        "0 01 02 03",
        "01 1 12 13",
        "02 12 2 23",
        "03 13 23 3",
        "01 02 03 13",
        "01 02 12 13",
        "02 03 13 23",
        "02 12 13 23",
    ],
}


def refine_uniformly(
    points: Array, cells: Cells, facets: Cells, times: int = 1
) -> tuple[Array, Cells, Cells]:
    """Halve all edges, once or several times.

    All times in one call: the descendants of a tetrahedron have three shapes only if its corners
    keep their order from level to level.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, d + 1) array
        Positively oriented.
    facets : (f, d) array
        Marked facets, refined with the cells.
    times : int

    Returns
    -------
    points : (…, d) array
    cells : (2^(d·times) m, d + 1) array
        Positively oriented.
    facets : (2^((d−1)·times) f, d) array
    """
    for _ in range(times):
        points, cells, facets = _refine(points, cells, facets)
    return points, oriented(points, cells), facets


def _refine(points: Array, cells: Cells, facets: Cells) -> tuple[Array, Cells, Cells]:
    edges = mesh_edges(cells)
    count = len(points)
    keys = edges[:, 0] * count + edges[:, 1]
    points = np.vstack([points, points[edges].mean(axis=1)])
    return points, _children(cells, keys, count), _children(facets, keys, count)


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
