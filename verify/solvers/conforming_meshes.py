"""Meshes on which the FEniCSx side solves a scene: at equal h, and the reference's own levels."""

from typing import NamedTuple

import numpy as np

from reference.meshing import (
    ConformingMesh,
    Grading,
    background_mesh,
    conforming_mesh,
    imprint,
    open_cut,
    singular_points,
    structured_triangles,
)
from verify.scene import Box, Polygon, PolylineCut, Rectangle, Scene

__all__ = ["Structure", "graded_mesh", "peer_mesh", "structure"]


class Structure(NamedTuple):
    """A level of the scene's own meshes.

    Attributes
    ----------
    counts : tuple of int, optional
        Cells along each axis; None if unstructured.
    size : float
        Element size h, m.
    """

    counts: tuple[int, ...] | None
    size: float


def structure(scene: Scene, level: int) -> Structure:
    """Give the cell counts and the element size of a level of the scene."""
    geometry = scene.geometry
    if scene.mesh.pattern == "unstructured" or not isinstance(geometry, Rectangle | Box):
        assert scene.mesh.sizes is not None
        return Structure(None, scene.mesh.sizes[level])
    sides = np.subtract(geometry.upper, geometry.lower)
    if scene.mesh.cells is not None:
        counts = np.array(scene.mesh.cells[level])
    else:
        assert scene.mesh.sizes is not None
        counts = np.ceil(sides / scene.mesh.sizes[level] * (1 - 1e-9)).astype(int)
    return Structure(tuple(counts.tolist()), float((sides / counts).max()))


def peer_mesh(scene: Scene, level: int, mesh: str) -> ConformingMesh:
    """Make the mesh of a level, imprinted or remeshed, that is the peer of an unfitted one."""
    counts, size = structure(scene, level)
    plane = isinstance(scene.geometry, Rectangle | Polygon)
    straight = all(isinstance(cut, PolylineCut) for cut in scene.cuts)
    if plane and straight and mesh == "imprinted":
        return _imprinted(scene, counts, size)
    if counts is not None:
        # equal mean size: two equilateral triangles of this edge are a square of 1, and with it
        # HXT was measured to make six tetrahedra per cube of 1
        edge = np.sqrt(2 / np.sqrt(3)) if plane else 0.88
        sides = np.subtract(scene.geometry.upper, scene.geometry.lower)  # type: ignore[union-attr]
        size = float(np.prod(sides / counts) ** (1 / len(sides)) * edge)
    return conforming_mesh(scene, Grading(size, np.zeros((0, scene.dimension))))


def graded_mesh(scene: Scene, level: int) -> tuple[ConformingMesh, float]:
    """Make a level of the reference and give its size far from what is singular, m."""
    grading = _plane_grading(scene) if scene.dimension == 2 else _solid_grading(scene)
    grading = grading.halved(level)
    return conforming_mesh(scene, grading), grading.size


def _plane_grading(scene: Scene) -> Grading:
    x, y = scene.geometry.outline().T  # type: ignore[union-attr]
    extent = np.sqrt(0.5 * abs(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))
    size = scene.reference.size or extent / 12
    return Grading(size, singular_points(scene), extent / 2, strip=1.0)


def _solid_grading(scene: Scene) -> Grading:
    assert isinstance(scene.geometry, Box)
    sides = np.subtract(scene.geometry.upper, scene.geometry.lower)
    extent = float(np.prod(sides)) ** (1 / 3)
    size = scene.reference.size or extent / 4
    return Grading(size, np.zeros((0, 3)), extent / 2, exponent=2 / 3, curves=True)


def _imprinted(scene: Scene, counts: tuple[int, ...] | None, size: float) -> ConformingMesh:
    """Imprint the polylines of the scene on its background mesh, and open them."""
    geometry = scene.geometry
    assert isinstance(geometry, Rectangle | Polygon)
    if counts is None:
        points, cells = background_mesh(geometry.outline(), size)
    else:
        assert isinstance(geometry, Rectangle)
        points, cells = structured_triangles(geometry.lower, geometry.upper, (counts[0], counts[1]))
    polylines = [cut.vertices() for cut in scene.cuts if isinstance(cut, PolylineCut)]
    return open_cut(*imprint(points, cells, polylines))
