"""Rings of ever smaller cells around singular points, below what the mesh generator can do."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import mesh_edges, split_edges

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
_SHRINK = 0.25  # of one ring to the next
_SAME = 1e-10  # of the body's size: a node closer than that to a singular point is on it


def shrink_to_points(
    points: Array, cells: Cells, facets: Cells, singular: Array, smallest: float
) -> tuple[Array, Cells, Cells]:
    """Split the cells at each singular point until the innermost have edges of `smallest`.

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
