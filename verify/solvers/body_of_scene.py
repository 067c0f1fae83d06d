"""Body of a scene as arrays: background mesh, elasticity, density."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import (
    Box,
    MeshFile,
    Polygon,
    Rectangle,
    Scene,
    read_mesh,
)
from verify.solvers.runs import grid_of
from verify.xfem.elasticity import Material, State, isotropic
from verify.xfem.errors import XfemError
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh


def background_mesh(scene: Scene, level: int) -> tuple[SimplexMesh, float]:
    """Make the uncut mesh of a level.

    Returns
    -------
    mesh : SimplexMesh
    size : float
        Its element size h: the longer side of a structured mesh's rectangles, the size asked for
        of an unstructured one, the mean edge of a given one over 2^level, m.

    Raises
    ------
    InputError
        If there is no such level, a mesh file is bad, or gmsh is needed and not installed.
    """
    if not 0 <= level < scene.mesh.count:
        raise InputError(f"mesh level {level}; expected 0..{scene.mesh.count - 1}")
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        mesh = SimplexMesh(*read_mesh(scene))
        size = float(np.linalg.norm(mesh.edge_vectors, axis=2).mean()) / 2**level
        return SimplexMesh(*read_mesh(scene, level)) if level else mesh, size
    counts, size = grid_of(scene, level)
    if counts is not None:
        assert isinstance(geometry, Rectangle | Box)
        make = rectangle_mesh if isinstance(geometry, Rectangle) else box_mesh
        return make(counts, geometry.lower, geometry.upper), size
    try:
        from reference.meshing import background_mesh as unstructured
    except ImportError as error:
        raise InputError(
            f"mesh.pattern: 'unstructured' needs '{error.name}', which is not installed",
            str(scene.file or ""),
        ) from None
    assert isinstance(geometry, Rectangle | Polygon)
    points, cells = unstructured(geometry.outline(), size)
    return SimplexMesh(points, cells), size


def material_of(scene: Scene, mesh: SimplexMesh) -> Material:
    """Return the elasticity of the scene; of a membrane times its thickness, in N/m.

    Where materials differ by region, a cell of the mesh is of that at its centroid.
    """
    states: dict[str | None, State] = {"strain": "plane strain", "stress": "plane stress"}
    state = states.get(scene.material.plane, "solid")
    young, poisson, _ = _moduli(scene, mesh.points[mesh.cells].mean(axis=1))
    thickness = scene.material.thickness
    if thickness is None:
        return isotropic(young, poisson, state)
    sheet = isotropic(young, poisson, "plane stress")
    return Material(thickness * sheet.lam, thickness * sheet.mu)


def density_of(scene: Scene, mesh: SimplexMesh) -> float | NDArray[np.float64]:
    """Return the density in kg/m³; of a membrane times its thickness, in kg/m².

    One number, or one for each cell (m,) where materials differ by region.
    """
    density = volumetric_mass(scene, mesh.points[mesh.cells].mean(axis=1))
    return density * (scene.material.thickness or 1.0)


def volumetric_mass(scene: Scene, points: NDArray[np.float64]) -> Any:
    """Return the density in kg/m³: one number, or (n,) at points where materials differ."""
    return _moduli(scene, points)[2]


def _moduli(scene: Scene, points: NDArray[np.float64]) -> Any:
    """Young's modulus, Poisson's ratio and density: numbers, or arrays (n,) at points."""
    material = scene.material
    if material.is_uniform:
        return material.young, material.poisson, material.density
    return material.at(points)


@contextmanager
def errors_of_scene(scene: Scene) -> Iterator[None]:
    """Turn errors of the library into those of a scene: `InputError`."""
    try:
        yield
    except XfemError as error:
        raise InputError(str(error), str(scene.file or scene.name)) from None
