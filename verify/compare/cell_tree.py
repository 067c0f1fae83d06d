"""A tree of bounding boxes over the cells of a mesh, and the search for cells in it.

A uniform grid of bins fails on meshes that are graded to a crack tip: an eighth of all cells
can fall into one bin. Boxes over runs of cells in Morton order adapt to the grading and are
built without recursion. Kernels find in it the cell that holds a point or is nearest to it.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from verify.compare.cell_walk import Walk
from verify.compiled import COMPILED, njit
from verify.geometry.simplices import bounds_of

LEAF = 4  # cells per leaf
_UP = 3  # levels of the tree: so far above the last leaf a search begins
_AT_ONCE, _WORTH = 1 << 15, 0.125  # in numpy: points at once; points per cell that are worth a walk
# Shifts and masks that put one or two zeros between the bits of a number (2D: 31, 3D: 20 bits)
_SPREAD = {
    2: (
        (16, 0x0000FFFF0000FFFF), (8, 0x00FF00FF00FF00FF), (4, 0x0F0F0F0F0F0F0F0F),
        (2, 0x3333333333333333), (1, 0x5555555555555555),
    ),
    3: (
        (32, 0x1F00000000FFFF), (16, 0x1F0000FF0000FF), (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3), (2, 0x1249249249249249),
    ),
}  # fmt: skip


class SearchedCells(NamedTuple):
    """A tree over cells, and the cells, as kernels take them.

    Attributes
    ----------
    lower, upper, cells
        See `CellTree`.
    corners, normals : (m, k, d) float array
        Of each cell; normals of its facets point inwards and have length one.
    centres : (m, d) float array
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    cells: NDArray[np.int64]
    corners: NDArray[np.float64]
    normals: NDArray[np.float64]
    centres: NDArray[np.float64]


@dataclass(frozen=True)
class CellTree:
    """A complete binary tree in heap order: node i has children 2i and 2i + 1, the root is 1.

    Parameters
    ----------
    lower, upper : (2p, d) float array
        Bounding boxes; an empty node has lower = +inf, upper = -inf.
    cells : (4p,) int array
        Cells in Morton order; leaf j is node p + j and holds cells[4j:4j + 4]; -1 fills up.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    cells: NDArray[np.int64]

    def over(self, corners: NDArray[np.float64], normals: NDArray[np.float64]) -> SearchedCells:
        """Return the tree with corners and normals (m, k, d) of the cells that it is over."""
        centres = corners.mean(axis=1)
        return SearchedCells(self.lower, self.upper, self.cells, corners, normals, centres)


def build_cell_tree(
    lower: NDArray[np.float64], upper: NDArray[np.float64], surface: bool = False
) -> CellTree:
    """Build the tree from the bounding boxes (m, d) of the cells; NaN marks cells to leave out.

    Cells on a `surface` are ordered in cubes. In flat boxes the height of a shallow surface would
    count as much as its length, and the search would take half as long again.
    """
    kept = np.flatnonzero(np.isfinite(lower).all(axis=1))
    centres = 0.5 * (lower[kept] + upper[kept])
    order = kept[np.argsort(_morton(centres, surface), kind="stable")]
    leaves = 1
    while leaves * LEAF < len(order):
        leaves *= 2
    cells = np.full(leaves * LEAF, -1, dtype=np.int64)
    cells[: len(order)] = order
    d = lower.shape[1]
    lo, up = np.full((2 * leaves, d), np.inf), np.full((2 * leaves, d), -np.inf)
    held = cells.reshape(leaves, LEAF)
    full = held >= 0
    lo[leaves:], _ = bounds_of(np.where(full[..., None], lower[held], np.inf))
    _, up[leaves:] = bounds_of(np.where(full[..., None], upper[held], -np.inf))
    first = leaves // 2
    while first >= 1:
        children = slice(2 * first, 4 * first)
        lo[first : 2 * first], _ = bounds_of(lo[children].reshape(first, 2, d))
        _, up[first : 2 * first] = bounds_of(up[children].reshape(first, 2, d))
        first //= 2
    return CellTree(lo, up, cells)


def morton_order(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order (n,) of points (n, d) in which near ones follow each other.

    Points in this order find their cells three times as fast: the cells are in the cache.
    """
    return np.argsort(_morton(points), kind="stable")


