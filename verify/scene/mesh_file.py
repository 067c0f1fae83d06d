"""Reading the mesh file of a scene: simplices in any format that meshio knows."""

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.read_mesh import read_with_meshio
from verify.scene.geometry import MeshFile
from verify.scene.loading import mesh_path
from verify.scene.scene import Scene

_SIMPLEX = {2: "triangle", 3: "tetra"}
_PLANE = 1e-9  # of a plane body: what its z coordinates may differ by, as round-off
_BELOW = {2: {"vertex", "line"}, 3: {"vertex", "line", "triangle"}}  # parts, which are not used


def read_mesh(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Read the mesh file of a scene whose geometry is one.

    Parameters
    ----------
    scene : Scene
        With a geometry of kind ``file``.

    Returns
    -------
    points : (n, d) array
        Nodes that some cell uses, m.
    cells : (m, d + 1) array
        Simplices of positive orientation; of a membrane triangles (m, 3), oriented as they were.

    Raises
    ------
    InputError
        If the file is missing, unreadable, not simplicial, or degenerate, or if cells overlap that
        share a facet.
    """
    assert isinstance(scene.geometry, MeshFile)
    path, d, k = mesh_path(scene), scene.dimension, scene.cell_dimension
    if not path.is_file():
        raise InputError(f"geometry.file: no mesh file '{path}'", str(scene.file or ""))
    mesh = read_with_meshio(path)
    kinds = {block.type for block in mesh.cells if len(block.data)}
    strange = kinds - _BELOW[k] - {_SIMPLEX[k]}
    if strange or _SIMPLEX[k] not in kinds:
        found = ", ".join(sorted(strange or kinds)) or "no cells"
        raise InputError(f"not simplicial: has {found}; expected {_SIMPLEX[k]}s", str(path))
    if d == 2 and mesh.points.shape[1] == 3:
        *sides, height = np.ptp(mesh.points, axis=0)
        if height > _PLANE * max(sides):
            raise InputError(f"not plane: its z coordinates differ by {height:.3g} m", str(path))
    points = np.ascontiguousarray(mesh.points[:, :d], dtype=float)
    cells = mesh.cells_dict[_SIMPLEX[k]].astype(np.int64)
    if cells.min() < 0 or cells.max() >= len(points):
        raise InputError(f"a cell names a node outside 0..{len(points) - 1}", str(path))
    used, compact = np.unique(cells, return_inverse=True)
    points, cells = points[used], compact.reshape(cells.shape).astype(np.int64)
    if not np.isfinite(points).all():
        raise InputError("has coordinates that are not finite", str(path))
    cells = _oriented(points, cells, str(path))
    _refuse_overlaps(cells, k == d, str(path))
    return points, cells


def _oriented(
    points: NDArray[np.float64], cells: NDArray[np.int64], where: str
) -> NDArray[np.int64]:
    """Swap two corners of every cell of negative orientation; refuse cells without volume."""
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    membrane = edges.shape[1] < edges.shape[2]
    normals = np.cross(edges[:, 0], edges[:, 1]) if membrane else None
    volume = np.linalg.det(edges) if normals is None else np.linalg.norm(normals, axis=1)
    size = np.linalg.norm(edges, axis=2).max(axis=1) ** edges.shape[1]
    flat = np.flatnonzero(~(np.abs(volume) > 1e-14 * size))
    if flat.size:
        raise InputError(f"{flat.size} cells without volume, first cell {flat[0]}", where)
    cells = cells.copy()
    negative = volume < 0
    cells[negative, 0], cells[negative, 1] = cells[negative, 1], cells[negative, 0].copy()
    return cells


def _refuse_overlaps(cells: NDArray[np.int64], oriented: bool, where: str) -> None:
    """Refuse cells on the same side of a facet that they share; of a membrane, the same cell twice.

    Cells of positive orientation on either side of a facet name its corners in opposite turns.
    """
    facets = [np.delete(cells, i, axis=1) for i in range(cells.shape[1])] if oriented else [cells]
    rows = []
    for i, facet in enumerate(facets):
        pairs = [(a, b) for b in range(facet.shape[1]) for a in range(b)]
        swaps = sum((facet[:, a] > facet[:, b]).astype(np.int64) for a, b in pairs)
        side = (swaps + i) % 2 if oriented else np.zeros(len(facet), dtype=np.int64)
        rows.append(np.column_stack([np.sort(facet, axis=1), side]))
    asked = np.concatenate(rows)
    order = np.lexsort(asked.T)
    same = np.flatnonzero((asked[order[1:]] == asked[order[:-1]]).all(axis=1))
    if same.size:
        pair = np.sort(order[same[0] : same[0] + 2] % len(cells))
        raise InputError(
            f"cells {pair[0]} and {pair[1]} overlap: they are on the same side of a facet", where
        )
