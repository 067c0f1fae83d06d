"""Edges inside a cut surface that its front would hold closed."""

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import mesh_edges, split_edges
from reference.meshing.opening import doubled_nodes

Array = NDArray[np.float64]


def loosen_front(
    points: Array, cells: NDArray[np.int64], facets: NDArray[np.int64]
) -> tuple[Array, NDArray[np.int64], NDArray[np.int64]]:
    """Split each edge inside the cut whose two ends both lie on a front.

    Its ends stay single, so the cut could not open along it, nor could a facet in a corner of a
    front open at all.
    """
    if not len(facets):
        return points, cells, facets
    opened = np.zeros(len(points), dtype=bool)
    opened[doubled_nodes(cells, facets)] = True
    edges = mesh_edges(facets)
    of_facets = np.sort(
        np.concatenate([facets[:, [0, 1]], facets[:, [1, 2]], facets[:, [2, 0]]]), axis=1
    )
    keys = edges[:, 0] * len(points) + edges[:, 1]
    times = np.bincount(
        np.searchsorted(keys, of_facets[:, 0] * len(points) + of_facets[:, 1]), minlength=len(edges)
    )
    tied = edges[~opened[edges].any(axis=1) & (times > 1)]
    return split_edges(points, cells, facets, tied, points[tied].mean(axis=1))
