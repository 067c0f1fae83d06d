"""Imprinting cuts on a given mesh, so that they run along its facets.

Polylines in the plane, plane polygons in space, and the triangles of a cut that another solver
realised. Only the cells that a cut touches are split; the rest of the mesh stays as it is. So a
conforming mesh is had that differs from an unfitted one by nothing but the cut cells: the fair peer
of a method that cuts through its elements. Slivers are left as they come.

A realised cut of elements has its corners on edges of the mesh. These become nodes and halve all
cells around them. The triangles are then facets, or flat groups of them are the same polygons
divided otherwise. Where two cuts cross within a cell there are corners elsewhere: then all are
imprinted like any plane polygons, which splits more cells.
"""

from itertools import pairwise, permutations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.meshing.edge_splitting import barycentric, loosen_front, split_edges
from reference.meshing.opening import inner_facets
from verify.errors import InputError
from verify.geometry.planar import inside_polygon
from verify.geometry.simplices import (
    cell_facets,
    connected,
    distance_to_outline,
    measures,
    mesh_edges,
    oriented,
    places_of,
)

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
_ON = 1e-10  # of an edge: closer points are the same point
_FLATTER = 2.5e-10  # of an edge: a triangle of less height is too flat to be opened (2e-10)
Mesh = tuple[Array, Cells, Cells]  # points, cells, facets of the cuts so far
ON = 3e-5  # of an edge: a closer node counts as on the plane; a corner cut off has its cube
_SAME = 1e-10  # of the size of the cut: corners this close are one
_LOST = 1e-9  # of the area: a smaller hole would join what the cut parts
_FLAT = 1e-9  # of the size of a triangle: what lies this close to its plane is in it


def structured_triangles(
    lower: tuple[float, float], upper: tuple[float, float], counts: tuple[int, int]
) -> tuple[Array, Cells]:
    """Split rectangles along their rising diagonals."""
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
    for a, b in segments:
        for end in (a, b):
            if (end >= box[0]).all() and (end <= box[1]).all():
                points, cells = _insert(points, cells, end)
    nodes_on: list[NDArray[np.bool_]] = []
    for a, b in segments:
        points, cells, nodes_on = _split_crossed(points, cells, a, b, nodes_on)
    edges = mesh_edges(cells)
    ends = [edges[on[edges].all(axis=1)] for on in nodes_on]
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


def _split_crossed(
    points: Array, cells: Cells, a: Array, b: Array, nodes_on: list[NDArray[np.bool_]]
) -> tuple[Array, Cells, list[NDArray[np.bool_]]]:
    """Give every edge that the segment ab crosses a node there, and split its cells.

    `nodes_on` are the nodes on earlier segments; those on this one come last. Whether a node is on
    it is decided once, for all of its edges: the long ones else would pass through a node that
    the short ones pass by, and a cell between the two would be set free.
    """
    edges, owner = _edges(cells, len(points))
    along = b - a
    length = float(np.hypot(*along))
    height = ((points - a) @ np.array([-along[1], along[0]])) / length
    place = ((points - a) @ along) / length
    p, q = edges.T
    step = np.linalg.norm(points[q] - points[p], axis=1)
    near = np.zeros(len(points))
    np.maximum.at(near, edges.ravel(), _FLATTER * step.repeat(2))
    level = np.where(np.abs(height) <= near, 0.0, height)
    on = (level == 0.0) & (place >= -near) & (place <= length + near)
    hp, hq = level[p], level[q]
    crossing = hp * hq < 0
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(crossing, hp / (hp - hq), 0.0)
    at = place[p] + t * (place[q] - place[p])
    crossing &= (at > _ON * step) & (at < length - _ON * step)
    chosen = np.flatnonzero(crossing)
    if not len(chosen):
        return points, cells, [*nodes_on, on]
    nodes_on = [np.append(one, one[p[chosen]] & one[q[chosen]]) for one in nodes_on]
    nodes_on.append(np.append(on, np.ones(len(chosen), dtype=bool)))
    number = np.full(len(edges), -1, dtype=np.int64)
    number[chosen] = len(points) + np.arange(len(chosen))
    points = np.vstack(
        [points, points[p[chosen]] + t[chosen, None] * (points[q] - points[p])[chosen]]
    )
    on_edge = number[owner]  # (m, 3): new node on the edge opposite each corner, or −1
    touched = np.flatnonzero((on_edge >= 0).any(axis=1))
    pieces = [_parts(points, cells[c], on_edge[c]) for c in touched]
    return points, _replace(cells, touched, pieces), nodes_on


