"""Segments, triangles and tetrahedra: measures, nearest points, areas in a box, refinement.

Refinement is uniform (red): every edge is halved, and shapes stay bounded. The octahedron that is
left of a tetrahedron is split along the diagonal 02–13; its descendants then have at most three
shapes, on any level (Bey, Tetrahedral grid refinement, Computing 55, 1995).
"""

from collections.abc import Sequence
from functools import cache
from itertools import combinations
from math import factorial
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_TOLERANCE = 1e-9  # of the body's size


def frame(normal: ArrayLike, axis: ArrayLike | None = None) -> Array:
    """Right-handed orthonormal frame, as rows (3, 3), whose third vector is along `normal`.

    Parameters
    ----------
    normal : (3,) array_like
        Not zero.
    axis : (3,) array_like, optional
        The first vector is along its projection; by default along the projection of the
        coordinate direction that is farthest from the normal.
    """
    third = np.asarray(normal, dtype=float)
    third = third / np.linalg.norm(third)
    guide = np.eye(3)[np.argmin(np.abs(third))] if axis is None else np.asarray(axis, dtype=float)
    first = guide - (guide @ third) * third
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])


def determinants(matrices: Array) -> Array:
    """Compute determinants (m,) of matrices (m, d, d), d ≤ 3: several times as fast as by LU."""
    rows = np.moveaxis(matrices, (1, 2), (0, 1))
    if len(rows) == 1:
        return np.asarray(rows[0, 0])
    if len(rows) == 2:
        return np.asarray(rows[0, 0] * rows[1, 1] - rows[0, 1] * rows[1, 0])
    a, (b, c, d), (e, f, g) = rows
    return np.asarray(a[0] * (c * g - d * f) + a[1] * (d * e - b * g) + a[2] * (b * f - c * e))


def measures(simplices: Array) -> Array:
    """Lengths, areas, volumes (m,) of segments, triangles, tetrahedra (m, c, d); of a point 1."""
    edges = simplices[:, 1:] - simplices[:, :1]
    count, d = edges.shape[1:]
    if count == 0:
        return np.ones(len(edges))
    if count == d:
        size = np.abs(determinants(edges))
    elif count == 2:  # Gram's determinant is a square: it loses thin triangles
        opposite = np.linalg.norm(simplices[:, [2, 0, 1]] - simplices[:, [1, 2, 0]], axis=2)
        apex, rows = np.argmax(opposite, axis=1), np.arange(len(simplices))
        at, after, before = (simplices[rows, (apex + k) % 3] for k in range(3))
        size = np.linalg.norm(np.cross(after - at, before - at), axis=1)  # of the shorter edges
    else:
        size = np.linalg.norm(edges[:, 0], axis=1)
    return np.asarray(size / factorial(count))


def bounds_of(corners: Array) -> tuple[Array, Array]:
    """Find lowest and highest coordinates (m, d) of the corners (m, k, d) of each of m simplices.

    Corner by corner: ten times as fast as along an axis of a few.
    """
    low, high = corners[:, 0], corners[:, 0]
    for k in range(1, corners.shape[1]):
        low, high = np.minimum(low, corners[:, k]), np.maximum(high, corners[:, k])
    return low, high


@cache
def unit_rule(order: int) -> tuple[Array, Array]:
    """Gauss points and weights (order,) on [0, 1]."""
    points, weights = np.polynomial.legendre.leggauss(order)
    return 0.5 * (points + 1.0), 0.5 * weights


def cell_facets(cells: Ints) -> Ints:
    """Nodes (m · c, c − 1), ascending, of the facets of cells (m, c), opposite each corner."""
    corners = [[c for c in range(cells.shape[1]) if c != k] for k in range(cells.shape[1])]
    return np.sort(cells[:, corners], axis=2).reshape(-1, cells.shape[1] - 1)


def halves(corners: Array, i: Ints, j: Ints, share: Array) -> Array:
    """Halves (2 m, k, d) of simplices at shares (m,) of their edges ij; the first m have corner i.

    Corners i and j, (m,), are local numbers.
    """
    row = np.arange(len(i))
    near, far = corners.copy(), corners.copy()
    middle = (1.0 - share)[:, None] * corners[row, i] + share[:, None] * corners[row, j]
    near[row, j] = far[row, i] = middle
    return np.concatenate([near, far])