def _morton(centres: NDArray[np.float64], in_cubes: bool = False) -> NDArray[np.int64]:
    """Interleave the bits of the coordinates, so that near cells get near numbers."""
    d = centres.shape[1]
    bits = 31 if d == 2 else 20
    if not len(centres):
        return np.zeros(0, dtype=np.int64)
    columns = np.ascontiguousarray(centres.T)
    low = columns.min(axis=1)
    extent = np.maximum(columns.max(axis=1) - low, 1e-300)
    if in_cubes:
        extent[:] = extent.max()
    code = np.zeros(len(centres), dtype=np.int64)
    for axis, column in enumerate(columns):
        spread = ((column - low[axis]) / extent[axis] * (2**bits - 1)).astype(np.int64)
        for shift, mask in _SPREAD[d]:
            spread = (spread | (spread << shift)) & mask
        code |= spread << axis
    return code


Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def axes_of(dimension: int) -> tuple[int, ...]:
    """Return the axes of space as kernels take them: loops over a tuple are unrolled."""
    return tuple(range(dimension))


@njit(inline="always")
def _depth(x, normals, corners, axes, least):
    """Compute the distance of `x` to the nearest facet plane of a simplex, positive inside.

    Below `least` it may be the distance to any plane: most points are outside of most cells.
    """
    d = len(axes)
    depth = np.inf
    for facet in range(d + 1):
        on_it = (facet + 1) % (d + 1)
        distance = 0.0
        for a in range(d):
            distance += normals[facet, a] * (x[a] - corners[on_it, a])
        depth = min(depth, distance)
        if depth < least:
            break
    return depth


@njit(cache=True)
def segment_distance2(x, a, b):
    """Compute the squared distance of `x` to the segment ab, in any dimension."""
    along, length2 = 0.0, 0.0
    for c in range(x.shape[0]):
        along += (x[c] - a[c]) * (b[c] - a[c])
        length2 += (b[c] - a[c]) ** 2
    t = min(1.0, max(0.0, along / length2)) if length2 > 0.0 else 0.0
    distance2 = 0.0
    for c in range(x.shape[0]):
        distance2 += (x[c] - a[c] - t * (b[c] - a[c])) ** 2
    return distance2


@njit(inline="always")
def _outside_distance2(x, normals, corners, axes):
    """Compute the squared distance to a simplex of a point outside of it."""
    d = len(axes)
    best = np.inf
    for i in range(d + 1):
        for j in range(i):
            best = min(best, segment_distance2(x, corners[i], corners[j]))
    if d == 2:
        return best
    for facet in range(4):  # the foot inside a face beats its edges
        on_it = (facet + 1) % 4
        height = 0.0
        for a in range(3):
            height += normals[facet, a] * (x[a] - corners[on_it, a])
        if height < 0.0 and _is_over(x, height, facet, normals, corners):
            best = min(best, height * height)
    return best


@njit(inline="always")
def _is_over(x, height, facet, normals, corners):
    """Tell whether the foot of `x` on the plane of a facet of a tetrahedron is in the facet."""
    for other in range(4):
        if other == facet:
            continue
        p, q = (facet + 1) % 4, (facet + 1) % 4
        for k in range(4):
            if k != facet and k != other:  # `in` takes longer to compile
                p, q = q, k
        side = opposite = 0.0
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            # across the edge pq, in the facet
            across = (corners[q, b] - corners[p, b]) * normals[facet, c]
            across -= (corners[q, c] - corners[p, c]) * normals[facet, b]
            side += across * (x[a] - height * normals[facet, a] - corners[p, a])
            opposite += across * (corners[other, a] - corners[p, a])
        if side * opposite < 0.0:
            return False
    return True


@njit(inline="always")
def allowed(wish, side):
    """Tell whether sides of cuts do not contradict those that are wished for; 0 is either side."""
    agreed = True
    for p in range(wish.shape[0]):
        if wish[p] * side[p] < 0:
            agreed = False
    return agreed


@njit(inline="always")
def _is_beside(x, corners, axes, tolerance):
    """Tell whether `x` is out of the box of a simplex: planes of a thin one are near far points."""
    for a in axes:
        low = up = corners[0, a]
        for corner in range(1, corners.shape[0]):
            low, up = min(low, corners[corner, a]), max(up, corners[corner, a])
        if x[a] < low - tolerance or x[a] > up + tolerance:
            return True
    return False


