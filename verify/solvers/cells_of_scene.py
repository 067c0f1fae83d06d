"""Cells of a scene, the same for every solver: numbers, size, those across interfaces."""

import numpy as np
from numpy.typing import NDArray

from verify.scene import Box, Rectangle, Scene, crossed_by_interfaces
from verify.solution import Regularisation


def grid_of(scene: Scene, level: int) -> tuple[list[int] | None, float]:
    """Cells along each axis, None if unstructured, and element size h in m, of a level.

    Of a mesh that the scene does not give itself, but its pattern and sizes or numbers of cells.
    """
    geometry, asked = scene.geometry, scene.mesh
    if asked.pattern == "unstructured" or not isinstance(geometry, Rectangle | Box):
        assert asked.sizes is not None
        return None, asked.sizes[level]
    sides = np.subtract(geometry.upper, geometry.lower)
    if asked.cells is not None:
        counts = np.array(asked.cells[level])
    else:
        assert asked.sizes is not None
        # a size that divides the side up to round-off is that size
        counts = np.ceil(sides / asked.sizes[level] * (1 - 1e-9)).astype(int)
    return counts.tolist(), float((sides / counts).max())


def across_interfaces(
    scene: Scene, points: NDArray[np.float64], cells: NDArray[np.int64]
) -> list[Regularisation]:
    """State the cells (m, k + 1) that an interface crosses: of the material at their centroid."""
    if scene.material.is_uniform:
        return []
    crossed = crossed_by_interfaces(scene.material, points, cells)
    if not crossed.any():
        return []
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    measures = np.sqrt(np.maximum(np.linalg.det(edges @ edges.swapaxes(1, 2)), 0.0))
    share = float(measures[crossed].sum() / measures.sum())
    kind = "cell across an interface, of the material at its centroid"
    return [Regularisation(kind, int(crossed.sum()), share, "volume fraction of the body")]
