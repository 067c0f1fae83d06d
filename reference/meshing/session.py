"""One gmsh session at a time, quiet, deterministic, closed whatever happens."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

__all__ = ["gmsh_session", "plane_triangles"]


@contextmanager
def gmsh_session() -> Iterator[ModuleType]:
    """Give the gmsh module with an empty model, and finalise it afterwards."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("General.NumThreads", 1)
        for source in ("FromPoints", "FromCurvature", "ExtendFromBoundary"):
            gmsh.option.setNumber(f"Mesh.MeshSize{source}", 0)
        yield gmsh
    finally:
        gmsh.finalize()


def plane_triangles(
    gmsh: ModuleType,
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """All triangles of the model.

    Returns
    -------
    points : (n, 2) array
    cells : (m, 3) array
        Positively oriented.
    number : array
        Node number (row of `points`) by gmsh tag; −1 where a tag is not used.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType(2)
    row = np.full(int(tags.max()) + 1 if len(tags) else 1, -1, dtype=np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    cells = row[nodes.astype(np.int64)].reshape(-1, 3)
    used = np.unique(cells)
    compact = np.full(len(tags) + 1, -1, dtype=np.int64)
    compact[used] = np.arange(len(used))
    points = np.ascontiguousarray(coordinates.reshape(-1, 3)[used, :2])
    cells = compact[cells]
    number = np.where(row >= 0, compact[row], -1)
    a, b, c = (points[cells[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    cells[area < 0] = cells[area < 0][:, ::-1]
    return points, cells, number
