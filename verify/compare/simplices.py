"""Geometry of simplices: gradients of barycentric coordinates, facet normals, volumes."""

from dataclasses import dataclass
from itertools import pairwise
from math import factorial

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError

__all__ = ["EDGES", "Simplices", "simplices", "straight_or_raise"]

Array = NDArray[np.float64]

# corners at the ends of each mid-edge node, in VTK's order
EDGES = {2: ((0, 1), (1, 2), (2, 0)), 3: ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))}


@dataclass(frozen=True)
class Simplices:
    """Simplices with what evaluation needs.

    Parameters
    ----------
    corners : (m, d+1, d) float array
    volume : (m,) float array
        Areas in 2D; never negative.
    gradients : (m, d+1, d) float array
        Gradients of the barycentric coordinates; zero in degenerate cells.
    normals : (m, d+1, d) float array
        Unit inward normals of the facets opposite to each corner.
    degenerate : (m,) bool array
        Cells whose height is not resolved by double precision; they hold no material.
    """

    corners: Array
    volume: Array
    gradients: Array
    normals: Array
    degenerate: NDArray[np.bool_]


def simplices(points: Array, cells: NDArray[np.int64]) -> Simplices:
    """Geometry of the simplices with corners ``points[cells[:, :d + 1]]``."""
    d = points.shape[1]
    corners = points[cells[:, : d + 1]]
    areas = np.empty_like(corners)  # facet normals times d! volume, all over one determinant
    for i in range(d + 1):
        others = [k for k in range(d + 1) if k != i]
        edges = [corners[:, b] - corners[:, a] for a, b in pairwise(others)]
        areas[:, i] = _perpendicular(edges)
        inward = np.sum(areas[:, i] * (corners[:, i] - corners[:, others[0]]), axis=1)
        areas[:, i] *= np.where(inward < 0, -1.0, 1.0)[:, None]
    # the determinant from the largest facet: the smallest height, hence the least cancellation
    sizes = np.linalg.norm(areas, axis=2)
    largest = np.argmax(sizes, axis=1)
    rows = np.arange(len(corners))
    apex, foot = corners[rows, largest], corners[rows, (largest + 1) % (d + 1)]
    determinant = np.sum(areas[rows, largest] * (apex - foot), axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = determinant / sizes[rows, largest]
        resolved = 4 * np.finfo(float).eps * np.abs(corners).max(axis=(1, 2))
        degenerate = ~(height > resolved)
        gradients = areas / determinant[:, None, None]
        normals = areas / sizes[..., None]
    gradients[degenerate], normals[degenerate] = 0.0, 0.0
    volume = np.maximum(determinant, 0.0) / factorial(d)
    return Simplices(corners, volume, gradients, normals, degenerate)


def straight_or_raise(points: Array, cells: NDArray[np.int64]) -> None:
    """Check that quadratic cells have straight edges with their nodes at the middle.

    Raises
    ------
    InputError
        With the worst cell, if a mid-edge node is off by more than 1e-8 of its edge.
    """
    d = points.shape[1]
    for k, (a, b) in enumerate(EDGES[d]):
        ends = points[cells[:, a]], points[cells[:, b]]
        off = np.linalg.norm(points[cells[:, d + 1 + k]] - 0.5 * (ends[0] + ends[1]), axis=1)
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
