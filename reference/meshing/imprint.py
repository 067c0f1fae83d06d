"""Imprinting polylines on a given triangle mesh, so that they run along its facets.

Only the triangles that a polyline touches are split; the rest of the mesh stays as it is. So a
conforming mesh is had that differs from an unfitted one by nothing but the cut cells: the fair
peer of a method that cuts through its elements. Slivers are left as they come.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import barycentric, mesh_edges, split_edges
from reference.meshing.opening import inner_facets
from verify.errors import InputError

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
_ON = 1e-10  # of an edge: closer points are the same point


def structured_triangles(
    lower: tuple[float, float], upper: tuple[float, float], counts: tuple[int, int]
) -> tuple[Array, Cells]:
    """Rectangles split along their rising diagonals."""
    n, m = counts
    x, y = np.meshgrid(
        np.linspace(lower[0], upper[0], n + 1), np.linspace(lower[1], upper[1], m + 1)
    )
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a = (j * (n + 1) + i).ravel()
    b, c, d = a + 1, a + n + 1, a + n + 2
    cells = np.concatenate([np.column_stack([a, b, d]), np.column_stack([a, d, c])])
    return np.column_stack([x.ravel(), y.ravel()]), cells


def imprint(points: Array, cells: Cells, polylines: list[Array]) -> tuple[Array, Cells, Cells]:
    """Split the cells of a mesh so that every polyline runs along facets.

    Parameters
    ----------
    points : (n, 2) array
    cells : (m, 3) array
        Positively oriented triangles.
    polylines : list of (k, 2) array
        They may end inside, cross, branch and reach beyond the mesh.

    Returns
    -------
    points : (n + new, 2) array
    cells : (m + new, 3) array
    facets : (f, 2) array
        Node pairs of the *interior* facets along the polylines.

    Raises
    ------
    InputError
        If no part of the polylines lies inside the mesh.
    """
    box = points.min(axis=0), points.max(axis=0)
    segments = [(a, b) for polyline in polylines for a, b in pairwise(polyline)]
    ends = []
    for a, b in segments:
        for end in (a, b):
            if (end >= box[0]).all() and (end <= box[1]).all():
                points, cells = _insert(points, cells, end)
    for a, b in segments:
        points, cells = _split_crossed(points, cells, a, b)
    for a, b in segments:
        ends.append(_facets_on(points, cells, a, b))
    facets = inner_facets(cells, np.concatenate([np.zeros((0, 2), dtype=np.int64), *ends]))
    if polylines and not len(facets):
        raise InputError("cuts: none of them lies inside the mesh")
    return points, cells, facets


def _insert(points: Array, cells: Cells, end: Array) -> tuple[Array, Cells]:
    """Make `end` a node, if a cell contains it: split an edge in two or a cell in three."""
    share = barycentric(points[cells], end)
    inside = np.flatnonzero((share >= -_ON).all(axis=1))
    if not len(inside):
        return points, cells
    if (share[inside] > 1 - 2 * _ON).any():
        return points, cells  # it is a node already
    on_edge = (share[inside] <= _ON).any(axis=1)
    if on_edge.any():
        cell = inside[np.argmax(on_edge)]
        edge = np.sort(np.delete(cells[cell], np.argmin(share[cell])))[None]
        return split_edges(points, cells, edge[:0], edge, end[None])[:2]
    a, b, c = cells[inside[0]]
    new = len(points)
    parts = [[[a, b, new], [b, c, new], [c, a, new]]]
    return np.vstack([points, end]), _replace(cells, inside[:1], parts)


def _split_crossed(points: Array, cells: Cells, a: Array, b: Array) -> tuple[Array, Cells]:
    """Give every edge that the segment ab crosses a node there, and split its cells."""
    edges, owner = _edges(cells, len(points))
    along = b - a
    length = float(np.hypot(*along))
    height = ((points - a) @ np.array([-along[1], along[0]])) / length
    place = ((points - a) @ along) / length
    p, q = edges.T
    step = np.linalg.norm(points[q] - points[p], axis=1)
    hp = np.where(np.abs(height[p]) <= _ON * step, 0.0, height[p])
    hq = np.where(np.abs(height[q]) <= _ON * step, 0.0, height[q])
    crossing = hp * hq < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(crossing, hp / (hp - hq), 0.0)
    at = place[p] + t * (place[q] - place[p])
    crossing &= (at > _ON * step) & (at < length - _ON * step)
    chosen = np.flatnonzero(crossing)
    if not len(chosen):
        return points, cells
    number = np.full(len(edges), -1, dtype=np.int64)
    number[chosen] = len(points) + np.arange(len(chosen))
    points = np.vstack(
        [points, points[p[chosen]] + t[chosen, None] * (points[q] - points[p])[chosen]]
    )
    on_edge = number[owner]  # (m, 3): new node on the edge opposite each corner, or −1
    touched = np.flatnonzero((on_edge >= 0).any(axis=1))
    pieces = [_parts(points, cells[c], on_edge[c]) for c in touched]
    return points, _replace(cells, touched, pieces)


def _parts(points: Array, cell: Cells, new: Cells) -> list[list[int]]:
    """Sub-triangles of a cell with nodes on one or two of its edges."""
    if np.count_nonzero(new >= 0) == 1:
        k = int(np.argmax(new >= 0))
        a, b, c = (int(cell[(k + i) % 3]) for i in range(3))
        n = int(new[k])
        return [[a, b, n], [a, n, c]]
    k = int(np.argmin(new))  # the edge opposite corner k is whole; corner k is cut off
    a, b, c = (int(cell[(k + i) % 3]) for i in range(3))
    on_ab, on_ca = int(new[(k + 2) % 3]), int(new[(k + 1) % 3])
    first = np.linalg.norm(points[on_ab] - points[c])
    second = np.linalg.norm(points[on_ca] - points[b])
    if first < second:
        return [[a, on_ab, on_ca], [on_ab, b, c], [on_ab, c, on_ca]]
    return [[a, on_ab, on_ca], [on_ab, b, on_ca], [b, c, on_ca]]


def _replace(cells: Cells, old: Cells, parts: list[list[list[int]]]) -> Cells:
    keep = np.ones(len(cells), dtype=bool)
    keep[old] = False
    added = [triangle for part in parts for triangle in part]
    return np.concatenate([cells[keep], np.array(added, dtype=np.int64)])


def _edges(cells: Cells, count: int) -> tuple[Cells, Cells]:
    """Edges (e, 2), and the edge opposite each corner of each cell (m, 3)."""
    pairs = np.sort(cells[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    keys, owner = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), owner.reshape(-1, 3)


def _facets_on(points: Array, cells: Cells, a: Array, b: Array) -> Cells:
    """Edges whose both ends lie on the segment ab."""
    edges = mesh_edges(cells)
    along = b - a
    length = float(np.hypot(*along))
    height = np.abs((points - a) @ np.array([-along[1], along[0]])) / length
    place = ((points - a) @ along) / length
    step = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    tolerance = 4 * _ON * np.maximum(step, 1e-6 * length)
    on = (height[edges] <= tolerance[:, None]) & (place[edges] >= -tolerance[:, None])
    on &= place[edges] <= length + tolerance[:, None]
    return edges[on.all(axis=1)]
