"""Linear simplices: gradients, normals, volumes; Gauss rules on them; their division.

Of triangles in space all geometry is tangential: gradients have no part across them. The rules have
positive weights and all points inside. A quadrature needs no conforming mesh, so that every simplex
may be divided for itself: an edge is split, and each half of the simplex keeps one of its ends.
Volumes add up to round-off.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, reduce, wraps
from itertools import combinations, pairwise, permutations
from math import factorial
from weakref import finalize

import numpy as np
from numpy.typing import NDArray
from scipy.special import roots_jacobi

from verify.compiled import COMPILED, njit
from verify.errors import InputError
from verify.geometry.simplices import bounds_of, determinants, halves, measures, split_at_zeros
from verify.solution import Solution

Array = NDArray[np.float64]


_ROUND_OFF = 4 * float(np.finfo(float).eps)
_CORNERS = {3: 3, 6: 3, 4: 4, 10: 4}  # by the nodes of a cell
# corners at the ends of each mid-edge node, in VTK's order; by the dimension of the cells
EDGES = {
    1: ((0, 1),),
    2: ((0, 1), (1, 2), (2, 0)),
    3: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
}


@dataclass(frozen=True)
class Simplices:
    """Simplices of k dimensions with what evaluation needs.

    Parameters
    ----------
    corners : (m, k+1, d) float array
    volume : (m,) float array
        Areas of triangles; never negative.
    gradients : (m, k+1, d) float array
        Gradients of the barycentric coordinates; zero in degenerate cells.
    normals : (m, k+1, d) float array
        Unit inward normals of the facets opposite to each corner.
    degenerate : (m,) bool array
        Cells whose height is not resolved by double precision; they hold no material.
    """

    corners: Array
    volume: Array
    gradients: Array
    normals: Array
    degenerate: NDArray[np.bool_]

    def heights(self, points: Array, cells: NDArray[np.int64]) -> Array:
        """Compute heights (n, k+1) of points (n, d) over the facets of given cells (n,), m."""
        off = points[:, None] - np.roll(self.corners[cells], -1, axis=1)
        return np.asarray(np.sum(self.normals[cells] * off, axis=2))


def simplices(points: Array, cells: NDArray[np.int64]) -> Simplices:
    """Compute the geometry of the simplices with corners ``points[cells[:, :k + 1]]``."""
    count = _CORNERS[cells.shape[1]]
    corners = points[cells[:, :count]]
    if COMPILED and count > points.shape[1]:
        empty = np.empty(len(corners)), np.empty(corners.shape), np.empty(corners.shape)
        geometry = *empty, np.empty(len(corners), dtype=bool)
        _simplices(corners, tuple(range(count - 1)), _ROUND_OFF, *geometry)
        return Simplices(corners, *geometry)
    across = triangle_frames(corners)[:, 2] if count == points.shape[1] == 3 else None
    areas = np.empty_like(corners)  # facet normals times k! volume, all over one determinant
    for i in range(count):
        others = [k for k in range(count) if k != i]
        edges = [corners[:, b] - corners[:, a] for a, b in pairwise(others)]
        areas[:, i] = _perpendicular(edges if across is None else [across, *edges])
        inward = np.einsum("ma,ma->m", areas[:, i], corners[:, i] - corners[:, others[0]])
        areas[:, i] *= np.where(inward < 0, -1.0, 1.0)[:, None]
    # the determinant from the largest facet: the smallest height, hence the least cancellation
    sizes = np.sqrt(np.einsum("mka,mka->mk", areas, areas))
    largest = np.argmax(sizes, axis=1)
    rows = np.arange(len(corners))
    apex, foot = corners[rows, largest], corners[rows, (largest + 1) % count]
    determinant = np.sum(areas[rows, largest] * (apex - foot), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = determinant / sizes[rows, largest]
        low, high = bounds_of(corners)
        resolved = _ROUND_OFF * reduce(np.maximum, np.maximum(-low, high).T)
        degenerate = ~(height > resolved)
        gradients = areas / determinant[:, None, None]
        normals = areas / sizes[..., None]
    gradients[degenerate], normals[degenerate] = 0.0, 0.0
    volume = np.maximum(determinant, 0.0) / factorial(count - 1)
    return Simplices(corners, volume, gradients, normals, degenerate)


@njit(cache=True, error_model="numpy")
def _simplices(corners, axes, round_off, volume, gradients, normals, degenerate):
    d, parts = len(axes), 2.0 if len(axes) == 2 else 6.0
    areas, sizes = np.empty((d + 1, d)), np.empty(d + 1)
    for m in range(len(corners)):
        x, largest, reach = corners[m], 0, 0.0
        for i in range(d + 1):
            p, q, r = 1 if i == 0 else 0, 2 if i < 2 else 1, 3 if i < 3 else 2
            inward = size = 0.0
            for a in axes:
                b, c = (a + 1) % d, (a + 2) % d
                if d == 2:
                    areas[i, a] = (x[q, b] - x[p, b]) * (2.0 * a - 1.0)
                else:
                    areas[i, a] = (x[q, b] - x[p, b]) * (x[r, c] - x[q, c])
                    areas[i, a] -= (x[q, c] - x[p, c]) * (x[r, b] - x[q, b])
                inward += areas[i, a] * (x[i, a] - x[p, a])
                size += areas[i, a] ** 2
                reach = max(reach, abs(x[i, a]))
            sizes[i] = np.sqrt(size)
            if inward < 0.0:
                areas[i] *= -1.0
            if sizes[i] > sizes[largest]:
                largest = i
        determinant = 0.0
        for a in axes:
            height = x[largest, a] - x[(largest + 1) % (d + 1), a]
            determinant += areas[largest, a] * height
        degenerate[m] = not determinant / sizes[largest] > round_off * reach
        volume[m] = max(determinant, 0.0) / parts
        for i in range(d + 1):
            for a in axes:
                gradients[m, i, a] = 0.0 if degenerate[m] else areas[i, a] / determinant
                normals[m, i, a] = 0.0 if degenerate[m] else areas[i, a] / sizes[i]


def kept_with[Given, T](make: Callable[[Given], T]) -> Callable[[Given], T]:
    """Let a function remember what it made of a solution, scene or body as long as that lives."""
    made: dict[int, T] = {}

    @wraps(make)
    def remembered(given: Given) -> T:
        key = id(given)
        if key not in made:
            made[key] = make(given)
            finalize(given, made.pop, key)
        return made[key]

    return remembered


@kept_with
def cells_of(solution: Solution) -> Simplices:
    """Compute the geometry of the cells of a solution."""
    return simplices(solution.points, solution.cells)


_NONE = 1e-12  # of the volume: less than that is inside out by round-off, if at all


def share_inside_out(solution: Solution) -> float:
    """Compute the largest share of the volume, at any time, of cells that are inside out.

    These are the cells with det F < 0. Of quadratic ones their corners count. A membrane has none.
    """
    shape, d = cells_of(solution), solution.dimension
    if shape.corners.shape[1] == d:
        return 0.0
    corners = solution.cells[:, : d + 1]
    found = [np.einsum("mka,mkb->mab", u[corners], shape.gradients) for u in solution.displacement]
    turned = np.array([determinants(np.eye(d) + slope) < 0.0 for slope in found])
    share = float((turned @ shape.volume).max() / shape.volume.sum())
    return share if share > _NONE else 0.0


def triangle_frames(corners: Array) -> Array:
    """Make orthonormal frames (m, 3, 3) of triangles in space, as rows: two along, one across.

    The first is along the longest edge and the others are normal to it to the last digit. So of a
    sliver only the turn about its length is not resolved. Of a triangle without area the frame is
    arbitrary.
    """
    edges = np.roll(corners, -1, axis=1) - corners
    longest = np.argmax(np.linalg.norm(edges, axis=2), axis=1)
    rows = np.arange(len(corners))
    first, second = edges[rows, longest], edges[rows, (longest + 1) % 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        first = first / np.linalg.norm(first, axis=1)[:, None]
        for _ in range(2):
            second = second - np.sum(second * first, axis=1)[:, None] * first
            second = second / np.linalg.norm(second, axis=1)[:, None]
    flat = ~np.isfinite(first + second).all(axis=1)
    first[flat], second[flat] = np.eye(3)[0], np.eye(3)[1]
    return np.stack([first, second, np.cross(first, second)], axis=1)


def in_frames(gradient: Array, frames: Array) -> Array:
    """Take derivatives (m, 3, 2) along the tangents of `frames` (m, 3, 3), components along rows.

    `gradient` (m, 3, 3) may be tangential to another triangulation of the surface: then the field
    is carried over by nearest points.
    """
    return np.asarray(frames @ gradient @ np.swapaxes(frames[:, :2], 1, 2))


def nodes_of_facets(cells: NDArray[np.int64], opposite: NDArray[np.int64]) -> NDArray[np.int64]:
    """Take the nodes (f, j), corners first, of facets of cells (f, n) opposite to corners (f,)."""
    count = _CORNERS[cells.shape[1]]
    edges = {frozenset(edge): count + k for k, edge in enumerate(EDGES[count - 1])}
    columns = [[k for k in range(count) if k != corner] for corner in range(count)]
    if cells.shape[1] > count:
        for own in columns:
            own += [edges[frozenset((own[a], own[b]))] for a, b in EDGES[count - 2]]
    return np.take_along_axis(cells, np.array(columns)[opposite], axis=1)


def straight_or_raise(points: Array, cells: NDArray[np.int64]) -> None:
    """Check that quadratic cells have straight edges with their nodes at the middle.

    Raises
    ------
    InputError
        With the worst cell, if a mid-edge node is off by more than 1e-8 of its edge.
    """
    count = _CORNERS[cells.shape[1]]
    for k, (a, b) in enumerate(EDGES[count - 1]):
        ends = points[cells[:, a]], points[cells[:, b]]
        off = np.linalg.norm(points[cells[:, count + k]] - 0.5 * (ends[0] + ends[1]), axis=1)
        length = np.linalg.norm(ends[1] - ends[0], axis=1)
        round_off = 16 * np.finfo(float).eps * np.abs(points).max()
        worst = int(np.argmax(off - 1e-8 * length))
        if off[worst] > 1e-8 * length[worst] + round_off:
            raise InputError(
                f"cell {worst} of a quadratic solution has a curved edge (mid-edge node off by "
                f"{off[worst]:.3g} m); only straight edges can be compared"
            )


def _perpendicular(edges: list[Array]) -> Array:
    if len(edges) == 1:
        return np.column_stack([-edges[0][:, 1], edges[0][:, 0]])
    return np.cross(edges[0], edges[1])


@cache
def simplex_rule(k: int, order: int) -> tuple[Array, Array]:
    """Make barycentric points (n, k + 1) and weights (n,) that sum to 1.

    Order 2 is the symmetric rule of k + 1 points, exact for quadratic polynomials; any other
    is Stroud's conical product of order^k points, exact to degree 2 · order − 1.
    """
    if order == 2:
        near = {1: 0.5 - 0.5 / 3**0.5, 2: 1 / 6, 3: (5 - 5**0.5) / 20}[k]
        points = np.full((k + 1, k + 1), near)
        np.fill_diagonal(points, 1 - k * near)
        return points, np.full(k + 1, 1 / (k + 1))
    points, weights = np.zeros((1, 0)), np.ones(1)
    left = np.ones(1)  # 1 − the coordinates taken so far
    for axis in range(k):
        x, w = roots_jacobi(order, k - 1 - axis, 0)
        x, w = 0.5 * (x + 1), w / w.sum()
        step = (left[:, None] * x).ravel()
        points = np.column_stack([np.repeat(points, order, axis=0), step])
        weights = np.repeat(weights, order) * np.tile(w, len(weights))
        left = np.repeat(left, order) - step
    return np.column_stack([left, points]), weights


# Corners (6, 4, 3) of six tetrahedra around the diagonal of a cube (Kuhn)
KUHN = np.array(
    [np.cumsum([np.zeros(3), *np.eye(3)[list(path)]], axis=0) for path in permutations(range(3))]
)


def points_in(corners: Array, order: int) -> tuple[Array, Array]:
    """Make points (n, d) and weights (n,) of the rule of an order on simplices (m, k + 1, d)."""
    place, share = simplex_rule(corners.shape[1] - 1, order)
    points = np.einsum("qk,mkd->mqd", place, corners).reshape(-1, corners.shape[2])
    return points, (measures(corners)[:, None] * share).ravel()


# A corner whose level is below this share of the largest is on the surface: round-off.
_ON = 1e-14
_ROUNDS = 64  # of bisection: every edge could be halved 20 times


def heights(corners: Array) -> Array:
    """Compute smallest heights (m,) of simplices (m, k + 1, d), k ≤ d: 0 of a flat one."""
    count = corners.shape[1]
    largest = np.max([measures(np.delete(corners, k, axis=1)) for k in range(count)], axis=0)
    volume = (count - 1) * measures(corners)
    return np.asarray(np.divide(volume, largest, out=np.zeros(len(corners)), where=largest > 0.0))


def split_at_level(corners: Array, level: Callable[[Array], Array]) -> tuple[Array, Array]:
    """Divide simplices where the linear interpolant of a level function is zero.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    level : callable
        Values (n,) at points (n, d); exact for planes, linear in each simplex for the others.

    Returns
    -------
    corners : (n, k + 1, d) array
        Each on one side.
    sign : (n,) array
        Its side: +1 or −1.
    """
    m, count, d = corners.shape
    value = np.asarray(level(corners.reshape(-1, d)), dtype=float).reshape(m, count)
    size = np.abs(value).max(axis=1, keepdims=True, initial=0.0)
    value[np.abs(value) <= _ON * size] = 0.0
    corners, value, _ = split_at_zeros(corners, value)
    return corners, np.where(value.sum(axis=1) < 0.0, -1.0, 1.0)


def bisect(corners: Array, target: Callable[[Array], Array]) -> Array:
    """Halve the longest edges until none exceeds the `target` size.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    target : callable
        Wanted size (m,) of simplices (m, k + 1, d), m.
    """
    return divide(corners, lambda cells, longest: longest > target(cells))


def divide(corners: Array, wanted: Callable[[Array, Array], NDArray[np.bool_]]) -> Array:
    """Halve the longest edge of simplices as long as that is `wanted`.

    Parameters
    ----------
    corners : (m, k + 1, d) array
    wanted : callable
        Whether (m,) to halve simplices (m, k + 1, d) whose longest edges are (m,).
    """
    done = []
    ends = np.array(list(combinations(range(corners.shape[1]), 2)))
    for _ in range(_ROUNDS):
        if not len(corners):
            break
        edge = corners[:, ends[:, 1]] - corners[:, ends[:, 0]]
        lengths = np.einsum("mea,mea->me", edge, edge)
        longest = np.argmax(lengths, axis=1)
        rows = np.arange(len(corners))
        open_ = wanted(corners, np.sqrt(lengths[rows, longest]))
        done.append(corners[~open_])
        corners = corners[open_]
        i, j = ends[longest[open_]].T
        corners = halves(corners, i, j, np.full(len(i), 0.5))
    return np.concatenate([*done, corners])
