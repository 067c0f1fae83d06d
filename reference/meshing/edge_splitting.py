"""Changes of a given simplicial mesh: edges split, flat triangles flipped, rings refined.

Every cell around an edge that is split is halved, none is left behind: whatever edges are asked
for, in the plane or in space, the mesh stays conforming.
"""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from reference.meshing.opening import doubled_nodes
from verify.geometry.simplices import mesh_edges, nearest_parts

Array = NDArray[np.float64]
Cells = NDArray[np.int64]
_EXPONENT = {2: 0.8, 3: 2 / 3}  # of element sizes around singularities, see `Grading`
_RADIUS = 1 / 8  # of the body: within that distance a given mesh is graded
_SMALLEST = 1e-9  # of the radius of the grading: nearer, distances of file coordinates are noise
_LONGEST = {2: 1.5, 3: 2.0}  # longest edge of a cell over the mean edge, the wanted size
_SHRINK = 0.25  # of one ring around a singular point to the next
_SAME = 1e-10  # of the body's size: a node closer than that to a singular point is on it
# area over the square of the longest edge, at most, of a flat triangle: an angle that no mesh
# generator aims at, and at which splitting its edges would leave none that is not flat
_FLAT = 1e-6
_ROUNDS = 8  # flat triangles that lie on flat ones are flipped from the outside in


def barycentric(corners: Array, x: Array) -> Array:
    """Compute barycentric coordinates (m, 3) of a point in plane triangles (m, 3, 2)."""
    a, b, c = corners.swapaxes(0, 1)
    u, v, w = b - a, c - a, x - a
    det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / det
    t = (u[:, 0] * w[:, 1] - u[:, 1] * w[:, 0]) / det
    return np.column_stack([1 - s - t, s, t])


def split_edges(
    points: Array, cells: Cells, facets: Cells, edges: Cells, places: Array
) -> tuple[Array, Cells, Cells]:
    """Put a node on each of some edges and halve all cells and facets that have the edge.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, d + 1) array
    facets : (f, d) array
        Marked facets; they are split with the cells.
    edges : (e, 2) array
        Nodes of distinct edges, the smaller one first.
    places : (e, d) array
        Where the new nodes lie, m.

    Returns
    -------
    points : (n + e, d) array
        The new nodes come last, in the order of `edges`.
    cells : (…, d + 1) array
        Of the same orientation.
    facets : (…, d) array
    """
    count = len(points) + len(edges)
    keys = edges[:, 0] * count + edges[:, 1]
    order = np.argsort(keys)
    keys, number = keys[order], len(points) + order
    resting, facets = [], facets.copy()
    while len(keys):
        # an edge that comes first in all cells around it can be split together with its like
        first = _first_edge(cells, keys, count)
        resting.append(cells[first < 0])
        cells, first = cells[first >= 0], first[first >= 0]
        ready = _first_everywhere(cells, first, keys, count)
        mine = ready[first]
        cells = np.concatenate(
            [cells[~mine], _halves(cells[mine], first[mine], keys, number, count)]
        )
        if len(facets):
            of_facet = _first_edge(facets, np.where(ready, keys, -1 - np.arange(len(keys))), count)
            cut = of_facet >= 0
            halves = _halves(facets[cut], of_facet[cut], keys, number, count)
            facets = np.concatenate([facets[~cut], halves])
        keys, number = keys[~ready], number[~ready]
    return np.vstack([points, places]), np.concatenate([*resting, cells]), facets


def loosen_front(points: Array, cells: Cells, facets: Cells) -> tuple[Array, Cells, Cells]:
    """Split each edge inside a cut whose two ends both lie on a front or are tips.

    Its ends stay single, so the cut could not open along it, nor could a facet in a corner of a
    front open at all.
    """
    if not len(facets):
        return points, cells, facets
    opened = np.zeros(len(points), dtype=bool)
    opened[doubled_nodes(cells, facets)] = True
    corners = facets.shape[1]
    pairs = np.concatenate([facets[:, [i, j]] for i, j in _pairs(corners)])
    edges, times = np.unique(np.sort(pairs, axis=1), axis=0, return_counts=True)
    tied = edges[~opened[edges].any(axis=1) & (times >= corners - 1)]
    return split_edges(points, cells, facets, tied, points[tied].mean(axis=1))


