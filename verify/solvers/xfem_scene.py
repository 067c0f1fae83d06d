"""The body of a scene in the terms of the compact XFEM solver: mesh, elasticity, density."""

import numpy as np

from verify.errors import InputError
from verify.scene import Box, MeshFile, Polygon, Rectangle, Scene, read_mesh
from verify.xfem.elasticity import Material, State, isotropic
from verify.xfem.mesh import SimplexMesh
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh

__all__ = ["background_mesh", "density_of", "material_of"]


def background_mesh(scene: Scene, level: int) -> tuple[SimplexMesh, float]:
    """Make the uncut mesh of a level.

    Returns
    -------
    mesh : SimplexMesh
    size : float
        Its element size h: the longer side of a structured mesh's rectangles, the size asked for
        of an unstructured one, the mean edge of a given one, m.

    Raises
    ------
    InputError
        If a mesh file is bad, or gmsh is needed and not installed.
    """
    geometry = scene.geometry
    if isinstance(geometry, MeshFile):
        mesh = SimplexMesh(*read_mesh(scene))
        return mesh, float(np.linalg.norm(mesh.edge_vectors, axis=2).mean())
    if scene.mesh.pattern == "structured":
        assert isinstance(geometry, Rectangle | Box)
        sides = np.subtract(geometry.upper, geometry.lower)
        if scene.mesh.cells is not None:
            counts = np.array(scene.mesh.cells[level])
        else:
            # a size that divides the side up to round-off is that size
            counts = np.ceil(sides / _size(scene, level) * (1 - 1e-9)).astype(int)
        make = rectangle_mesh if isinstance(geometry, Rectangle) else box_mesh
        return make(counts.tolist(), geometry.lower, geometry.upper), float((sides / counts).max())
    try:
        from reference.meshing import background_mesh as unstructured
    except ImportError as error:
        raise InputError(
            f"mesh.pattern: 'unstructured' needs '{error.name}', which is not installed",
            str(scene.file or ""),
        ) from None
    size = _size(scene, level)
    assert isinstance(geometry, Rectangle | Polygon)
    points, cells = unstructured(geometry.outline(), size)
    return SimplexMesh(points, cells), size


def _size(scene: Scene, level: int) -> float:
    assert scene.mesh.sizes is not None
    return scene.mesh.sizes[level]


def material_of(scene: Scene) -> Material:
    """Return the elasticity of the scene; of a membrane times its thickness, in N/m."""
    states: dict[str | None, State] = {"strain": "plane strain", "stress": "plane stress"}
    state = states.get(scene.material.plane, "solid")
    thickness = scene.material.thickness
    if thickness is None:
        return isotropic(scene.material.young, scene.material.poisson, state)
    sheet = isotropic(scene.material.young, scene.material.poisson, "plane stress")
    return Material(thickness * sheet.lam, thickness * sheet.mu)


def density_of(scene: Scene) -> float:
    """Return the density in kg/m³; of a membrane times its thickness, in kg/m²."""
    assert scene.material.density is not None  # the scene has checked it
    return scene.material.density * (scene.material.thickness or 1.0)