def split_at_zeros(corners: Array, values: Array) -> tuple[Array, Array, Ints]:
    """Divide simplices (m, k, d) along the zeros of functions (m, k) that are affine on each.

    Returns
    -------
    corners : (n, k, d) array
    values : (n, k) array
        Of the functions, of one sign in each.
    parent : (n,) int array
        Which simplex it is a part of.
    """
    pairs = np.array(list(combinations(range(values.shape[1]), 2)))
    done, parent = [], np.arange(len(corners))
    while True:
        with np.errstate(invalid="ignore"):
            crossed = values[:, pairs[:, 0]] * values[:, pairs[:, 1]] < 0.0
        some = crossed.any(axis=1)
        done.append((corners[~some], values[~some], parent[~some]))
        if not some.any():
            break
        i, j = pairs[crossed[some].argmax(axis=1)].T
        row, values, parent = np.arange(len(i)), values[some], np.tile(parent[some], 2)
        a, b = values[row, i], values[row, j]
        corners, values = halves(corners[some], i, j, a / (a - b)), np.tile(values, (2, 1))
        values[row, j] = values[len(row) + row, i] = 0.0
    corners, values, parent = (np.concatenate(column) for column in zip(*done, strict=True))
    return corners, values, parent


def connected(count: int, first: Ints, second: Ints) -> Ints:
    """Label the components (count,) of a graph with edges from `first` (q,) to `second` (q,)."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    link = coo_array((np.ones(len(first)), (first, second)), shape=(count, count))
    number: Ints = connected_components(link, directed=False)[1].astype(np.int64)
    return number


def connected_cells(cells: Ints) -> Ints:
    """Label (m,) the pieces of a body by its cells (m, c); facets join the cells of a piece."""
    facets, number = np.unique(cell_facets(cells), axis=0, return_inverse=True)
    cell = np.repeat(np.arange(len(cells)), cells.shape[1])
    return connected(len(cells) + len(facets), cell, len(cells) + number.ravel())[: len(cells)]


def places_of(points: Array, reach: float) -> Ints:
    """Give each of points (n, d) the number (n,) of its place: one within a `reach`, m."""
    from scipy.spatial import cKDTree

    if not len(points):
        return np.zeros(0, dtype=np.int64)
    return connected(len(points), *cKDTree(points).query_pairs(reach, output_type="ndarray").T)


def boundary_facets(cells: Ints) -> tuple[Ints, Ints, Ints]:
    """Facets (f, c − 1) that one cell (m, c) alone has; that cell (f,), the opposite corner (f,).

    Nodes ascend in each facet, and facets are in lexicographic order. Corners are 0 … c − 1.
    """
    facets = cell_facets(cells)
    key = facets[:, 0]
    for column in facets.T[1:]:
        key = key * (int(cells.max(initial=0)) + 1) + column
    order = np.argsort(key, kind="stable")
    first = np.flatnonzero(np.append(True, np.diff(key[order]) > 0))
    alone = order[first[np.diff(np.append(first, len(key))) == 1]]
    return facets[alone], *np.divmod(alone, cells.shape[1])


def boundary_loops(cells: Ints) -> list[Ints]:
    """Find the nodes of the closed curves that bound triangles (m, 3) of positive orientation."""
    edges = cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    _, first, count = np.unique(
        np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True
    )
    following: dict[int, list[int]] = {}
    for start, end in edges[first[count == 1]].tolist():
        following.setdefault(start, []).append(end)
    loops = []
    while following:
        start = node = next(iter(following))
        loop = []
        while True:
            loop.append(node)
            ends = following[node]
            node, at = ends.pop(), node
            if not ends:
                del following[at]
            if node == start:
                break
        loops.append(np.array(loop, dtype=np.int64))
    return loops


def unit_normals(simplices: Array) -> Array:
    """Return unit normals (m, d) of segments (m, 2, 2), to the left, or of triangles (m, 3, 3).

    NaN where there is none.
    """
    edges = np.moveaxis(simplices[:, 1:] - simplices[:, :1], 1, 0)
    across = np.cross(*edges) if len(edges) == 2 else edges[0][:, ::-1] * [-1.0, 1.0]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def ear_clipping(corners: Array) -> Ints:
    """Triangles (n - 2, 3) of a plane simple polygon (n, 3), turned as the polygon is."""
    spokes = corners - corners[0]
    plane = corners @ frame(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0))[:2].T
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        areas = []
        for k in range(len(left)):
            ear = plane[[left[k - 1], left[k], left[(k + 1) % len(left)]]]
            area = _area(ear)
            others = plane[[i for j, i in enumerate(left) if abs(j - k) > 1]]
            blocked = area > 0.0 and len(others) > 0 and bool(_strictly_inside(others, ear).any())
            areas.append(-np.inf if blocked else area)
        k = int(np.argmax(areas))
        triangles.append((left[k - 1], left[k], left[(k + 1) % len(left)]))
        del left[k]
    return np.array([*triangles, tuple(left)], dtype=np.int64)


def _area(triangle: Array) -> float:
    (ax, ay), (bx, by), (cx, cy) = triangle
    return 0.5 * float((bx - ax) * (cy - ay) - (cx - ax) * (by - ay))


def _strictly_inside(points: Array, triangle: Array) -> NDArray[np.bool_]:
    """Whether points (n, 2) other than its corners lie in an anticlockwise triangle (3, 2)."""
    inside = (points[:, None] != triangle).any(axis=2).all(axis=1)
    for k in range(3):
        a, b = triangle[k], triangle[(k + 1) % 3]
        inside &= (b[0] - a[0]) * (points[:, 1] - a[1]) - (points[:, 0] - a[0]) * (
            b[1] - a[1]
        ) >= 0.0
    return inside


def area_inside(surface: tuple[Array, Ints], lower: Array, upper: Array) -> float:
    """Area of a triangulated surface inside an open box; what lies along its faces is not."""
    points, triangles = surface
    tolerance = _TOLERANCE * float(np.max(upper - lower))
    total = 0.0
    for triangle in points[triangles]:
        polygon = _clipped(triangle, lower, upper)
        if len(polygon) >= 3:
            middle = polygon.mean(axis=0)
            if ((middle > lower + tolerance) & (middle < upper - tolerance)).all():
                total += _polygon_area(polygon)
    return total if total > tolerance**2 else 0.0


def length_inside(edges: Array, lower: Array, upper: Array) -> float:
    """Length of segments (r, 2, 3) inside an open box."""
    tolerance = _TOLERANCE * float(np.max(upper - lower))
    total = 0.0
    for a, b in edges:
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.concatenate(
                [(lower + tolerance - a) / (b - a), (upper - tolerance - a) / (b - a)]
            )
        stops = np.unique(np.concatenate([s[(s > 0) & (s < 1)], [0.0, 1.0]]))
        middle = a + 0.5 * (stops[1:] + stops[:-1])[:, None] * (b - a)
        inside = ((middle > lower + tolerance) & (middle < upper - tolerance)).all(axis=1)
        total += float(np.diff(stops)[inside].sum() * np.linalg.norm(b - a))
    return total if total > tolerance else 0.0


def rim_edges(surface: tuple[Array, Ints]) -> Array:
    """Edges (r, 2, 3) that belong to one triangle only."""
    points, triangles = surface
    return np.asarray(points[boundary_facets(triangles)[0]])


def overlap_area(one: tuple[Array, Ints], other: tuple[Array, Ints]) -> float:
    """Area over which two triangulated surfaces lie on each other, m²."""
    first, second = one[0][one[1]], other[0][other[1]]
    scale = float(np.ptp(np.vstack([one[0], other[0]]), axis=0).max())
    tolerance = _TOLERANCE * scale
    total = 0.0
    normals = unit_normals(second)
    for triangle in first:
        off = np.abs(np.einsum("tij,tj->ti", triangle - second[:, :1], normals)).max(axis=1)
        apart = (triangle.min(axis=0) > second.max(axis=1) + tolerance) | (
            triangle.max(axis=0) < second.min(axis=1) - tolerance
        )
        for k in np.flatnonzero((off <= tolerance) & ~apart.any(axis=1)):
            total += _common_area(triangle, second[k], normals[k])
    return total if total > tolerance * scale else 0.0


def _common_area(one: Array, other: Array, normal: Array) -> float:
    polygon = one
    for k in range(3):
        a, b = other[k], other[(k + 1) % 3]
        inward = np.cross(normal, b - a)
        polygon = _half(polygon, (polygon - a) @ inward)
    return _polygon_area(polygon) if len(polygon) >= 3 else 0.0


def _clipped(polygon: Array, lower: Array, upper: Array) -> Array:
    """Part (k, 3) of a plane polygon inside a closed box (Sutherland & Hodgman 1974)."""
    for axis in range(3):
        polygon = _half(polygon, polygon[:, axis] - lower[axis])
        polygon = _half(polygon, upper[axis] - polygon[:, axis])
    return polygon


def _half(polygon: Array, height: Array) -> Array:
    """Part of a polygon (k, 3) where the linear function with these corner values is ≥ 0."""
    kept = []
    for i in range(len(polygon)):
        j = (i + 1) % len(polygon)
        if height[i] >= 0.0:
            kept.append(polygon[i])
        if (height[i] >= 0.0) != (height[j] >= 0.0):
            share = height[i] / (height[i] - height[j])
            kept.append(polygon[i] + share * (polygon[j] - polygon[i]))
    return np.array(kept).reshape(-1, 3)


def _polygon_area(polygon: Array) -> float:
    spokes = polygon - polygon[0]
    return 0.5 * float(np.linalg.norm(np.cross(spokes[1:-1], spokes[2:]).sum(axis=0)))


_AT_ONCE = 2**14  # pairs of a point and a part: their arrays stay in the cache


def shares(points: Array, starts: Array, ends: Array) -> Array:
    """Where on segments the nearest points are: 0 at the start, 1 at the end.

    The arrays (..., d) are broadcast against each other; a segment may have no length.
    """
    along = ends - starts
    square = np.maximum(_products(along, along), np.finfo(float).tiny)
    found: Array = np.clip(_products(points - starts, along) / square, 0.0, 1.0)
    return found


def _products(one: Array, other: Array) -> Array:
    """Inner products (...,) of vectors (..., d): by column, which is faster than along them."""
    found: Array = one[..., 0] * other[..., 0]
    for axis in range(1, one.shape[-1]):
        found = found + one[..., axis] * other[..., axis]
    return found


def feet(points: Array, starts: Array, ends: Array) -> Array:
    """Nearest points (..., d) on segments; the arrays are broadcast against each other."""
    found: Array = starts + shares(points, starts, ends)[..., None] * (ends - starts)
    return found


def inner_range(first: Array, last: Array) -> tuple[Array, Array]:
    """Range (n,), (n,) of the parameter of segments in which k linear functions are not negative.

    By their values (n, k) at both ends (Cyrus and Beck, 1978); it begins at infinity where there
    is none.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = first / (first - last)
    low = np.where(first < 0.0, share, 0.0).max(axis=1)
    high = np.where((first >= 0.0) & (last < 0.0), share, 1.0).min(axis=1)
    return np.where(((first < 0.0) & (last < 0.0)).any(axis=1), np.inf, low), high


