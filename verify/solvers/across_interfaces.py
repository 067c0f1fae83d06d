"""Cells that lie across an interface of materials, stated by every solver of ours."""

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene, crossed_by_interfaces
from verify.solution import Regularisation


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
