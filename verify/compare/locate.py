"""The field of a `Solution`: displacement and its gradient at any point, on the wanted side.

Sides are decided by geometry alone. On a cut a point has two values; the caller says which by
`near`, a point in the wanted direction. A solution whose realised cut deviates from the cut
as asked (an arc in facets, a snapped cut) is asked through `verify.compare.realised`.
"""

from copy import copy
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from verify.compare.cell_tree import (
    Floats,
    Ints,
    SearchedCells,
    axes_of,
    build_cell_tree,
    find_cells,
    holding_cells,
    nearest_triangles,
    no_sides,
)
from verify.compare.simplices import (
    Simplices,
    cells_of,
    kept_with,
    simplices,
    straight_or_raise,
    triangle_frames,
)
from verify.compiled import COMPILED, njit
from verify.errors import InputError
from verify.geometry.simplices import bounds_of
from verify.solution import Solution


def evaluate_linear(
    points: Floats, found: Ints, origins: Floats, values: Floats, slopes: Floats
) -> Floats:
    """Evaluate u = u_0 + G (x - x_0), (n, d), with x_0 and u_0 at the first corner."""
    if not COMPILED:
        return values[found] + np.einsum("nca,na->nc", slopes[found], points - origins[found])
    result = np.empty(points.shape)
    _evaluate_linear(points, found, origins, values, slopes, axes_of(points.shape[1]), result)
    return result


@njit(cache=True)
def _evaluate_linear(points, found, origins, values, slopes, axes, result):
    d = len(axes)
    for i in range(points.shape[0]):
        cell = found[i]
        for c in range(d):
            value = values[cell, c]
            for a in range(d):
                value += slopes[cell, c, a] * (points[i, a] - origins[cell, a])
            result[i, c] = value


