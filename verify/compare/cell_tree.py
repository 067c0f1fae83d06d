"""A tree of bounding boxes over the cells of a mesh.

A uniform grid of bins fails on meshes that are graded to a crack tip: an eighth of all cells
can fall into one bin. Boxes over runs of cells in Morton order adapt to the grading and are
built without recursion.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAF = 4  # cells per leaf
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
        Of each cell; the normals are those of its facets, inwards, of length one.
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

    Cells on a `surface` are ordered in cubes: in boxes as flat as a shallow surface is, its height
    would count as much as its length, which makes finding its cells half as slow again.
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
    lo[leaves:] = np.where(full[..., None], lower[held], np.inf).min(axis=1)
    up[leaves:] = np.where(full[..., None], upper[held], -np.inf).max(axis=1)
    first = leaves // 2
    while first >= 1:
        children = slice(2 * first, 4 * first)
        lo[first : 2 * first] = lo[children].reshape(first, 2, d).min(axis=1)
        up[first : 2 * first] = up[children].reshape(first, 2, d).max(axis=1)
        first //= 2
    return CellTree(lo, up, cells)


def morton_order(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Order (n,) of points (n, d) in which near ones follow each other.

    Points that are asked for in this order find their cells three times as fast: what they
    need is in the cache.
    """
    return np.argsort(_morton(points), kind="stable")


def _morton(centres: NDArray[np.float64], in_cubes: bool = False) -> NDArray[np.int64]:
    """Interleave the bits of the coordinates, so that near cells get near numbers."""
    d = centres.shape[1]
    bits = 31 if d == 2 else 20
    if not len(centres):
        return np.zeros(0, dtype=np.int64)
    extent = np.maximum(np.ptp(centres, axis=0), 1e-300)
    if in_cubes:
        extent[:] = extent.max()
    whole = ((centres - centres.min(axis=0)) / extent * (2**bits - 1)).astype(np.int64)
    code = np.zeros(len(centres), dtype=np.int64)
    for axis in range(d):
        spread = np.ascontiguousarray(whole[:, axis])
        for shift, mask in _SPREAD[d]:
            spread = (spread | (spread << shift)) & mask
        code |= spread << axis
    return code