@njit(inline="always")
def _containing(x, direction, sided, wish, searched, sides, tolerance, axes, stack, root):
    """Find the cell below a node that holds `x`, on the side of `direction` if several do, or -1.

    Also returned are its depth and the node where the search ended.
    """
    lower, upper, cells, corners, normals, centres = searched
    d = len(axes)
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    stack[0], top, node = root, 1, root
    best, best_depth, best_side = -1, -np.inf, False
    while top > 0:
        top -= 1
        node = stack[top]
        inside = True
        for a in range(d):
            if x[a] < lower[node, a] - tolerance or x[a] > upper[node, a] + tolerance:
                inside = False
        if not inside:
            continue
        if node < leaves:
            stack[top], stack[top + 1] = 2 * node, 2 * node + 1
            top += 2
            continue
        first = (node - leaves) * leaf_size
        for k in range(first, first + leaf_size):
            cell = cells[k]
            if cell < 0:
                break
            depth = _depth(x, normals[cell], corners[cell], axes, -tolerance)
            if depth < -tolerance or not allowed(wish, sides[cell]):
                continue
            if depth > tolerance:
                return cell, depth, node
            if _is_beside(x, corners[cell], axes, tolerance):
                continue
            on_side = not sided
            if sided:
                towards = 0.0
                for a in range(d):
                    towards += direction[a] * (centres[cell, a] - x[a])
                on_side = towards > 0.0
            if (on_side and not best_side) or (on_side == best_side and depth > best_depth):
                best, best_depth, best_side = cell, depth, on_side
    return best, best_depth, node


@njit(cache=True)
def _nearest(x, wish, searched, sides, axes, stack):
    """Find the cell nearest to `x`, by branch and bound; -1 if none is allowed."""
    lower, upper, cells, corners, normals, _ = searched
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    stack[0], top = 1, 1
    best, best2 = -1, np.inf
    while top > 0:
        top -= 1
        node = stack[top]
        if box_distance2(x, lower[node], upper[node]) >= best2:
            continue
        if node < leaves:
            left, right = 2 * node, 2 * node + 1
            left2 = box_distance2(x, lower[left], upper[left])
            if left2 < box_distance2(x, lower[right], upper[right]):
                left, right = right, left
            stack[top], stack[top + 1] = left, right  # the nearer child is taken first
            top += 2
            continue
        first = (node - leaves) * leaf_size
        for k in range(first, first + leaf_size):
            cell = cells[k]
            if cell < 0:
                break
            if not allowed(wish, sides[cell]):
                continue
            if _depth(x, normals[cell], corners[cell], axes, 0.0) >= 0.0:
                return cell
            distance2 = _outside_distance2(x, normals[cell], corners[cell], axes)
            if distance2 < best2:
                best, best2 = cell, distance2
    return best


@njit(cache=True)
def box_distance2(x, lower, upper):
    """Compute the squared distance of `x` to a box, 0 inside."""
    distance2 = 0.0
    for a in range(x.shape[0]):
        gap = max(lower[a] - x[a], x[a] - upper[a])
        if gap > 0.0:
            distance2 += gap * gap
    return distance2


def no_sides(places: NDArray[Any]) -> NDArray[np.int8]:
    """Return sides (n, 0) of n points or cells, where no cut is known."""
    return np.zeros((len(places), 0), dtype=np.int8)


def holding_cells(points: Floats, searched: SearchedCells, tolerance: float, **how: bool) -> Ints:
    """Find the cell (n,) that each point (n, d) lies deepest in; see `find_cells`."""
    points = np.ascontiguousarray(points, dtype=float)
    sides = no_sides(searched.corners)
    return find_cells(points, points[:0], no_sides(points), searched, sides, tolerance, **how)


def find_cells(
    points: Floats,
    directions: Floats,
    wanted: NDArray[np.int8],
    searched: SearchedCells,
    sides: NDArray[np.int8],
    tolerance: float,
    nearest: bool = True,
) -> Ints:
    """Find the cell (n,) of each point (n, d); see `verify.compare.locate.SolutionField`.

    `directions` is (n, d), or (0, d) where no side is wanted. `wanted` (n, c) is the side of c
    cuts, −1, 1 or 0 (either), on which the cell must lie. `sides` (m, c) are the sides of the
    cells, 0 if unknown; `searched` is as `SearchedCells`. A point whose wish no cell fulfils gets a
    cell as if without one. A point that no cell holds within `tolerance` gets the `nearest` one, or
    −1.
    """
    found = np.full(len(points), -1)
    some = directions if len(directions) == len(points) else points
    sided, axes = some is directions, axes_of(points.shape[1])
    left: Any = slice(None)
    if not COMPILED:
        _holding_in_numpy(points, some, sided, wanted, searched, sides, tolerance, found)
        left = np.flatnonzero(found < 0) if nearest else []
    rest = found[left]  # all of `found` itself, or a copy of what numpy has left
    _find_cells(
        points[left], some[left], sided, wanted[left], searched, sides, tolerance, nearest, axes,
        rest,
    )  # fmt: skip
    found[left] = rest
    return found


