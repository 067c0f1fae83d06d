"""Imprinting the triangles of a cut that another solver realised on a given tetrahedral mesh.

An element-wise cut has its corners on edges of the mesh. These become nodes and halve all cells
around them, after which the triangles are facets, or flat groups of them are the same polygons
divided otherwise. Where two cuts cross within a cell there are corners elsewhere: then all are
imprinted like any plane polygons, which splits more cells.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from reference.meshing.edge_splitting import loosen_front, split_edges
from reference.meshing.imprint import ON, imprint_polygons
from reference.meshing.opening import cell_facets, inner_facets, measures
from verify.errors import InputError

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
Mesh = tuple[Array, Cells, Cells]  # points, cells, facets of the cut
_SAME = 1e-10  # of the size of the cut: corners this close are one
_LOST = 1e-9  # of the area: a smaller hole would join what the cut parts
_FLAT = 1e-9  # of the size of a triangle: what lies this close to its plane is in it


class Realised(NamedTuple):
    """A mesh that conforms to triangles.

    Attributes
    ----------
    points : (…, 3) array
    cells : (…, 4) array
    facets : (…, 3) array
        Nodes of the *interior* facets along the triangles.
    fitted : bool
        Whether every triangle lies within one cell of the given mesh, as those of an element-wise
        cut of that mesh do.
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
    """Whether every triangle lies within one cell."""
    for triangle in facets:
        rows = _near(points[cells], triangle.mean(axis=0))
        shares = np.stack([_shares(points[cells[rows]], x) for x in triangle])
        if not (shares.min(axis=(0, 2)) >= -ON).any():
            return False
    return True


def _merged(corners: Array) -> tuple[Array, Cells]:
    """Corners that are not the same place, and the number of each among them."""
    size = float(np.ptp(corners, axis=0).max())
    pairs = cKDTree(corners).query_pairs(_SAME * size, output_type="ndarray")
    link = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(corners),) * 2)
    _, number = connected_components(link.tocsr(), directed=False)
    _, first = np.unique(number, return_index=True)
    return corners[first], number.astype(np.int64)


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
    """Nodes (ascending) of the node, edge, facet or cell of the mesh in which a point lies."""
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
    """Cells (m, 4, 3) whose bounding box holds a point, but for round-off."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    slack = ON * (high - low).max(axis=1, keepdims=True)
    return np.flatnonzero(((low - slack <= x) & (x <= high + slack)).all(axis=1))


def _shares(corners: Array, x: Array) -> Array:
    """Barycentric coordinates (m, 4) of a point in tetrahedra (m, 4, 3)."""
    edges = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.linalg.solve(edges, (x - corners[:, 0])[:, :, None])[:, :, 0]
    return np.column_stack([1 - shares.sum(axis=1), shares])


def _as_facets(mesh: Mesh, wanted: Cells) -> tuple[Cells, Cells]:
    """Facets of the mesh that are triangles, or fill flat groups of them; and what is left."""
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
    """Rows that are not among some others; both without repetition."""
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
    link = coo_array((np.ones(flat.sum()), (one[flat], two[flat])), shape=(len(triangles),) * 2)
    return connected_components(link.tocsr(), directed=False)[1].astype(np.int64)
