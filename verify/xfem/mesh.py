"""Simplicial meshes: triangles in the plane, triangles in space, tetrahedra.

The dimension is a number, not a case: simplices have ``dim``, their points ``space``. Only measures
and gradients tell membranes (`SimplexMesh.is_membrane`) from the others.

Structured meshes of a rectangle and of a box are at the end.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import permutations
from math import factorial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from verify.compiled import njit
from verify.xfem.arrays import (
    Bools,
    Floats,
    Ints,
    XfemError,
    check_choice,
    finite_array,
    index_array,
)

# A cell whose volume is below this fraction of (longest edge)^dim is called degenerate: its
# gradients would lose all digits.
_DEGENERATE = 1e-14


@dataclass(frozen=True)
class SimplexMesh:
    """A mesh of simplices.

    Parameters
    ----------
    points : (n, space) array_like of float
        Node coordinates, in metres.
    cells : (m, dim + 1) array_like of int
        Nodes of each simplex, in any orientation.

    Raises
    ------
    XfemError
        If shapes or indices are wrong, a coordinate is not finite, a cell is degenerate, or a node
        belongs to no cell. When neighbours are first needed: if more than two cells share a facet
        or a cell is given twice.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> mesh = xfem.SimplexMesh([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[0, 1, 2]])
    >>> float(mesh.measures[0])
    0.5
    """

    points: Floats
    cells: Ints

    def __init__(self, points: ArrayLike, cells: ArrayLike) -> None:
        coordinates = finite_array(points, "mesh points", (None, 2), (None, 3))
        nodes = index_array(cells, "cells")
        _check(coordinates, nodes)
        object.__setattr__(self, "points", coordinates)
        object.__setattr__(self, "cells", nodes)
        longest, determinants = _sizes(coordinates, nodes)
        if self.dim == self.space:
            self.__dict__["measures"] = determinants / factorial(self.dim)
        flat = self.measures <= _DEGENERATE * longest**self.dim
        if flat.any():
            where = int(np.argmax(flat))
            raise XfemError(
                f"cell {where} (nodes {self.cells[where].tolist()}) is degenerate: measure "
                f"{self.measures[where]:.3g} with edges up to {longest[where]:.3g}"
            )

    @property
    def dim(self) -> int:
        """Dimension of the simplices: 2 or 3."""
        return self.cells.shape[1] - 1

    @property
    def space(self) -> int:
        """Dimension of the points; ``dim``, or ``dim + 1`` for a membrane."""
        return self.points.shape[1]

    @property
    def edge_vectors(self) -> Floats:
        """(m, dim, space) vectors from the first node of a cell to the others."""
        corners = self.points[self.cells]
        return corners[:, 1:] - corners[:, :1]

    def longest_edges(self, chosen: Ints) -> Floats:
        """Compute the length (q,) of the longest edge of some cells (q,), in metres."""
        return _sizes(self.points, self.cells[chosen])[0]

    @cached_property
    def measures(self) -> Floats:
        """(m,) areas or volumes, positive whatever the orientation."""
        if self.dim == self.space:
            return _sizes(self.points, self.cells)[1] / factorial(self.dim)
        return 0.5 * np.linalg.norm(self._across, axis=1)

    @cached_property
    def _across(self) -> Floats:
        """(m, 3) vectors normal to triangles in space, twice their area long.

        The product of the two shorter edges has the least cancellation. Gram's determinant is the
        square of this: of a height of 1e-8 edges it keeps no digit.
        """
        corners = self.points[self.cells]
        opposite = corners[:, [2, 0, 1]] - corners[:, [1, 2, 0]]
        apex = np.argmax(np.sum(opposite**2, axis=2), axis=1)
        rows = np.arange(len(corners))
        at, after, before = (corners[rows, (apex + k) % 3] for k in range(3))
        return np.cross(after - at, before - at)

    @property
    def is_membrane(self) -> bool:
        """Whether these are triangles in space, which resist in their plane alone."""
        return self.dim < self.space

    @cached_property
    def gradients(self) -> Floats:
        """(m, dim + 1, space) gradients of the linear shape functions, in 1/m."""
        # E_jk (∇N_i)_k = δ_ij with the edges E from the first node; Σ_j ∇N_j = 0
        if self.dim == self.space:
            return _gradients(self.points, self.cells)
        # ∇N_1 = e_2 × n / |n|², ∇N_2 = n × e_1 / |n|² with n = e_1 × e_2
        edges = self.edge_vectors
        across = self._across / np.sum(self._across**2, axis=1)[:, None]
        others = np.stack([np.cross(edges[:, 1], across), np.cross(across, edges[:, 0])], axis=1)
        return np.concatenate([-others.sum(axis=1, keepdims=True), others], axis=1)

    @cached_property
    def neighbours(self) -> Ints:
        """(m, dim + 1) cell across the facet opposite to each node, -1 on the boundary."""
        return neighbours_across(self.cells)

    @cached_property
    def boundary_facets(self) -> Ints:
        """(b, 2) pairs (cell, local node opposite to the facet) of all boundary facets."""
        return np.argwhere(self.neighbours < 0)

    @cached_property
    def node_cells(self) -> tuple[Ints, Ints]:
        """Cells around each node, as (starts (n + 1,), cells): a compressed list."""
        order = np.argsort(self.cells.ravel(), kind="stable")
        counts = np.bincount(self.cells.ravel(), minlength=len(self.points))
        return np.concatenate([[0], np.cumsum(counts)]), order // (self.dim + 1)

    @cached_property
    def extent(self) -> float:
        """Largest coordinate or side of the bounding box: the scale of round-off, in metres."""
        box = self.points.max(axis=0) - self.points.min(axis=0)
        return float(max(np.abs(self.points).max(), box.max()))


def _check(points: Floats, cells: Ints) -> None:
    if cells.ndim != 2 or not 3 <= cells.shape[1] <= points.shape[1] + 1:
        raise XfemError(
            f"cells of shape {cells.shape} on points in {points.shape[1]}D; expected (m, 3) "
            "triangles" + (" or (m, 4) tetrahedra" if points.shape[1] == 3 else "")
        )
    if len(cells) == 0:
        raise XfemError("a mesh without cells")
    if cells.min() < 0 or cells.max() >= len(points):
        raise XfemError(f"a cell has a node outside 0..{len(points) - 1}")
    used = np.bincount(cells.ravel(), minlength=len(points)) > 0
    if not used.all():
        raise XfemError(f"point {int(np.argmin(used))} belongs to no cell")


@njit(cache=True)
def _sizes(points, cells):
    """Find the longest edge (q,) and |det| (q,) of the edges from the first node of each cell.

    In one pass over the mesh. Of triangles in space the second is not one: 0.
    """
    (count, corners), space = cells.shape, points.shape[1]
    longest, determinants = np.zeros(count), np.zeros(count)
    edges = np.zeros((corners, space))
    for cell in range(count):
        for a in range(corners):
            for b in range(a):
                square = 0.0
                for i in range(space):
                    along = points[cells[cell, a], i] - points[cells[cell, b], i]
                    square += along * along
                    if b == 0:
                        edges[a, i] = along
                longest[cell] = max(longest[cell], square)
        longest[cell] = math.sqrt(longest[cell])
        if space == 2:
            determinants[cell] = abs(edges[1, 0] * edges[2, 1] - edges[1, 1] * edges[2, 0])
        elif corners == 4:
            for i in range(3):
                j, k = (i + 1) % 3, (i + 2) % 3
                minor = edges[2, j] * edges[3, k] - edges[2, k] * edges[3, j]
                determinants[cell] += edges[1, i] * minor
            determinants[cell] = abs(determinants[cell])
    return longest, determinants


@njit(cache=True)
def _gradients(points, cells):
    """Compute gradients (m, d + 1, d) of shape functions of triangles or tetrahedra.

    ∇N_1 = e_2 × e_3 / (e_1 · e_2 × e_3) with the edges e from the first node, the others in turn.
    """
    (count, corners), space = cells.shape, points.shape[1]
    gradients, edges = np.zeros((count, corners, space)), np.zeros((space, space))
    for cell in range(count):
        for a in range(space):
            for i in range(space):
                edges[a, i] = points[cells[cell, a + 1], i] - points[cells[cell, 0], i]
        own = gradients[cell]
        for a in range(space):
            b, c = (a + 1) % space, (a + 2) % space
            for i in range(space):
                j, k = (i + 1) % space, (i + 2) % space
                if space == 2:  # of e_b, turned by a right angle
                    own[a + 1, i] = edges[b, j] if i == 0 else -edges[b, j]
                else:
                    own[a + 1, i] = edges[b, j] * edges[c, k] - edges[b, k] * edges[c, j]
        for a in range(space):
            height = 0.0
            for i in range(space):
                height += own[a + 1, i] * edges[a, i]
            for i in range(space):
                own[a + 1, i] /= height
                own[0, i] -= own[a + 1, i]
    return gradients


def facets_of(cells: NDArray) -> NDArray:
    """List the corners (m·(d + 1), d) of all facets of cells, opposite to each corner in turn."""
    corners = cells.shape[1]
    others = np.array([[j for j in range(corners) if j != k] for k in range(corners)])
    return cells[:, others].reshape(-1, corners - 1)


def cells_at(cells: Ints, marked: Bools) -> Ints:
    """Find cells (q,), ascending, with one of the marked nodes (n,)."""
    # corner by corner: many times faster than along the short axis
    return np.flatnonzero(np.logical_or.reduce([marked[nodes] for nodes in cells.T]))


def equal_rows(rows: Ints) -> tuple[Ints, Ints]:
    """Compute pair equal rows (q,), (q,), each one with next: three equal rows make two pairs."""
    order = np.lexsort(rows.T[::-1])
    same = (rows[order[1:]] == rows[order[:-1]]).all(axis=1)
    return order[:-1][same], order[1:][same]


def connected(count: int, first: Ints, second: Ints) -> Ints:
    """Label the components (count,) of a graph with edges from `first` (q,) to `second` (q,)."""
    found = np.arange(count)
    _connect(found, *(np.ascontiguousarray(ends, dtype=np.int64) for ends in (first, second)))
    return found


@njit(cache=True)
def _connect(root, first, second):
    """Join components, then number them; `root` leads from a node to a smaller one of its own."""
    for k in range(len(first)):
        one, other = first[k], second[k]
        while root[one] != one:
            root[one] = root[root[one]]
            one = root[one]
        while root[other] != other:
            root[other] = root[root[other]]
            other = root[other]
        root[max(one, other)] = min(one, other)
    count = 0
    for node in range(len(root)):
        if root[node] == node:
            root[node] = count
            count += 1
        else:
            root[node] = root[root[node]]


def neighbours_across(cells: Ints) -> Ints:
    """Find the cell (m, d + 1) across the facet opposite to each node, -1 on the boundary.

    Raises
    ------
    XfemError
        If a facet is shared by more than two cells, or a cell is given twice.
    """
    across, fault = _across_facets(cells)
    if fault >= 0:
        facet = np.sort(np.delete(cells[fault // cells.shape[1]], fault % cells.shape[1]))
        raise XfemError(f"facet {facet.tolist()} is shared by more than two cells")
    # two cells that share two facets have all nodes in common
    twice = (across[:, 0] >= 0) & (across[:, 0] == across[:, 1])
    if twice.any():
        raise XfemError(f"two cells have the same nodes {cells[np.argmax(twice)].tolist()}")
    return across


@njit(cache=True)
def _across_facets(cells):
    """Find the neighbours as above, and a facet that more than two cells share; -1 without one.

    Facets are told apart by their smallest and largest node and the sum of the others, and found
    by a hash of these.
    """
    count, corners = cells.shape
    slots = 1
    while slots < count * corners:
        slots *= 2
    head, after = np.full(slots, -1, np.int32), np.empty(count * corners, np.int32)
    keys = np.empty((count * corners, 3), np.int32)
    across = np.full((count, corners), -1)
    for facet in range(count * corners):
        cell, opposite = facet // corners, facet % corners
        low, high, total = np.int64(1 << 62), np.int64(-1), np.int64(0)
        for k in range(corners):
            if k != opposite:
                node = cells[cell, k]
                low, high, total = min(low, node), max(high, node), total + node
        middle = total - low - high
        keys[facet, 0], keys[facet, 1], keys[facet, 2] = low, middle, high
        slot = (low * 73856093 + middle * 19349663 + high * 83492791) & (slots - 1)
        other, found = head[slot], False
        while other >= 0 and not found:
            found = keys[other, 0] == low and keys[other, 1] == middle and keys[other, 2] == high
            if not found:
                other = after[other]
        if found:
            there, behind = other // corners, other % corners
            if across[there, behind] >= 0:
                return across, facet
            across[there, behind], across[cell, opposite] = cell, there
        else:
            after[facet], head[slot] = head[slot], facet
    return across, -1


Diagonal = Literal["right", "left", "alternating", "crossed"]


def rectangle_mesh(
    divisions: Sequence[int],
    lower: ArrayLike = (0.0, 0.0),
    upper: ArrayLike = (1.0, 1.0),
    diagonal: Diagonal = "right",
) -> SimplexMesh:
    """Divide a rectangle into equal rectangles, and these into triangles.

    Parameters
    ----------
    divisions : (2,) sequence of int
        Rectangles along x and y.
    lower, upper : (2,) array_like
        Opposite corners, in metres.
    diagonal : {"right", "left", "alternating", "crossed"}
        ``right`` splits from the lower left to the upper right, ``alternating`` right and left
        like a chessboard; ``crossed`` puts a node in the middle of every rectangle.

    Raises
    ------
    XfemError
        If a number of divisions or a side is not positive, or the diagonal is unknown.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> len(xfem.rectangle_mesh((4, 2)).cells)
    16
    """
    nodes, points = _grid(divisions, lower, upper)
    a, b = nodes[:-1, :-1], nodes[1:, :-1]
    c, d = nodes[1:, 1:], nodes[:-1, 1:]
    right = np.stack([np.stack([a, b, c], -1), np.stack([a, c, d], -1)], 2)
    left = np.stack([np.stack([a, b, d], -1), np.stack([b, c, d], -1)], 2)
    check_choice(diagonal, Diagonal, "diagonal")
    if diagonal != "crossed":
        odd = (np.indices(a.shape).sum(axis=0) % 2 == 1)[:, :, None, None]
        turned = {"right": False, "left": True, "alternating": odd}[diagonal]
        return SimplexMesh(points, np.where(turned, left, right).reshape(-1, 3))
    centre = len(points) + np.arange(a.size).reshape(a.shape)
    centres = points[np.stack([a, b, c, d], -1)].mean(axis=2).reshape(-1, 2)
    sides = [(a, b), (b, c), (c, d), (d, a)]
    fans = np.stack([np.stack([p, q, centre], -1) for p, q in sides], 2)
    return SimplexMesh(np.concatenate([points, centres]), fans.reshape(-1, 3))


def box_mesh(
    divisions: Sequence[int],
    lower: ArrayLike = (0.0, 0.0, 0.0),
    upper: ArrayLike = (1.0, 1.0, 1.0),
) -> SimplexMesh:
    """Divide a box into equal boxes, and each into six tetrahedra (Kuhn's triangulation).

    All six share the diagonal from the lower to the upper corner of their box, so the mesh is
    conforming and translation invariant.

    Parameters
    ----------
    divisions : (3,) sequence of int
        Boxes along x, y and z.
    lower, upper : (3,) array_like
        Opposite corners, in metres.

    Raises
    ------
    XfemError
        If a number of divisions or a side is not positive.

    Examples
    --------
    >>> import verify.xfem as xfem
    >>> len(xfem.box_mesh((2, 2, 2)).cells)
    48
    """
    nodes, points = _grid(divisions, lower, upper)
    counts = [k - 1 for k in nodes.shape]
    cells = []
    # a tetrahedron for each way along three edges from the lower to the upper corner
    for order in permutations(range(3)):
        offset = np.zeros(3, dtype=int)
        path = []
        for axis in (None, *order):
            if axis is not None:
                offset[axis] = 1
            window = tuple(slice(o, o + k) for o, k in zip(offset, counts, strict=True))
            path.append(nodes[window])
        cells.append(np.stack(path, -1))
    return SimplexMesh(points, np.stack(cells, 3).reshape(-1, 4))


def _grid(divisions: Sequence[int], lower: ArrayLike, upper: ArrayLike) -> tuple[Ints, Floats]:
    """Assign numbers to the nodes of a grid, by place (x, y, z); with coordinates (n, d)."""
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    counts = np.asarray(divisions)
    if counts.shape != low.shape or (counts < 1).any() or counts.dtype.kind != "i":
        raise XfemError(f"divisions {divisions!r}; expected {len(low)} positive integers")
    if low.shape != high.shape or not (high > low).all():
        raise XfemError(f"box from {low.tolist()} to {high.tolist()}; expected lower < upper")
    # numbers run along x first, as in a picture read line by line
    nodes = np.arange(np.prod(counts + 1)).reshape(tuple(counts[::-1] + 1)).T
    axes = [np.linspace(a, b, k + 1) for a, b, k in zip(low, high, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    points = np.empty((nodes.size, len(low)))
    points[nodes.ravel()] = grid.reshape(-1, len(low))
    return nodes, points
