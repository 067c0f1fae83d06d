"""Places of corners of facets in their elements, and the nodes with which they move."""

import numpy as np
from numba import njit

from verify.simulator.cutting.point_numbers import spans

__all__ = ["place_corners"]


@njit(cache=True)
def place_corners(ids, at, source, piece, cell, inner, cells, points, supports):
    """Find the corners of parts of facets.

    Parameters
    ----------
    ids : (q, k) int array
        Numbers of the points at their corners.
    at : (q, k, d + 1) float array
        Barycentric coordinates of these.
    source : (q,) int array
        Facet of which each is a part.
    piece, cell, inner : (f,) arrays
        Piece and cell of each facet, and whether it lies on a cut.
    cells : (m, d + 1) int array
        Of the mesh.
    points : (n, s) float array
        Its nodes, in metres.
    supports : (z, 7) int array
        See `PointNumbers`.

    Returns
    -------
    places : (q, k, s) float array
        Of the corners, in metres.
    counts : (q, k, d + 1) bool array
        Whether a node is among those that span the simplex of the point: the weights of all others
        are zero, its own may round to zero.
    pieces : (q, k) int array
    cell, inner : (q,) arrays
        Of the parts.
    """
    count, size = ids.shape
    corners, space = cells.shape[1], points.shape[1]
    places = np.empty((count, size, space))
    counts = np.empty((count, size, corners), dtype=np.bool_)
    pieces = np.empty((count, size), dtype=np.int64)
    cell_of, on_cut = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.bool_)
    for q in range(count):
        facet = source[q]
        cell_of[q], on_cut[q] = cell[facet], inner[facet]
        nodes = cells[cell[facet]]
        for k in range(size):
            pieces[q, k] = piece[facet]
            for i in range(space):
                place = 0.0
                for a in range(corners):
                    place += at[q, k, a] * points[nodes[a], i]
                places[q, k, i] = place
            for a in range(corners):
                counts[q, k, a] = spans(nodes[a], ids[q, k], len(points), supports)
    return places, counts, pieces, cell_of, on_cut