def bends_of(nodal: Floats, cells: Ints) -> Floats:
    """Give P2 fields of nodal values (n, d) on m cells as polynomials in their coordinates λ.

    Returns (m, d, k, 1 + k) arrays (b, B): u = u_0 + b·λ + ½ λ·Bλ, with the k coordinates λ that
    are 0 at the first corner, of value u_0. Straight edges.
    """
    corners = {3: 2, 6: 3, 10: 4}[cells.shape[1]]
    middle = np.zeros((corners, corners), dtype=np.int64)  # VTK: 01 12 20, of tetrahedra 03 13 23
    for number, edge in enumerate([(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]):
        if corners + number < cells.shape[1]:
            middle[edge] = middle[edge[::-1]] = corners + number
    found = np.empty((len(cells), nodal.shape[1], corners - 1, corners))
    if COMPILED:
        _bends(nodal, cells, middle, axes_of(nodal.shape[1]), axes_of(corners - 1), found)
        return found
    values = nodal[cells]
    first, others = values[:, 0], values[:, 1:corners]
    for k in range(1, corners):
        found[:, :, k - 1, 0] = 4.0 * values[:, middle[0, k]] - others[:, k - 1] - 3.0 * first
        found[:, :, k - 1, k] = 4.0 * (first + others[:, k - 1] - 2.0 * values[:, middle[0, k]])
        for j in range(1, k):
            bend = first + values[:, middle[j, k]] - values[:, middle[0, j]]
            bend = 4.0 * (bend - values[:, middle[0, k]])
            found[:, :, k - 1, j] = found[:, :, j - 1, k] = bend
    return found


@njit(cache=True)
def _bends(nodal, cells, middle, axes, across, found):
    for i in range(len(cells)):
        for c in axes:
            first = nodal[cells[i, 0], c]
            for k in across:
                corner, half = nodal[cells[i, 1 + k], c], nodal[cells[i, middle[0, 1 + k]], c]
                found[i, c, k, 0] = 4.0 * half - corner - 3.0 * first
                found[i, c, k, 1 + k] = 4.0 * (first + corner - 2.0 * half)
                for j in range(k):
                    other = nodal[cells[i, middle[0, 1 + j]], c]
                    bend = 4.0 * (first + nodal[cells[i, middle[1 + j, 1 + k]], c] - other - half)
                    found[i, c, k, 1 + j] = found[i, c, j, 1 + k] = bend


def slopes_of(nodal: Floats, cells: Ints, gradients: Floats) -> Floats:
    """Compute gradients (m, d, a) of P1 fields of nodal values (n, d) on m cells.

    `gradients` (m, k, a) belong to the coordinates that are 0 at the first corner.
    """
    if not COMPILED:
        values = nodal[cells]
        return np.asarray(np.einsum("mkc,mka->mca", values[:, 1:] - values[:, :1], gradients))
    found = np.empty((len(cells), nodal.shape[1], gradients.shape[2]))
    _slopes(nodal, cells, gradients, axes_of(nodal.shape[1]), axes_of(gradients.shape[1]), found)
    return found


@njit(cache=True)
def _slopes(nodal, cells, gradients, axes, across, found):
    for i in range(len(cells)):
        for c in axes:
            first = nodal[cells[i, 0], c]
            for a in axes:
                found[i, c, a] = 0.0
            for k in across:
                rise = nodal[cells[i, 1 + k], c] - first
                for a in axes:
                    found[i, c, a] += rise * gradients[i, k, a]


def evaluate_quadratic(
    points: Floats, found: Ints, origins: Floats, first: Floats, bends: Floats, slopes: Floats
) -> tuple[Floats, Floats]:
    """Return value (n, d) and gradient (n, d, d) of a P2 field on straight-edged simplices.

    `bends` are as `bends_of` gives them; `slopes` (m, k, d) are the gradients of the coordinates,
    `origins` and `first` (m, d) place and value of the first corners.
    """
    n, d = points.shape
    u, grad = np.empty((n, d)), np.empty((n, d, d))
    if not COMPILED:
        for start in range(0, n, _AT_ONCE):
            here = slice(start, start + _AT_ONCE)
            cell = found[here]
            u[here], grad[here] = _quadratic_in_numpy(
                points[here] - origins[cell], first[cell], bends[cell], slopes[cell]
            )
        return u, grad
    across = axes_of(slopes.shape[1])  # of a triangle in space there are two
    _evaluate_quadratic(points, found, origins, first, bends, slopes, axes_of(d), across, u, grad)
    return u, grad


def _quadratic_in_numpy(
    x: Floats, first: Floats, bends: Floats, slopes: Floats
) -> tuple[Floats, Floats]:
    """Evaluate as `evaluate_quadratic` at `x` (n, d) from first corners, each in its own cell.

    With points as the last axis: four times as fast as with it first.
    """
    slopes, bends = (np.ascontiguousarray(np.moveaxis(one, 0, -1)) for one in (slopes, bends))
    place = np.einsum("kan,na->kn", slopes, x)
    linear, bend = bends[:, :, 0], np.einsum("ckln,ln->ckn", bends[:, :, 1:], place)
    u = first + np.einsum("ckn,kn->nc", linear + 0.5 * bend, place)
    return u, np.einsum("ckn,kan->nca", linear + bend, slopes)


@njit(cache=True)
def _evaluate_quadratic(points, found, origins, first, bends, slopes, axes, across, u, grad):
    place, rate = np.empty(len(across)), np.empty(len(across))
    for i in range(len(points)):
        cell = found[i]
        for k in across:
            place[k] = 0.0
            for a in axes:
                place[k] += slopes[cell, k, a] * (points[i, a] - origins[cell, a])
        for c in axes:
            value = first[cell, c]
            for k in across:
                bend = 0.0
                for j in across:
                    bend += bends[cell, c, k, 1 + j] * place[j]
                value += (bends[cell, c, k, 0] + 0.5 * bend) * place[k]
                rate[k] = bends[cell, c, k, 0] + bend
            u[i, c] = value
            for a in axes:
                slope = 0.0
                for k in across:
                    slope += rate[k] * slopes[cell, k, a]
                grad[i, c, a] = slope


def squares(values: Floats) -> Floats:
    """Sum (n,) of the squares of the entries of each of `values` (n, ...)."""
    flat = values.reshape(len(values), -1)
    return np.asarray(np.einsum("nk,nk->n", flat, flat))


def value_squares(found: Floats, expected: Floats) -> Floats:
    """Square the difference of values (n, d), and `expected`: (2, n)."""
    if not COMPILED:
        return np.stack([squares(found - expected), squares(expected)])
    rows = np.empty((2, len(found)))
    _value_squares(np.ascontiguousarray(found), np.ascontiguousarray(expected), rows)
    return rows


@njit(cache=True)
def _value_squares(found, expected, rows):
    for i in range(len(found)):
        off = own = 0.0
        for a in range(found.shape[1]):
            off += (found[i, a] - expected[i, a]) ** 2
            own += expected[i, a] ** 2
        rows[0, i], rows[1, i] = off, own


def difference_squares(found: Floats, expected: Floats) -> Floats:
    """Square the strains of the difference of gradients (n, d, d), and of `expected`: (5, n).

    tr² ε and ε : ε of either; the last row is the sum of the squares of all entries of `expected`.
    """
    if not COMPILED:
        return _difference_squares_in_numpy(found, expected)
    rows = np.empty((5, len(found)))
    found, expected = np.ascontiguousarray(found), np.ascontiguousarray(expected)
    _difference_squares(found, expected, axes_of(found.shape[1]), rows)
    return rows


def _difference_squares_in_numpy(found: Floats, expected: Floats) -> Floats:
    """Do the same entry by entry: nearly twice as fast as matrix by matrix."""
    rows = np.zeros((5, len(found)))
    off = found - expected
    for k, one in ((0, off), (2, expected)):
        for a in range(one.shape[1]):
            rows[k] += one[:, a, a]
            rows[k + 1] += one[:, a, a] ** 2
            for b in range(a):
                rows[k + 1] += 0.5 * (one[:, a, b] + one[:, b, a]) ** 2
        rows[k] **= 2
    rows[4] = squares(expected)
    return rows


@njit(cache=True)
def _difference_squares(found, expected, axes, rows):
    for i in range(len(found)):
        trace = sheared = trace_e = sheared_e = entries = 0.0
        for a in axes:
            own = expected[i, a, a]
            off = found[i, a, a] - own
            trace += off
            trace_e += own
            sheared += 2.0 * off**2
            sheared_e += 2.0 * own**2
            entries += own**2
            for b in range(a):
                one, other = expected[i, a, b], expected[i, b, a]
                sheared += ((found[i, a, b] - one) + (found[i, b, a] - other)) ** 2
                sheared_e += (one + other) ** 2
                entries += one**2 + other**2
        rows[0, i], rows[1, i] = trace**2, 0.5 * sheared
        rows[2, i], rows[3, i], rows[4, i] = trace_e**2, 0.5 * sheared_e, entries


Array = NDArray[np.float64]
_AT_ONCE = 1 << 13  # points that numpy evaluates: what it makes of them stays in the cache

# Relative to the body's size: mesh generators and files move points by up to this much.
ROUND_OFF = 1e-10


class Field(Protocol):
    """A displacement field that can be compared: of a solution, or exact."""

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d) in m at `points` (n, d)."""
        ...

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Evaluate the gradient (n, d, d), ``[:, i, j]`` = ∂u_i/∂x_j, at `points` (n, d)."""
        ...


