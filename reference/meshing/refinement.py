"""Refinement: uniform, of few shapes; and rings of ever smaller cells around singular points."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import mesh_edges, split_edges
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
_SHRINK = 0.25  # of one ring around a singular point to the next
_SAME = 1e-10  # of the body's size: a node closer than that to a singular point is on it


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


def shrink_to_points(
    points: Array, cells: Cells, facets: Cells, singular: Array, smallest: float
) -> tuple[Array, Cells, Cells]:
    """Split the cells at each singular point until the innermost have edges of `smallest`.

    The mesh generator cannot make cells that small.

    Parameters
    ----------
    points : (n, 2) array
    cells : (m, 3) array
    facets : (f, 2) array
        Marked facets, split with the cells.
    singular : (k, 2) array
        Points; those that are nodes of the mesh count.
    smallest : float
        m.
    """
    size = float(np.ptp(points, axis=0).max())
    for place in singular:
        away = np.linalg.norm(points - place, axis=1)
        node = int(np.argmin(away))
        while away[node] <= _SAME * size:
            edges = mesh_edges(cells[(cells == node).any(axis=1)])
            edges = edges[(edges == node).any(axis=1)]
            ends = points[edges.sum(axis=1) - node]
            if np.linalg.norm(ends - points[node], axis=1).min() <= 2 * smallest:
                break
            places = points[node] + _SHRINK * (ends - points[node])
            points, cells, facets = split_edges(points, cells, facets, edges, places)
    return points, cells, facets