def _pairs(corners: int) -> list[tuple[int, int]]:
    return list(combinations(range(corners), 2))


def _keys_of(simplices: Cells, i: int, j: int, count: int) -> Cells:
    low = np.minimum(simplices[:, i], simplices[:, j])
    high = np.maximum(simplices[:, i], simplices[:, j])
    return low * count + high


def _first_edge(simplices: Cells, keys: Cells, count: int) -> Cells:
    """Find the first of `keys` (ascending where not negative) that a simplex has, or −1."""
    found = np.full(len(simplices), len(keys), dtype=np.int64)
    for at in _edge_numbers(simplices, keys, count):
        found = np.where(at >= 0, np.minimum(found, at), found)
    return np.where(found < len(keys), found, -1)


def _edge_numbers(simplices: Cells, keys: Cells, count: int) -> list[Cells]:
    """Find for each pair of corners the index into `keys` of each simplex' edge, or −1."""
    known = np.flatnonzero(keys >= 0)
    values = keys[known]
    numbers = []
    for i, j in _pairs(simplices.shape[1]):
        mine = _keys_of(simplices, i, j, count)
        at = np.minimum(np.searchsorted(values, mine), max(len(values) - 1, 0))
        hit = values[at] == mine if len(values) else np.zeros(len(mine), dtype=bool)
        numbers.append(np.where(hit, known[at] if len(values) else 0, -1))
    return numbers


def _first_everywhere(cells: Cells, first: Cells, keys: Cells, count: int) -> NDArray[np.bool_]:
    """Tell which of the edges come first in all cells that have them."""
    ready = np.ones(len(keys), dtype=bool)
    for at in _edge_numbers(cells, keys, count):
        ready[at[(at >= 0) & (at != first)]] = False
    return ready


def _halves(simplices: Cells, edge: Cells, keys: Cells, number: Cells, count: int) -> Cells:
    a, b = np.divmod(keys[edge], count)
    new = number[edge]
    one = np.where(simplices == a[:, None], new[:, None], simplices)
    two = np.where(simplices == b[:, None], new[:, None], simplices)
    return np.concatenate([one, two])