def _parts(points: Array, cell: Cells, new: Cells) -> list[list[int]]:
    """Return sub-triangles of a cell with nodes on one or two of its edges."""
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
    """Find edges (e, 2), and the edge opposite each corner of each cell (m, 3)."""
    pairs = np.sort(cells[:, [[1, 2], [2, 0], [0, 1]]], axis=2).reshape(-1, 2)
    keys, owner = np.unique(pairs[:, 0] * count + pairs[:, 1], return_inverse=True)
    return np.column_stack(np.divmod(keys, count)), owner.reshape(-1, 3)


def structured_tetrahedra(
    lower: tuple[float, ...], upper: tuple[float, ...], counts: tuple[int, ...]
) -> tuple[Array, Cells]:
    """Split boxes into six tetrahedra each that share the rising diagonal (Kuhn)."""
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
    """Compute the middle (3,) of a plane polygon, and its two axes and normal as rows (3, 3)."""
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
    """Find the facets all of whose nodes are in the plane, each once."""
    touching = cells[on_plane[cells].sum(axis=1) >= cells.shape[1] - 1]
    facets = cell_facets(touching)
    return np.unique(facets[on_plane[facets].all(axis=1)], axis=0)


class Realised(NamedTuple):
    """A mesh that conforms to triangles.

    Attributes
    ----------
    points : (…, 3) array
    cells : (…, 4) array
    facets : (…, 3) array
        Nodes of the *interior* facets along the triangles.
    fitted : bool
        Whether every triangle lies within one cell of the given mesh, as the facets of an
        element-wise cut of that mesh do.
    """

    points: Array
    cells: Cells
    facets: Cells
    fitted: bool


def imprint_facets(points: Array, cells: Cells, facets: Array) -> Realised:
    """Split the cells of a mesh so that it conforms to triangles.

    Parameters
    ----------
    points : (n, 3) array
    cells : (m, 4) array
        Positively oriented tetrahedra.
    facets : (f, 3, 3) array
        Corners (second axis) of triangles that meet along whole edges: ``Solution.cut_facets``, m.
        A corner closer to a node than 3e-5 of an edge is taken to be the node.

    Raises
    ------
    InputError
        If there are no triangles, or a corner lies outside the mesh.
    """
    if not len(facets):
        raise InputError("the realised cut has no facets: nothing was cut")
    corners, number = _merged(facets.reshape(-1, 3))
    mesh, node = _inserted((points, cells, np.zeros((0, 3), dtype=np.int64)), corners)
    fitted = _within_cells(points, cells, facets)
    if (node >= 0).all():
        wanted = np.sort(node[number].reshape(-1, 3), axis=1)
        whole = (np.diff(wanted, axis=1) > 0).all(axis=1)  # a corner may have become a node
        found, missing = _as_facets(mesh, np.unique(wanted[whole], axis=0))
        if not len(missing):
            return Realised(*loosen_front(mesh[0], mesh[1], inner_facets(mesh[1], found)), fitted)
    imprinted = imprint_polygons(points, cells, list(facets))
    lost = 1 - measures(imprinted[0][imprinted[2]]).sum() / measures(facets).sum()
    if not abs(lost) <= _LOST:
        raise InputError(
            f"the realised cut could not be imprinted: {lost:.1e} of its area is missing"
        )
    return Realised(*imprinted, fitted)


def _within_cells(points: Array, cells: Cells, facets: Array) -> bool:
    """Tell whether every triangle lies within one cell."""
    for triangle in facets:
        rows = _near(points[cells], triangle.mean(axis=0))
        shares = np.stack([_shares(points[cells[rows]], x) for x in triangle])
        if not (shares.min(axis=(0, 2)) >= -ON).any():
            return False
    return True


def _merged(corners: Array) -> tuple[Array, Cells]:
    """Find corners that are not the same place, and the number of each among them."""
    size = float(np.ptp(corners, axis=0).max())
    number = places_of(corners, _SAME * size)
    return corners[np.unique(number, return_index=True)[1]], number


def _inserted(mesh: Mesh, corners: Array) -> tuple[Mesh, Cells]:
    """Make corners on edges nodes; return the node of each corner, −1 of those elsewhere."""
    node = np.full(len(corners), -1, dtype=np.int64)
    left = list(range(len(corners)))
    while left:
        points, cells, facets = mesh
        split: dict[tuple[int, ...], int] = {}
        again = []
        for i in left:
            place = _place(points, cells, corners[i])
            if len(place) == 1:
                node[i] = place[0]
            elif len(place) == 2 and place in split:
                again.append(i)  # a second one on this edge
            elif len(place) == 2:
                split[place] = i
        if split:
            mine = np.array(list(split.values()))
            node[mine] = len(points) + np.arange(len(mine))
            edges = np.array(list(split), dtype=np.int64)
            mesh = split_edges(points, cells, facets, edges, corners[mine])
        left = again
    return mesh, node