def _holding_in_numpy(
    points: Floats, directions: Floats, sided: bool, wanted: NDArray[np.int8],
    searched: SearchedCells, sides: NDArray[np.int8], tolerance: float, found: Ints,
) -> None:  # fmt: skip
    """Do as `_containing` for all points at once: by a walk first, where it is worth its start."""
    _, _, cells, corners, normals, centres = searched
    walk, kept = Walk(corners, normals), cells[cells >= 0]

    def agreed(row: Ints, cell: Ints) -> NDArray[np.bool_]:
        """Tell whether cells are on the sides that points wish for."""
        good = np.ones(len(row), dtype=bool)
        for c in range(wanted.shape[1]):
            good &= wanted[row, c] * sides[cell, c] >= 0
        return good

    def take(row: Ints, cell: Ints, depth: Floats) -> None:
        """Take the best of pairs of points and cells that hold them."""
        there = agreed(row, cell)
        row, cell, depth = row[there], cell[there], depth[there]
        inside = depth > tolerance
        on_side = inside
        if sided:
            towards = ((centres[cell] - points[row]) * directions[row]).sum(axis=1)
            on_side = inside | (towards > 0.0)
        order = np.lexsort((depth, on_side, inside))
        found[row[order]] = cell[order]  # the last of each point stays

    if len(points) > _WORTH * len(kept) > 0:
        found[:], on_facet = walk.to(points, kept, agreed, tolerance)
        row = np.flatnonzero((found < 0) & (on_facet >= 0))
        other = walk.across(points[row], on_facet[row], tolerance)
        row, other = row[other >= 0], other[other >= 0]
        two = np.concatenate([row, row]), np.concatenate([on_facet[row], other])
        take(*two, walk.depth(points[two[0]].T, two[1])[0])
    near = near_points(points, tolerance)
    for row, cell in pairs_met(searched, corners, np.flatnonzero(found < 0), near):
        depth = walk.depth(points[row].T, cell)[0]
        there = depth >= -tolerance
        take(row[there], cell[there], depth[there])


Meets = Callable[[Ints, Floats, Floats, Ints], NDArray[np.bool_]]


def pairs_met(
    tree: CellTree | SearchedCells, corners: Floats, rows: Ints, meets: Meets
) -> Iterator[tuple[Ints, Ints]]:
    """Yield all pairs (n,) of one of `rows` and a cell whose box it meets, some rows at a time.

    `corners` (m, k, d) belong to the cells. ``meets(row, low, high, box)`` tells of n rows
    whether they meet the boxes of these numbers (n,), from ``low[box]`` to ``high[box]``.
    """
    leaves = len(tree.lower) // 2
    low, high = bounds_of(corners)
    for begin in range(0, len(rows), _AT_ONCE):
        row = rows[begin : begin + _AT_ONCE]
        node = np.ones(len(row), dtype=np.int64)
        while True:
            met = meets(row, tree.lower, tree.upper, node)
            row, node = row[met], node[met]
            if not len(node) or node[0] >= leaves:
                break
            row, node = row.repeat(2), (2 * node[:, None] + (0, 1)).ravel()
        cell = tree.cells.reshape(leaves, -1)[node - leaves]
        row, cell = row.repeat(cell.shape[1]), cell.ravel()
        row, cell = row[cell >= 0], cell[cell >= 0]
        met = meets(row, low, high, cell)
        yield row[met], cell[met]


def near_points(points: Floats, within: float | Floats) -> Meets:
    """Tell of points whether boxes are `within` a distance, one or (n,), of them by axis."""
    within = np.broadcast_to(within, len(points))

    def meets(row: Ints, low: Floats, high: Floats, box: Ints) -> NDArray[np.bool_]:
        near, reach = np.ones(len(row), dtype=bool), within[row]
        for a in range(points.shape[1]):  # column by column: five times as fast
            x = points[row, a]
            near &= (x >= low[box, a] - reach) & (x <= high[box, a] + reach)
        return near

    return meets