def nearest_parts(points: Array, parts: Array) -> tuple[Array, Ints]:
    """Distances (n,) of points (n, d) to the nearest of segments or triangles, and its number.

    Parameters
    ----------
    points : (n, d) array
    parts : (m, 2, d) or (m, 3, 3) array
        Ends of segments, or corners of triangles in space, m > 0.
    """
    distance, number = np.empty(len(points)), np.empty(len(points), dtype=np.int64)
    step = max(1, _AT_ONCE // len(parts))
    for start in range(0, len(points), step):
        here = slice(start, start + step)
        away = distances(points[here, None], parts)
        number[here] = away.argmin(axis=1)
        distance[here] = away.min(axis=1)
    return distance, number


def distance_to_outline(points: Array, corners: Array) -> Array:
    """Distance (n,) of each of `points` (n, d) to the closed outline `corners` (k, d)."""
    return nearest_parts(points, np.stack([corners, np.roll(corners, -1, axis=0)], axis=1))[0]


def distance_to_polyline(points: Array, vertices: Array) -> Array:
    """Distance (n,) of each of `points` (n, d) to the polyline `vertices` (k, d)."""
    return nearest_parts(points, np.stack([vertices[:-1], vertices[1:]], axis=1))[0]


class HasFeet(Protocol):
    """A piece of a curve or of a surface."""

    def foot(self, points: Array, /) -> Array:
        """Nearest points (n, d) to points (n, d)."""


def distance_to_pieces(points: Array, pieces: Sequence[HasFeet]) -> Array:
    """Distance (n,) of points (n, d) to the nearest of pieces of a cut, not cut into facets, m."""
    away = [np.linalg.norm(points - one.foot(points), axis=1) for one in pieces]
    return np.asarray(np.min(away, axis=0), dtype=float)


def nearest_cut(facets: Array, cuts: Sequence[Sequence[HasFeet]]) -> NDArray[np.int64]:
    """Tell which of the cuts each facet (f, d, d) lies on, by the pieces of each cut.

    A facet on a curved cut is off by its own sagitta: its farthest corner or middle decides.
    """
    places = np.concatenate([facets, facets.mean(axis=1, keepdims=True)], axis=1)
    points = places.reshape(-1, facets.shape[2])
    off = [distance_to_pieces(points, one).reshape(places.shape[:2]).max(axis=1) for one in cuts]
    return np.argmin(off, axis=0) if off else np.zeros(0, dtype=np.int64)


def distances(points: Array, parts: Array) -> Array:
    """Distances of points (..., d) to segments or triangles (m, k, d), broadcast to (..., m)."""
    edges = [(0, 1)] if parts.shape[1] == 2 else [(0, 1), (1, 2), (2, 0)]
    away: Array = np.asarray(np.inf)
    for i, j in edges:
        off = points - feet(points, parts[:, i], parts[:, j])
        away = np.minimum(away, _products(off, off))
    away = np.sqrt(away)
    if len(edges) == 3:
        normal = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
        above = np.ones(away.shape, dtype=bool)
        for i, j in edges:
            inward = np.cross(normal, parts[:, j] - parts[:, i])
            above &= _products(points - parts[:, i], inward) >= 0.0
        height = np.abs(_products(points - parts[:, 0], normal))
        height /= np.linalg.norm(normal, axis=1)
        away = np.where(above, np.minimum(away, height), away)
    return away


def on_simplices(points: Array, corners: Array, tolerance: float) -> NDArray[np.bool_]:
    """Tell which points (n, d) lie on simplices (m, c, d) with c corners, within a tolerance, m."""
    from scipy.spatial import cKDTree  # commands that only read cases shall not load scipy

    found = np.zeros(len(points), dtype=bool)
    start, edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
    # rates of the barycentric coordinates but the first
    rates = np.linalg.pinv(edges) if edges.shape[1] else np.swapaxes(edges, 1, 2)
    middle = corners.mean(axis=1)
    reach = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1) * (1.0 + 1e-12)
    for begin in range(0, len(points), 4 * _AT_ONCE):
        some = points[begin : begin + 4 * _AT_ONCE]
        near = cKDTree(some).query_ball_point(middle, reach + tolerance)
        which = np.repeat(np.arange(len(near)), [len(one) for one in near])
        point = np.concatenate([*near, []]).astype(np.int64)
        away = some[point] - start[which]
        share = np.einsum("nd,ndc->nc", away, rates[which])
        on = np.linalg.norm(away - np.einsum("nc,ncd->nd", share, edges[which]), axis=1)
        on = on <= tolerance
        on &= (share >= -tolerance * np.linalg.norm(rates[which], axis=1)).all(axis=1)
        last = np.linalg.norm(rates.sum(axis=2), axis=1)[which]
        on &= 1.0 - share.sum(axis=1) >= -tolerance * last
        found[begin + point[on]] = True
    return found