def _place(points: Array, cells: Cells, x: Array) -> tuple[int, ...]:
    """Find nodes (ascending) of the node, edge, facet or cell of the mesh in which a point lies."""
    rows = _near(points[cells], x)
    shares = _shares(points[cells[rows]], x)
    if not len(rows) or shares.min(axis=1).max() < -ON:
        raise InputError(
            f"a corner of the realised cut at ({', '.join(f'{c:.6g}' for c in x)}) lies outside "
            "the mesh"
        )
    best = int(np.argmax(shares.min(axis=1)))
    return tuple(sorted(cells[rows[best]][shares[best] > ON].tolist()))


def _near(corners: Array, x: Array) -> NDArray[np.int64]:
    """Find cells (m, 4, 3) whose bounding box holds a point, but for round-off."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    slack = ON * (high - low).max(axis=1, keepdims=True)
    return np.flatnonzero(((low - slack <= x) & (x <= high + slack)).all(axis=1))


def _shares(corners: Array, x: Array) -> Array:
    """Compute barycentric coordinates (m, 4) of a point in tetrahedra (m, 4, 3)."""
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.linalg.solve(edges, (x - corners[:, 0])[:, :, None])[:, :, 0]
    return np.column_stack([1 - shares.sum(axis=1), shares])


def _as_facets(mesh: Mesh, wanted: Cells) -> tuple[Cells, Cells]:
    """Find facets of mesh that are triangles, or fill flat groups of them; and the other ones."""
    points, cells, _ = mesh
    touched = np.zeros(len(points), dtype=bool)
    touched[wanted] = True
    there = cell_facets(cells[touched[cells].sum(axis=1) >= 3])
    there = np.unique(there[touched[there].all(axis=1)], axis=0)
    rows, times = np.unique(np.concatenate([there, wanted]), axis=0, return_counts=True)
    found = rows[times == 2]
    missing, others = (_without(some, found) for some in (wanted, there))
    if not len(missing):
        return found, missing
    owner = _holders(points[missing], points[others])
    group = _flat_groups(points, missing)
    held = owner >= 0
    asked = np.bincount(group, measures(points[missing]))
    filled = np.bincount(group[owner[held]], measures(points[others[held]]), minlength=len(asked))
    full = np.abs(filled - asked) <= _FLAT * asked
    use = held & full[group[owner]]
    return np.concatenate([found, others[use]]), missing[~full[group]]


def _without(rows: Cells, some: Cells) -> Cells:
    """Find rows that are not among some others; both without repetition."""
    every, times = np.unique(np.concatenate([rows, some, some]), axis=0, return_counts=True)
    return every[times == 1]


def _holders(triangles: Array, facets: Array) -> NDArray[np.int64]:
    """Find the triangle in whose plane and outline each facet lies with its middle, or −1."""
    owner = np.full(len(facets), -1, dtype=np.int64)
    middle = facets.mean(axis=1)
    for i, (a, b, c) in enumerate(triangles):
        u, v, normal = b - a, c - a, np.cross(b - a, c - a)
        size = float(np.linalg.norm(normal))
        shares = np.column_stack(
            [
                np.cross(middle - a, v) @ normal / size**2,
                np.cross(u, middle - a) @ normal / size**2,
            ]
        )
        away = np.abs((facets - a) @ normal / size).max(axis=1)
        inside = (shares >= -_FLAT).all(axis=1) & (shares.sum(axis=1) <= 1 + _FLAT)
        owner[inside & (away <= _FLAT * np.sqrt(size))] = i
    return owner


def _flat_groups(points: Array, triangles: Cells) -> NDArray[np.int64]:
    """Give numbers to the groups of triangles that edges join and that share a plane."""
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [0, 2]], triangles[:, [1, 2]]])
    _, edge = np.unique(edges, axis=0, return_inverse=True)
    owner = np.tile(np.arange(len(triangles)), 3)
    order = np.argsort(edge, kind="stable")
    edge, owner = edge.ravel()[order], owner[order]
    twin = np.flatnonzero(edge[1:] == edge[:-1])
    one, two = owner[twin], owner[twin + 1]
    corner = points[triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    size = np.linalg.norm(normal, axis=1)
    away = np.einsum("nij,nj->ni", corner[two] - corner[one, :1], normal[one]) / size[one, None]
    flat = np.abs(away).max(axis=1) <= _FLAT * np.sqrt(size[one])
    return connected(len(triangles), one[flat], two[flat])
