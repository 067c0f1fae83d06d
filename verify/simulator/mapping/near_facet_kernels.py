"""Level sets at the vertices of a surface, and which of its facets a cut concerns."""

import numpy as np
from numba import njit

__all__ = ["concerned_facets", "levels_at"]


@njit(cache=True)
def levels_at(vertices, vertex_cell, vertex_at, cells, nodal, snap):
    """Interpolate a nodal level set at some vertices: zero within `snap`.

    Returns the values (q,), and whether the level set is zero at one of the vertices or between.
    """
    values = np.empty(len(vertices))
    above, below = False, False
    for q in range(len(vertices)):
        vertex = vertices[q]
        cell, value = vertex_cell[vertex], 0.0
        for a in range(cells.shape[1]):
            value += vertex_at[vertex, a] * nodal[cells[cell, a]]
        if abs(value) <= snap:
            value = 0.0
        above, below = above or value >= 0.0, below or value <= 0.0
        values[q] = value
    return values, above and below


@njit(cache=True)
def concerned_facets(near, facets, nodes, values, moved, corner_cell, is_moved, place):
    """Facets that lie on both sides of a cut or touch it, or in cells that have moved apart.

    Parameters
    ----------
    near : (q,) int array
        Facets to choose from.
    facets : (f, k) int array
    nodes : (n,) int array
        Vertices of these.
    values : (n, cuts) float array
        Level sets there.
    moved : int array
        Cells with new unknowns or parts.
    corner_cell : (f, k) int array
        In which cell each corner of a facet lies.
    is_moved : (m,) bool array
        False for all cells, and left so.
    place : int array
        -1 for all vertices, and left so.
    """
    for k in range(len(nodes)):
        place[nodes[k]] = k
    for cell in moved:
        is_moved[cell] = True
    found, count = np.empty(len(near), dtype=np.int64), 0
    for facet in near:
        chosen = False
        for k in range(facets.shape[1]):
            chosen = chosen or is_moved[corner_cell[facet, k]]
        for cut in range(values.shape[1]):
            above, below = True, True
            for k in range(facets.shape[1]):
                value = values[place[facets[facet, k]], cut]
                above, below = above and value > 0.0, below and value < 0.0
            chosen = chosen or not (above or below)
        if chosen:
            found[count] = facet
            count += 1
    for node in nodes:
        place[node] = -1
    for cell in moved:
        is_moved[cell] = False
    return found[:count]