Cells = NDArray[np.int64]

# children by corners (single digits) and middles of edges
_CHILDREN = {
    2: ["0 01", "01 1"],
    3: ["0 01 02", "01 1 12", "02 12 2", "01 12 02"],
    4: [
        "0 01 02 03", "01 1 12 13", "02 12 2 23", "03 13 23 3",
        "01 02 03 13", "01 02 12 13", "02 03 13 23", "02 12 13 23",
    ],
}  # fmt: skip


def mesh_edges(simplices: Cells) -> Cells:
    """Edges (e, 2) of simplices (m, k), each once, the smaller node first."""
    pairs = np.concatenate(
        [simplices[:, [i, j]] for i, j in combinations(range(simplices.shape[1]), 2)]
    )
    pairs.sort(axis=1)
    count = int(pairs.max(initial=0)) + 1
    return np.column_stack(np.divmod(np.unique(pairs[:, 0] * count + pairs[:, 1]), count))


def oriented(points: Array, cells: Cells) -> Cells:
    """Swap two corners of each cell of negative volume; triangles in space stay as they are."""
    if cells.shape[1] <= points.shape[1]:
        return cells
    negative = determinants(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells = cells.copy()
    cells[negative, 0], cells[negative, 1] = cells[negative, 1], cells[negative, 0].copy()
    return cells


def refine_uniformly(
    points: Array, cells: Cells, facets: Cells, times: int = 1
) -> tuple[Array, Cells, Cells]:
    """Halve all edges, once or several times.

    All times in one call: the descendants of a tetrahedron have three shapes only if its corners
    keep their order from level to level.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, k + 1) array
        Of positive orientation, if k = d.
    facets : (f, k) array
        Marked facets, refined with the cells.
    times : int

    Returns
    -------
    points : (…, d) array
        The given ones first.
    cells : (2^(k·times) m, k + 1) array
        Oriented as the given ones.
    facets : (2^((k−1)·times) f, k) array
    """
    for _ in range(times):
        edges, count = mesh_edges(cells), len(points)
        keys = edges[:, 0] * count + edges[:, 1]
        points = np.vstack([points, points[edges].mean(axis=1)])
        cells, facets = _children(cells, keys, count), _children(facets, keys, count)
    return points, oriented(points, cells), facets


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
