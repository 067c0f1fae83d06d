"""Geometry of simplices: gradients of barycentric coordinates, facet normals, volumes.

Of triangles in space all of it is tangential: what lies across them has no gradient there.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import factorial

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError

Array = NDArray[np.float64]

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
        """Heights (n, k+1) of points (n, d) over the facets of given cells (n,), m."""
        off = points[:, None] - np.roll(self.corners[cells], -1, axis=1)
        return np.asarray(np.sum(self.normals[cells] * off, axis=2))


def simplices(points: Array, cells: NDArray[np.int64]) -> Simplices:
    """Geometry of the simplices with corners ``points[cells[:, :k + 1]]``."""
    count = _CORNERS[cells.shape[1]]
    corners = points[cells[:, :count]]
    across = triangle_frames(corners)[:, 2] if count == points.shape[1] == 3 else None
    areas = np.empty_like(corners)  # facet normals times k! volume, all over one determinant
    for i in range(count):
        others = [k for k in range(count) if k != i]
        edges = [corners[:, b] - corners[:, a] for a, b in pairwise(others)]
        areas[:, i] = _perpendicular(edges if across is None else [across, *edges])
        inward = np.sum(areas[:, i] * (corners[:, i] - corners[:, others[0]]), axis=1)
        areas[:, i] *= np.where(inward < 0, -1.0, 1.0)[:, None]
    # the determinant from the largest facet: the smallest height, hence the least cancellation
    sizes = np.linalg.norm(areas, axis=2)
    largest = np.argmax(sizes, axis=1)
    rows = np.arange(len(corners))
    apex, foot = corners[rows, largest], corners[rows, (largest + 1) % count]
    determinant = np.sum(areas[rows, largest] * (apex - foot), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = determinant / sizes[rows, largest]
        resolved = 4 * np.finfo(float).eps * np.abs(corners).max(axis=(1, 2))
        degenerate = ~(height > resolved)
        gradients = areas / determinant[:, None, None]
        normals = areas / sizes[..., None]
    gradients[degenerate], normals[degenerate] = 0.0, 0.0
    volume = np.maximum(determinant, 0.0) / factorial(count - 1)
    return Simplices(corners, volume, gradients, normals, degenerate)


def triangle_frames(corners: Array) -> Array:
    """Orthonormal frames (m, 3, 3) of triangles (m, 3, 3) in space, as rows: two along, one across.

    The first is along the longest edge and the others are square to it to the last digit, so that
    of a sliver only the turn about its length is not resolved. Of a triangle without area the frame
    is some frame.
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

    `gradient` (m, 3, 3) may be tangential to another triangulation of the surface: then this is
    the gradient of what it becomes by way of the nearest points.
    """
    return np.asarray(frames @ gradient @ np.swapaxes(frames[:, :2], 1, 2))


def facet_normals(corners: Array) -> Array:
    """Return unit normals (f, d) of facets (f, d, d), by the order of their corners."""
    edges = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        across = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    else:
        across = np.cross(edges[:, 0], edges[:, 1])
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(across / np.linalg.norm(across, axis=1)[:, None])


def facet_nodes(d: int, corner: int, order: int) -> list[int]:
    """Local nodes of the facet opposite to a corner; of order 2 with its mid-edge nodes."""
    own = [k for k in range(d + 1) if k != corner]
    if order == 1:
        return own
    ends = [(own[0], own[1])] if d == 2 else [(own[0], own[1]), (own[1], own[2]), (own[0], own[2])]
    pairs = [tuple(sorted(edge)) for edge in EDGES[d]]
    return own + [d + 1 + pairs.index(edge) for edge in ends]


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
