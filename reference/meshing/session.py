"""One gmsh session at a time, quiet, deterministic, closed whatever happens; unfitted meshes."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from types import ModuleType

import numpy as np
from numpy.typing import NDArray


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


def simplices(
    gmsh: ModuleType, dimension: int
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """All triangles (in the plane) or tetrahedra (in space) of the model.

    Returns
    -------
    points : (n, d) array
    cells : (m, d + 1) array
        Positively oriented.
    number : array
        Node number (row of `points`) by gmsh tag; −1 where a tag is not used.
    """
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    _, nodes = gmsh.model.mesh.getElementsByType({2: 2, 3: 4}[dimension])
    row = np.full(int(tags.max()) + 1 if len(tags) else 1, -1, dtype=np.int64)
    row[tags.astype(np.int64)] = np.arange(len(tags))
    cells = row[nodes.astype(np.int64)].reshape(-1, dimension + 1)
    used = np.unique(cells)
    compact = np.full(len(tags) + 1, -1, dtype=np.int64)
    compact[used] = np.arange(len(used))
    points = np.ascontiguousarray(coordinates.reshape(-1, 3)[used, :dimension])
    cells = compact[cells]
    number = np.where(row >= 0, compact[row], -1)
    return points, oriented(points, cells), number


def entity_facets(
    gmsh: ModuleType, entities: list[int], dimension: int, number: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Nodes (f, k) of the segments or triangles on curves or faces; `number` as of `simplices`."""
    found = [np.zeros((0, dimension + 1), dtype=np.int64)]
    for entity in entities:
        _, _, nodes = gmsh.model.mesh.getElements(dimension, entity)
        if nodes:
            found.append(number[np.asarray(nodes[0], dtype=np.int64)].reshape(-1, dimension + 1))
    return np.concatenate(found)


def add_polygon(occ: ModuleType, corners: NDArray[np.float64]) -> int:
    """Add the plane face between corners (k, 2 or 3)."""
    tags = [occ.addPoint(*p, *[0.0] * (3 - len(p))) for p in corners]
    lines = [occ.addLine(a, b) for a, b in pairwise([*tags, tags[0]])]
    return int(occ.addPlaneSurface([occ.addCurveLoop(lines)]))


def add_size(gmsh: ModuleType, formula: str) -> int:
    """Add a field of element sizes by a formula."""
    tag: int = gmsh.model.mesh.field.add("MathEval")
    gmsh.model.mesh.field.setString(tag, "F", formula)
    return tag


def set_sizes(gmsh: ModuleType, fields: list[int], smallest: float, largest: float) -> None:
    """Mesh by the least of some fields of sizes; without any, by bounds alone."""
    if fields:
        least = gmsh.model.mesh.field.add("Min")
        gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
        gmsh.model.mesh.field.setAsBackgroundMesh(least)
    gmsh.option.setNumber("Mesh.MeshSizeMin", smallest)
    gmsh.option.setNumber("Mesh.MeshSizeMax", largest)


def oriented(points: NDArray[np.float64], cells: NDArray[np.int64]) -> NDArray[np.int64]:
    """Swap two corners of each cell of negative volume; triangles in space stay as they are."""
    if cells.shape[1] <= points.shape[1]:
        return cells
    negative = np.linalg.det(points[cells[:, 1:]] - points[cells[:, :1]]) < 0
    cells = cells.copy()
    cells[negative, 0], cells[negative, 1] = cells[negative, 1], cells[negative, 0].copy()
    return cells


def background_mesh(
    outline: NDArray[np.float64], size: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Uniform unstructured triangles of a polygon, ignorant of any cut.

    Parameters
    ----------
    outline : (k, 2) array
        Corners in order, m.
    size : float
        Element size, m.

    Returns
    -------
    points : (n, 2) array
    cells : (m, 3) array
    """
    origin, scale = outline.min(axis=0), float(np.ptp(outline, axis=0).max())
    with gmsh_session() as gmsh:
        add_polygon(gmsh.model.occ, (outline - origin) / scale)
        gmsh.model.occ.synchronize()
        set_sizes(gmsh, [], size / scale, size / scale)
        gmsh.model.mesh.generate(2)
        points, cells, _ = simplices(gmsh, 2)
    return points * scale + origin, cells