def shrink_to_points(
    points: Array, cells: Cells, facets: Cells, singular: Array, smallest: float
) -> tuple[Array, Cells, Cells]:
    """Split the cells at each singular point until the innermost have edges of `smallest`.

    The mesh generator cannot make cells that small.

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


def graded_to(
    points: Array, cells: Cells, facets: Cells, lines: Array, size: float
) -> tuple[Array, Cells, Cells]:
    """Bisect cells until h(r) = size · (r/R)^β around singular points or lines.

    R is an eighth of the body. Longest edges are halved, neighbours first where these have a
    longer one (Rivara, Int. J. Num. Meth. Eng. 20, 1984), so shapes stay bounded. β, as of
    `Grading`, is 0.8 in the plane and ⅔ in space.

    Parameters
    ----------
    points : (n, d) array
    cells : (m, d + 1) array
    facets : (f, d) array
        Marked facets, split with the cells.
    lines : (s, 2, d) array
        Segments at which a field is singular, m; in the plane without length.
    size : float
        Mean edge of the mesh, m.
    """
    if not len(lines):
        return points, cells, facets
    radius = _RADIUS * float(np.ptp(points, axis=0).max())
    exponent = _EXPONENT[points.shape[1]]
    smallest = radius * max(min(1.0, size / radius) ** (1 / (1 - exponent)), _SMALLEST)
    away = nearest_parts(points, lines)[0]
    while True:
        near = away[cells].mean(axis=1)
        wanted = np.maximum(size * (near / radius) ** exponent, smallest)
        corners = points[cells]
        longest = [
            np.linalg.norm(corners[:, i] - corners[:, j], axis=1) for i, j in _pairs(cells.shape[1])
        ]
        large = (np.max(longest, axis=0) > _LONGEST[points.shape[1]] * wanted) & (near < radius)
        if not large.any():
            return loosen_front(points, cells, facets)
        edges, around = _longest_to_split(points, cells, large, away)
        points, halved, facets = split_edges(
            points, cells[around], facets, edges, points[edges].mean(axis=1)
        )
        cells = np.concatenate([cells[~around], halved])
        away = np.append(away, nearest_parts(points[len(away) :], lines)[0])


def _longest_to_split(
    points: Array, cells: Cells, large: NDArray[np.bool_], away: Array
) -> tuple[Cells, NDArray[np.bool_]]:
    """Find edges (e, 2) that are the longest of all cells around them, on the way to large cells.

    And which cells (m,) were looked at: they hold all that have one of the edges. Nodes are `away`
    (n,) from the singularity, m: the large cells and all cells to be split are near it.
    """
    near, reach = away[cells].min(axis=1), float(away[cells[large]].max())
    while True:
        reach *= 3.0
        around = near <= reach
        edges, chosen = _on_the_way(points, cells[around], large[around])
        rim = np.zeros(len(points), dtype=bool)  # nodes of cells that are not looked at
        rim[cells[~around]] = True
        if not rim[edges[chosen[:, 0]]].all(axis=1).any():
            return edges[chosen.all(axis=1)], around


def _on_the_way(
    points: Array, cells: Cells, asked: NDArray[np.bool_]
) -> tuple[Cells, NDArray[np.bool_]]:
    """All edges (e, 2); whether a cell to be halved has it, and whether it is the longest of all.

    To halve a cell, one that has its longest edge but a longer one must be halved first.
    """
    edges, pairs, count = mesh_edges(cells), _pairs(cells.shape[1]), len(points)
    own = np.column_stack([_keys_of(cells, i, j, count) for i, j in pairs])
    number = np.searchsorted(edges[:, 0] * count + edges[:, 1], own)
    length = np.linalg.norm(points[edges[:, 1]] - points[edges[:, 0]], axis=1)
    rank = np.empty(len(edges), dtype=np.int64)  # edges as long as others differ by their number
    rank[np.argsort(length, kind="stable")] = np.arange(len(edges))
    longest = np.take_along_axis(number, rank[number].argmax(axis=1)[:, None], axis=1)[:, 0]
    while True:
        chosen = np.zeros(len(edges), dtype=bool)
        chosen[longest[asked]] = True
        reached = chosen[number].any(axis=1)
        if (reached == asked).all():
            break
        asked = reached
    ready = np.bincount(number.ravel(), minlength=len(edges)) == np.bincount(
        longest, minlength=len(edges)
    )
    return edges, np.column_stack([chosen, ready])


def flip_flat_cells(points: Array, cells: Cells, facets: Cells) -> Cells:
    """Flip the longest edge of each flat triangle into the other diagonal with its neighbour.

    Between nodes on a straight cut, gmsh may leave a triangle whose corners are three of them: the
    middle one lies on the longest edge. The neighbour across that edge is divided at this node.

    Parameters
    ----------
    points : (n, 2) array
    cells : (m, 3) array
        Positively oriented, but for the flat ones.
    facets : (f, 2) array
        Marked facets; they stay.

    Returns
    -------
    (m, 3) array
        A flat triangle whose longest edge is marked or on the boundary stays.
    """
    cells = cells.copy()
    marked = {frozenset(pair) for pair in facets.tolist()}
    for _ in range(_ROUNDS):
        shape = _shape(points[cells])
        flat = np.flatnonzero(shape <= _FLAT)
        before = cells.copy()
        for cell in flat:
            edges = points[np.roll(cells[cell], -1)] - points[np.roll(cells[cell], 1)]
            middle, a, c = np.roll(cells[cell], -int(np.argmax(np.square(edges).sum(axis=1))))
            around = np.flatnonzero((cells == a).any(axis=1) & (cells == c).any(axis=1))
            around = around[around != cell]
            if len(around) != 1 or frozenset((int(a), int(c))) in marked:
                continue
            other = int(around[0])
            both = np.array([cell, other])
            far = cells[other].sum() - a - c
            x, y, _ = np.roll(cells[other], -1 - int(np.argmax(cells[other] == far)))
            flipped = np.array([[x, middle, far], [middle, y, far]])
            if _shape(points[flipped]).min() > _shape(points[cells[both]]).min():
                cells[both] = flipped
        if np.array_equal(cells, before):
            break
    return cells


def _shape(corners: Array) -> Array:
    """Compute the signed area (m,) of triangles (m, 3, 2) over the square of their longest edge."""
    edges = np.roll(corners, -1, axis=1) - corners
    double = edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0]
    return 0.5 * double / np.square(edges).sum(axis=2).max(axis=1)
