"""Meshes on which the FEniCSx side solves a scene: at equal h, and the reference's own levels."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference.fracture import Front, front_at, station_spacing
from reference.meshing import (
    ConformingMesh,
    Grading,
    Realised,
    background_mesh,
    clear_radii,
    conforming_mesh,
    imprint,
    imprint_facets,
    imprint_polygons,
    open_cut,
    singular_points,
    structured_tetrahedra,
    structured_triangles,
)
from reference.meshing.edge_splitting import graded_to
from reference.meshing.inner_lines import singular_lines, split_at_part_ends
from verify.errors import InputError
from verify.geometry.simplices import mesh_edges, refine_uniformly
from verify.scene import Box, MeshFile, Polygon, PolygonCut, Rectangle, Scene, SweptCut, read_mesh
from verify.scene.acceptance import FractureQuantity
from verify.scene.mesh_position import moved_mesh, size_share
from verify.scene.tool_path import Cut
from verify.solvers.runs import grid_of

Array = NDArray[np.float64]
_WAY = {2: 1 / 16, 3: 1 / 2}  # size of elements along the way of a blade, over that far away
# of the smallest domain at a front: cells that begin within a quarter of it must end inside
_FRONT_SHARE = 0.45
Cells = NDArray[np.int64]
Counts = list[int] | None  # cells along each axis; None if unstructured


def structure(scene: Scene, level: int) -> tuple[Counts, float]:
    """Give the cells along each axis, None if unstructured, and the element size of a level, m."""
    if isinstance(scene.geometry, MeshFile):
        points, cells = read_mesh(scene)
        edges = points[mesh_edges(cells)]
        return None, float(np.linalg.norm(np.diff(edges, axis=1), axis=2).mean()) / 2**level
    return grid_of(scene, level)


def not_imprinted(scene: Scene) -> str | None:
    """Say why the cuts cannot be imprinted on a given mesh, or None if they can."""
    for cut in scene.final_cuts:
        if not cut.faceted:
            return f"a {cut.kind} cut is not plane in parts: it is not imprinted on a given mesh"
    if isinstance(scene.geometry, Box) and scene.mesh.pattern == "unstructured":
        return "a box has no unstructured background mesh that cuts could be imprinted on"
    return None


def peer_mesh(scene: Scene, level: int, mesh: str) -> ConformingMesh:
    """Make the mesh of a level, imprinted or remeshed, that is the peer of an unfitted one."""
    if isinstance(scene.geometry, MeshFile) or (mesh == "imprinted" and not not_imprinted(scene)):
        return open_cut(*_imprinted(scene, level))
    counts, size = structure(scene, level)
    if counts is not None:
        # equal mean size: two equilateral triangles of this edge are a square of 1, and with it
        # HXT was measured to make six tetrahedra per cube of 1
        edge = np.sqrt(2 / np.sqrt(3)) if scene.dimension == 2 else 0.88
        sides = np.subtract(scene.geometry.upper, scene.geometry.lower)  # type: ignore[union-attr]
        size = float(np.prod(sides / counts) ** (1 / len(sides)) * edge)
        size *= size_share(scene.mesh.position)
    return conforming_mesh(scene, Grading(size, np.zeros((0, scene.dimension))))


def reference_mesh(scene: Scene, level: int) -> tuple[ConformingMesh, float]:
    """Make a level of the reference and give its size far from singular places, m.

    A given mesh is refined uniformly after the cuts are imprinted, and edges split where supports
    and tractions end; so is the scene's own where the cut is what another solver realised on it.
    Others are made anew, graded. The finest level that a case asks for has nodes at least as close
    as the solvers on their finest; of a mesh that is refined for them it is graded too.
    """
    realised = _realised(scene, 0)
    if realised is not None or isinstance(scene.geometry, MeshFile):
        given = _imprinted(scene, 0) if realised is None else realised[:3]
        given = split_at_part_ends(scene, *given)
        times, size = level + scene.first_refinement, structure(scene, 0)[1]
        fine = refine_uniformly(*given, times=times)
        if scene.mesh.refine and realised is None and scene.cell_dimension == scene.dimension:
            fine = graded_to(*fine, singular_lines(scene, *given), size / 2**times)
        return open_cut(*fine), size / 2**times
    grading = _plane_grading(scene) if scene.dimension == 2 else _solid_grading(scene)
    grading = grading.halved(level)
    return conforming_mesh(scene, grading), grading.size


def _plane_grading(scene: Scene) -> Grading:
    extent = np.sqrt(scene.geometry.measure())  # type: ignore[union-attr]
    size = scene.reference.size or extent / 12
    points = singular_points(scene)
    clear, way = clear_radii(scene, points), _way(scene, size)
    return Grading(size, points, extent / 2, strip=1.0, clear=clear, way=way)


def _solid_grading(scene: Scene) -> Grading:
    assert isinstance(scene.geometry, Box)
    extent = scene.geometry.measure() ** (1 / 3)
    size = scene.reference.size or extent / 4
    way = _way(scene, size)  # where the front has been everywhere, its last place is nothing apart
    curves = way is None
    return Grading(
        size, np.zeros((0, 3)), extent / 2, exponent=2 / 3, curves=curves, way=way,
        fronts=_asked_fronts(scene), share=_FRONT_SHARE,
    )  # fmt: skip


def _asked_fronts(scene: Scene) -> list[tuple[Front, float]]:
    """Find fronts at which the scene asks for factors, each with the radius that elements must fit.

    The spacing of the smallest domain, unless a hat along the front would lie between their nodes.
    A hat is two spacings wide, of which a quarter is left for nodes that are not evenly spaced.
    """
    asked = [q for q in scene.quantities if isinstance(q, FractureQuantity) and q.point is not None]
    found = [front_at(scene, one) for one in asked]
    return [
        (front, min(float(radii.min()), 1.5 * station_spacing(front) / _FRONT_SHARE))
        for front, radii in found
        if radii.min() > 0.0
    ]


def _way(scene: Scene, size: float) -> float | None:
    """Compute the size of elements along what a blade cuts on its way, m; None if none does."""
    on_its_way = any(cut.on_the_way for cut in scene.cuts)
    return size * _WAY[scene.dimension] if on_its_way else None


def _background(scene: Scene, level: int) -> tuple[Array, Cells]:
    """Make the scene's own mesh of a level without its cuts."""
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        return read_mesh(scene, level)
    counts, size = structure(scene, level)
    if counts is None:
        assert isinstance(geometry, Rectangle | Polygon)
        return background_mesh(geometry.outline(), size)
    if isinstance(geometry, Box):
        mesh = structured_tetrahedra(geometry.lower, geometry.upper, tuple(counts))
    else:
        assert isinstance(geometry, Rectangle)
        n, m = counts
        mesh = structured_triangles(geometry.lower, geometry.upper, (n, m))
    return moved_mesh(*mesh, counts, scene.mesh.position)