@njit(cache=True)
def _find_cells(
    points, directions, sided, wanted, searched, sides, tolerance, nearest, axes, found
):
    _, _, _, corners, normals, _ = searched
    stack, either = np.empty(64, dtype=np.int64), np.zeros(wanted.shape[1], dtype=wanted.dtype)
    cell, leaf = -1, 1
    for i in range(len(points)):
        wish = wanted[i]
        # points follow each other closely: one well inside the cell of the last belongs to it
        held = cell >= 0 and allowed(wish, sides[cell])
        if held:
            depth = _depth(points[i], normals[cell], corners[cell], axes, tolerance)
            if depth > tolerance:
                found[i] = cell
                continue
        for _ in range(2):
            for root in (max(leaf >> _UP, 1), 1):  # first near the cell of the last point
                cell, depth, node = _containing(
                    points[i], directions[i], sided, wish, searched, sides, tolerance, axes, stack,
                    root,
                )  # fmt: skip
                if depth > tolerance:
                    leaf = node
                if depth > tolerance or root == 1:
                    break
            if cell < 0 and nearest:
                cell = _nearest(points[i], wish, searched, sides, axes, stack)
            if cell >= 0 or not nearest:
                break
            wish = either
        found[i] = cell


def nearest_triangles(
    points: Floats, directions: Floats, wanted: NDArray[np.int8], searched: SearchedCells,
    across: Floats, sides: NDArray[np.int8], tolerance: float,
) -> tuple[Ints, Floats]:  # fmt: skip
    """Find the triangle (n,) nearest to each of `points` (n, 3), and its distance (n,).

    Several may be equally near within `tolerance`. Then the one whose centre lies in the given
    direction (n, 3) counts, else the one whose edges are farthest. `wanted` (n, p) is the side of p
    planes, −1, 1 or 0 (either), on which the triangle must lie. `sides` (m, p) are the sides of the
    triangles, 0 if on both. A point whose wish no triangle fulfils gets the nearest of all.
    `searched` is as `SearchedCells`, with normals of the edges; `across` (m, 3) are the normals of
    the triangles. `directions` has no rows if none is wanted.
    """
    given = points, directions, wanted, searched, across, sides, tolerance
    found: tuple[Ints, Floats] = (_nearest_triangles if COMPILED else _triangles_in_numpy)(*given)
    return found


def _triangles_in_numpy(
    points: Floats, directions: Floats, wanted: NDArray[np.int8], searched: SearchedCells,
    across: Floats, sides: NDArray[np.int8], tolerance: float,
) -> tuple[Ints, Floats]:  # fmt: skip
    """Do as `_nearest_triangles`, for all points with the same wish at once."""
    found, distance = np.full(len(points), -1), np.full(len(points), np.inf)
    kept = searched.cells[searched.cells >= 0]
    wishes = sorted(set(map(tuple, wanted.tolist()))) if len(kept) else []
    for wish in wishes:
        rows = np.flatnonzero((wanted == wish).all(axis=1))
        agreed = kept[(np.array(wish) * sides[kept] >= 0).all(axis=1)]
        fit = np.isin(np.arange(len(sides)), agreed if len(agreed) else kept)
        # the nearest corner bounds the distance
        reach = np.full(len(points), tolerance)
        reach[rows] += cKDTree(searched.corners[fit].reshape(-1, 3)).query(points[rows])[0]
        near_enough = near_points(points, reach)
        for row, cell in pairs_met(searched, searched.corners, rows, near_enough):
            row, cell = row[fit[cell]], cell[fit[cell]]
            away, depth = _triangle_distances(points[row], searched, across, cell)
            np.minimum.at(distance, row, away)
            near = away <= distance[row] + tolerance
            row, cell, away, depth = row[near], cell[near], away[near], depth[near]
            inside, on_side = (away <= tolerance) & (depth > tolerance), np.ones(len(row), bool)
            if len(directions) == len(points):
                towards = searched.centres[cell] - points[row]
                on_side = (directions[row] * towards).sum(axis=1) > 0.0
            order = np.lexsort((depth, on_side, inside))
            found[row[order]] = cell[order]  # the last of each point stays
    return found, distance