@kept_with
def _checked(solution: Solution) -> Simplices:
    """Return the cells of a solution that can be evaluated."""
    if solution.order == 2:
        straight_or_raise(solution.points, solution.cells)
    if not np.isfinite(solution.points).all():
        raise InputError("a solution has nodes whose coordinates are not finite")
    if cells_of(solution).degenerate.all():
        raise InputError("all cells of a solution are without volume")
    return cells_of(solution)


@kept_with
def _searched(solution: Solution) -> SearchedCells:
    """Return the cells of a solution in a tree, those without volume left out."""
    shape = cells_of(solution)
    lower, upper = bounds_of(shape.corners)
    lower[shape.degenerate] = np.nan
    tree = build_cell_tree(lower, upper, surface=solution.cell_dimension < solution.dimension)
    return tree.over(shape.corners, shape.normals)


class SolutionField:
    """Evaluate a solution at points.

    Parameters
    ----------
    solution : Solution
        Linear, or quadratic with straight edges. Of a membrane the gradients are tangential.
    step : int
        Output time that is evaluated; default the last.

    Raises
    ------
    InputError
        If nodes are not finite, no cell has a volume, or quadratic cells have curved edges.
    """

    def __init__(self, solution: Solution, step: int = -1) -> None:
        self.solution = solution
        self._cells = np.ascontiguousarray(solution.cells)
        self.shape = _checked(solution)
        self.scale = float(np.linalg.norm(np.ptp(solution.points, axis=0)))
        self._origin = np.ascontiguousarray(self.shape.corners[:, 0])
        membrane = solution.cell_dimension < solution.dimension
        self._across = (
            np.ascontiguousarray(triangle_frames(self.shape.corners)[:, 2]) if membrane else None
        )
        self._sides = no_sides(self._cells)
        self._set_nodal(solution.displacement[step])

    def _set_nodal(self, displacement: Array) -> None:
        self._nodal = np.ascontiguousarray(displacement, dtype=float)
        self._first = self._nodal[self._cells[:, 0]]
        self._slope = (
            slopes_of(self._nodal, self._cells, self.shape.gradients[:, 1:])
            if self.solution.order == 1
            else bends_of(self._nodal, self._cells)
        )

    @property
    def _searched(self) -> SearchedCells:
        return _searched(self.solution)

    @property
    def _centres(self) -> Array:
        return self._searched.centres

    @property
    def nodal(self) -> Array:
        """Nodal displacements (n, d)."""
        return self._nodal

    def with_nodal(self, displacement: Array) -> Self:
        """Return the field of other nodal displacements (n, d) on the same mesh and tree."""
        other = copy(self)
        other._set_nodal(displacement)
        return other

    def missing(self, points: Array, weights: Array, off: float = 0.0) -> float:
        """Share of the weights (n,) of points (n, d) of a body that lie in no cell.

        They may lie `off` the cells of a membrane, in metres.
        """
        if self._across is not None:
            away = self._on_surface(points)[1] > max(off, ROUND_OFF * self.scale)
        else:
            away = holding_cells(points, self._searched, ROUND_OFF * self.scale, nearest=False) < 0
        return float(weights[away].sum() / weights.sum())

    def cells_at(self, points: Array, near: Array | None = None) -> NDArray[np.int64]:
        """Find the cell (n,) that holds each of `points` (n, d).

        Where a point belongs to several cells within round-off, that one is taken whose
        centroid lies in the direction of `near` (n, d); without `near`, the one that it lies
        deepest in. A point outside of all cells is given to the nearest.
        """
        if self._across is not None:
            return self._on_surface(points, near)[0]
        asked = self._asked(points, near)
        return find_cells(*asked, self._searched, self._sides, ROUND_OFF * self.scale)

    def _on_surface(
        self, points: Array, near: Array | None = None
    ) -> tuple[NDArray[np.int64], Array]:
        """Find the triangle (n,) nearest to each of `points` (n, 3), and its distance (n,)."""
        assert self._across is not None
        among = self._searched, self._across, self._sides
        return nearest_triangles(*self._asked(points, near), *among, ROUND_OFF * self.scale)

    def _asked(self, points: Array, near: Array | None) -> tuple[Array, Array, NDArray[np.int8]]:
        """Return points, the ways (n, d) or (0, d) to `near`, and the wanted sides of cuts."""
        wanted, nowhere = self._wanted(points, near), np.zeros((0, points.shape[1]))
        directions = nowhere if near is None or near is points else near - points
        points, directions = (np.ascontiguousarray(a, dtype=float) for a in (points, directions))
        return points, directions, wanted

    def _wanted(self, points: Array, near: Array | None) -> NDArray[np.int8]:
        """Return the wanted sides (n, 0) of cuts: no cut is known here."""
        return no_sides(points)

    def inner_points(self, cells: NDArray[np.int64]) -> Array:
        """Find points (n, d) on sides of the cuts on which given cells (n,) lie: their centres."""
        return np.asarray(self._centres[cells])

    def in_cells(self, points: Array, cells: NDArray[np.int64]) -> tuple[Array, Array]:
        """Evaluate displacement (n, d) and gradient (n, d, d) by given cells (n,)."""
        points = np.ascontiguousarray(points, dtype=float)
        if self.solution.order == 1:
            u = evaluate_linear(points, cells, self._origin, self._first, self._slope)
            return u, self._slope.take(cells, axis=0)
        slopes = self.shape.gradients[:, 1:]
        return evaluate_quadratic(points, cells, self._origin, self._first, self._slope, slopes)

    def cell_gradients(self, points: Array) -> Array:
        """Evaluate the gradient (m, d, d) in each cell, at a point (m, d) in it."""
        if self.solution.order == 1:
            return self._slope
        return self.in_cells(points, np.arange(len(points)))[1]

    def evaluate(self, points: Array, near: Array | None = None) -> tuple[Array, Array]:
        """Compute the displacement (n, d) and gradient (n, d, d) at `points` (n, d)."""
        return self.in_cells(points, self.cells_at(points, near))

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement (n, d) in m at `points` (n, d)."""
        return self.evaluate(points, near)[0]

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Compute the displacement gradient (n, d, d) at `points` (n, d)."""
        return self.evaluate(points, near)[1]


def nearest_of_triangles(
    points: Array, corners: Array, tolerance: float
) -> tuple[NDArray[np.int64], Array]:
    """Find the triangle (n,) in space nearest to each of `points` (n, 3), and its distance (n,).

    Parameters
    ----------
    points : (n, 3) array
    corners : (m, 3, 3) array
        Of triangles with an area.
    tolerance : float
        Of triangles nearer than this to each other, that one whose edges are farthest, m.
    """
    corners = np.ascontiguousarray(corners)
    shape = simplices(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    tree = build_cell_tree(*bounds_of(corners), surface=True)
    found: tuple[NDArray[np.int64], Array] = nearest_triangles(
        np.ascontiguousarray(points), np.zeros((0, 3)), no_sides(points),
        tree.over(corners, shape.normals),
        np.ascontiguousarray(triangle_frames(corners)[:, 2]), no_sides(corners), tolerance,
    )  # fmt: skip
    return found
