"""Imprinting plane polygons on given tetrahedra or triangles in space: they run along facets.

Only the cells that a polygon touches are split, by halving edges; the rest of the mesh stays as it
is.
"""

from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import barycentric, loosen_front, mesh_edges, split_edges
from reference.meshing.opening import cell_facets, inner_facets
from reference.meshing.session import oriented
from verify.errors import InputError
from verify.geometry.nearest import distance_to_outline
from verify.geometry.planar import inside_polygon

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
Mesh = tuple[Array, Cells, Cells]  # points, cells, facets of the cuts so far
ON = 3e-5  # of an edge: a closer node counts as on the plane; a corner cut off has its cube


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
        mesh, on_plane = _insert(mesh, on_plane, end, origin, axes)
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


def _insert(
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
