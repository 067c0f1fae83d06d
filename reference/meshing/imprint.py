"""Imprinting polylines, and plane polygons in space, on a given mesh: they run along its facets.

Only the cells that a cut touches are split; the rest of the mesh stays as it is. So a conforming
mesh is had that differs from an unfitted one by nothing but the cut cells: the fair peer of a
method that cuts through its elements. Slivers are left as they come.
"""

from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import barycentric, loosen_front, split_edges
from reference.meshing.opening import cell_facets, inner_facets
from verify.errors import InputError
from verify.geometry.nearest import distance_to_outline
from verify.geometry.planar import inside_polygon
from verify.geometry.refinement import mesh_edges, oriented

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
_ON = 1e-10  # of an edge: closer points are the same point
Mesh = tuple[Array, Cells, Cells]  # points, cells, facets of the cuts so far
ON = 3e-5  # of an edge: a closer node counts as on the plane; a corner cut off has its cube


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


def structured_tetrahedra(
    lower: tuple[float, ...], upper: tuple[float, ...], counts: tuple[int, ...]
) -> tuple[Array, Cells]:
    """Boxes split into six tetrahedra each that share the rising diagonal (Kuhn)."""
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(lower, upper, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    number = np.arange(grid[..., 0].size).reshape(grid.shape[:3])
    cells = []
    for order in permutations(range(3)):
        corner, path = np.zeros(3, dtype=int), []
        for axis in (None, *order):
            if axis is not None:
                corner[axis] = 1
            window = tuple(slice(c, c + n) for c, n in zip(corner, counts, strict=True))
            path.append(number[window].ravel())
        cells.append(np.column_stack(path))
    points = grid.reshape(-1, 3)
    return points, oriented(points, np.concatenate(cells))


def imprint_polygons(points: Array, cells: Cells, polygons: list[Array]) -> Mesh:
    """Split the cells of a mesh so that every polygon runs along facets.

    Parameters
    ----------
    points : (n, 3) array
    cells : (m, k + 1) array
        Positively oriented tetrahedra, or triangles of a membrane.
    polygons : list of (c, 3) array
        Plane and simple; they may end inside, cross, branch and reach beyond the mesh.

    Returns
    -------
    points : (…, 3) array
    cells : (…, k + 1) array
    facets : (f, k) array
        Nodes of the *interior* facets along the polygons.

    Raises
    ------
    InputError
        If no part of the polygons lies inside the mesh.
    """
    solid = cells.shape[1] == 4
    mesh: Mesh = (points, cells, np.zeros((0, cells.shape[1] - 1), dtype=np.int64))
    for corners in polygons:
        mesh = trace_polygon(mesh, corners, insert=solid)
    points, cells, facets = mesh
    kept = inner_facets(cells, facets)
    if polygons and not len(kept):
        lies = "lies inside the mesh" if solid else "crosses the membrane"
        raise InputError(f"cuts: none of them {lies}")
    return loosen_front(points, cells, kept)


def trace_polygon(mesh: Mesh, corners: Array, insert: bool) -> Mesh:
    """Split cells, of triangles or tetrahedra, until a polygon runs along facets; add these.

    Parameters
    ----------
    mesh : Mesh
    corners : (k, 3) array
    insert : bool
        Whether its corners become nodes, as they must within tetrahedra.
    """
    origin, axes = plane_frame(corners)
    outline = (corners - origin) @ axes[:2].T
    mesh, on_plane = split_by_plane(mesh, outline, origin, axes)
    for end in outline if insert else ():
        mesh, on_plane = _insert_corner(mesh, on_plane, end, origin, axes)
    for a, b in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        mesh, on_plane = split_by_line(mesh, on_plane, a, b, origin, axes)
    points, cells, facets = mesh
    mine = plane_facets(cells, on_plane)
    middles = (points[mine].mean(axis=1) - origin) @ axes[:2].T
    return points, cells, np.concatenate([facets, mine[inside_polygon(middles, outline)]])


def plane_frame(corners: Array) -> tuple[Array, Array]:
    """Middle (3,) of a plane polygon, and its two axes and normal as rows (3, 3)."""
    origin = corners.mean(axis=0)
    axes = np.linalg.svd(corners - origin)[2]
    return origin, axes


def split_by_plane(
    mesh: Mesh, outline: Array, origin: Array, axes: Array
) -> tuple[Mesh, NDArray[np.bool_]]:
    """Split every edge that crosses the plane, of the cells that the polygon touches."""
    points, cells, facets = mesh
    height = (points - origin) @ axes[2]
    edges = mesh_edges(cells)
    step = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    shortest = np.full(len(points), np.inf)
    for k in range(2):
        np.minimum.at(shortest, edges[:, k], step)
    height[np.abs(height) <= ON * shortest] = 0.0
    corner = height[cells]
    crossed = np.flatnonzero((corner.min(axis=1) < 0) & (corner.max(axis=1) > 0))
    middles = (points[cells[crossed]].mean(axis=1) - origin) @ axes[:2].T
    reach = np.linalg.norm(
        points[cells[crossed]] - points[cells[crossed]].mean(axis=1)[:, None], axis=2
    ).max(axis=1)
    near = inside_polygon(middles, outline) | (distance_to_outline(middles, outline) <= reach)
    mine = mesh_edges(cells[crossed[near]]) if near.any() else np.zeros((0, 2), dtype=np.int64)
    mine = mine[height[mine[:, 0]] * height[mine[:, 1]] < 0]
    share = (height[mine[:, 0]] / (height[mine[:, 0]] - height[mine[:, 1]]))[:, None]
    places = (1 - share) * points[mine[:, 0]] + share * points[mine[:, 1]]
    on_plane = np.concatenate([height == 0.0, np.ones(len(mine), dtype=bool)])
    return split_edges(points, cells, facets, mine, places), on_plane


def split_by_line(
    mesh: Mesh, on_plane: NDArray[np.bool_], a: Array, b: Array, origin: Array, axes: Array
) -> tuple[Mesh, NDArray[np.bool_]]:
    """Split the edges in the plane, of facets there, that cross the segment ab."""
    points, cells, facets = mesh
    mine = plane_facets(cells, on_plane)
    if not len(mine):
        return mesh, on_plane
    edges = mesh_edges(mine)
    place = (points - origin) @ axes[:2].T
    along = (b - a) / np.linalg.norm(b - a)
    height = (place - a) @ np.array([-along[1], along[0]])
    length = float(np.linalg.norm(b - a))
    step = np.linalg.norm(place[edges[:, 1]] - place[edges[:, 0]], axis=1)
    one, two = height[edges].T
    crossing = (one * two < 0) & (np.minimum(np.abs(one), np.abs(two)) > ON * step)
    edges, one, two, step = (v[crossing] for v in (edges, one, two, step))
    share = (one / (one - two))[:, None]
    at = ((1 - share) * place[edges[:, 0]] + share * place[edges[:, 1]] - a) @ along
    # the ends of ab: a corner between facets is a node already, one on a line of a surface is not
    slack = ON * step if cells.shape[1] == 4 else -ON * step
    inside = (at > slack) & (at < length - slack)
    edges, share = edges[inside], share[inside]
    places = (1 - share) * points[edges[:, 0]] + share * points[edges[:, 1]]
    on_plane = np.concatenate([on_plane, np.ones(len(edges), dtype=bool)])
    return split_edges(points, cells, facets, edges, places), on_plane


def _insert_corner(
    mesh: Mesh, on_plane: NDArray[np.bool_], end: Array, origin: Array, axes: Array
) -> tuple[Mesh, NDArray[np.bool_]]:
    """Make a corner of the polygon a node, if a facet in the plane contains it."""
    points, cells, facets = mesh
    mine = plane_facets(cells, on_plane)
    place = (points - origin) @ axes[:2].T
    shares = barycentric(place[mine], end)
    inside = np.flatnonzero((shares >= -ON).all(axis=1))
    if not len(inside) or (shares[inside] > 1 - 2 * ON).any():
        return mesh, on_plane  # outside the body, or a node already
    facet, share = mine[inside[0]], shares[inside[0]]
    at = (origin + end @ axes[:2])[None]
    on_plane = np.append(on_plane, True)
    if share.min() <= ON:
        edge = np.sort(np.delete(facet, np.argmin(share)))[None]
        return split_edges(points, cells, facets, edge, at), on_plane
    new = len(points)
    cells, facets = (_star(simplices, facet, new) for simplices in (cells, facets))
    return (np.vstack([points, at]), cells, facets), on_plane


def _star(simplices: Cells, facet: Cells, new: int) -> Cells:
    """Split the simplices that have a facet into three about a new node on it."""
    hit = np.isin(simplices, facet).sum(axis=1) == 3
    parts = [np.where(simplices[hit] == node, new, simplices[hit]) for node in facet]
    return np.concatenate([simplices[~hit], *parts])


def plane_facets(cells: Cells, on_plane: NDArray[np.bool_]) -> Cells:
    """Facets all of whose nodes are in the plane, each once."""
    touching = cells[on_plane[cells].sum(axis=1) >= cells.shape[1] - 1]
    facets = cell_facets(touching)
    return np.unique(facets[on_plane[facets].all(axis=1)], axis=0)