def _realised(scene: Scene, level: int) -> Realised | None:
    """Imprint cuts that are triangles which fit the scene's own mesh, or give None."""
    triangles = [
        c.points for c in scene.final_cuts if isinstance(c, PolygonCut) and len(c.points) == 3
    ]
    given = isinstance(scene.geometry, MeshFile) or structure(scene, level)[0] is not None
    membrane = scene.cell_dimension < scene.dimension
    if membrane or not given or not triangles or len(triangles) < len(scene.final_cuts):
        return None
    try:
        found = imprint_facets(*_background(scene, level), np.array(triangles, dtype=float))
    except InputError:  # they reach beyond the body
        return None
    return found if found.fitted else None


def _imprinted(scene: Scene, level: int) -> tuple[Array, Cells, Cells]:
    """Imprint the cuts of the scene on its background mesh of a level."""
    if (realised := _realised(scene, level)) is not None:
        return realised[:3]
    points, cells = _background(scene, level)
    if scene.dimension == 2:
        return imprint(
            points, cells, [c.vertices() for c in scene.final_cuts if c.kind == "polyline"]
        )
    polygons = [p for cut in scene.final_cuts for p in _polygons(cut)]
    return imprint_polygons(points, cells, polygons)


def _polygons(cut: Cut) -> list[Array]:
    """Return plane parts of a cut in space."""
    if isinstance(cut, PolygonCut):
        return [np.array(cut.points, dtype=float)]
    assert isinstance(cut, SweptCut)
    along = np.array(cut.along, dtype=float)
    return [np.stack([a, b, b + along, a + along]) for a, b in pairwise(np.array(cut.points))]