def _triangle_distances(
    x: Floats, searched: SearchedCells, across: Floats, cell: Ints
) -> tuple[Floats, Floats]:
    """Do as `_distance_and_depth` for each of `x` (n, 3) and `cell` (n,)."""
    corners, ends = searched.corners[cell], np.roll(searched.corners, -1, axis=1)[cell]
    depth = np.einsum("nka,nka->nk", searched.normals[cell], x[:, None] - ends).min(axis=1)
    away = np.abs(np.einsum("na,na->n", across[cell], x - corners[:, 0]))
    out = np.flatnonzero(depth < 0.0)
    start, edge = corners[out], ends[out] - corners[out]
    length2 = np.einsum("nka,nka->nk", edge, edge)
    along = np.einsum("nka,nka->nk", x[out, None] - start, edge)
    t = (along / np.where(length2 > 0.0, length2, 1.0)).clip(0.0, 1.0)
    away[out] = np.linalg.norm(x[out, None] - start - t[..., None] * edge, axis=2).min(axis=1)
    return away, depth


@njit(cache=True)
def _nearest_triangles(points, directions, wanted, searched, across, sides, tolerance):
    n = points.shape[0]
    found = np.empty(n, dtype=np.int64)
    distance = np.empty(n)
    sided = directions.shape[0] == n
    nowhere, either = np.zeros(3), np.zeros(wanted.shape[1], dtype=wanted.dtype)
    for i in range(n):
        direction = directions[i] if sided else nowhere
        wish = wanted[i]
        for _ in range(2):
            found[i], distance[i] = _nearest_triangle(
                points[i], direction, sided, wish, searched, across, sides, tolerance
            )
            if found[i] >= 0:
                break
            wish = either
    return found, distance


@njit(cache=True)
def _nearest_triangle(x, direction, sided, wish, searched, across, sides, tolerance):
    lower, upper, cells, corners, normals, centres = searched
    leaves = lower.shape[0] // 2
    leaf_size = cells.shape[0] // leaves
    stack, gaps = np.empty(64, dtype=np.int64), np.empty(64)  # nodes and their distances
    stack[0], gaps[0], top = 1, 0.0, 1
    best, nearest, best_depth, best_side = -1, np.inf, -np.inf, False
    while top > 0:
        top -= 1
        node = stack[top]
        if gaps[top] > nearest + tolerance:
            continue
        if node < leaves:
            left, right = 2 * node, 2 * node + 1
            left_gap = np.sqrt(box_distance2(x, lower[left], upper[left]))
            right_gap = np.sqrt(box_distance2(x, lower[right], upper[right]))
            if left_gap < right_gap:  # the nearer child is taken first
                left, right, left_gap, right_gap = right, left, right_gap, left_gap
            for child, gap in ((left, left_gap), (right, right_gap)):
                if gap <= nearest + tolerance:
                    stack[top], gaps[top] = child, gap
                    top += 1
            continue
        for k in range((node - leaves) * leaf_size, (node - leaves + 1) * leaf_size):
            cell = cells[k]
            if cell < 0:
                break
            if not allowed(wish, sides[cell]):
                continue
            away, depth = _distance_and_depth(x, normals[cell], across[cell], corners[cell])
            if away > nearest + tolerance:
                continue
            if away <= tolerance < depth:  # inside: there is no other
                return cell, away
            towards = 0.0
            if sided:
                for a in range(3):
                    towards += direction[a] * (centres[cell, a] - x[a])
            on_side = not sided or towards > 0.0
            if (
                away < nearest - tolerance
                or (on_side and not best_side)
                or (on_side == best_side and depth > best_depth)
            ):
                best, best_depth, best_side = cell, depth, on_side
            nearest = min(nearest, away)
    return best, nearest


@njit(cache=True)
def _distance_and_depth(x, normals, across, corners):
    """Return distances of `x` to a triangle, and of its foot to the nearest edge, inwards."""
    depth, height = np.inf, 0.0
    for k in range(3):
        inwards = 0.0
        for a in range(3):
            inwards += normals[k, a] * (x[a] - corners[(k + 1) % 3, a])
        depth = min(depth, inwards)
        height += across[k] * (x[k] - corners[0, k])
    if depth >= 0.0:
        return abs(height), depth
    away2 = np.inf
    for k in range(3):
        away2 = min(away2, segment_distance2(x, corners[k], corners[(k + 1) % 3]))
    return np.sqrt(away2), depth
