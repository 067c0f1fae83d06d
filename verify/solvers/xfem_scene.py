"""A scene in the terms of the compact XFEM solver: mesh, cuts, supports, loads as arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError
from verify.scene import (
    ArcCut,
    Box,
    Gravity,
    MeshFile,
    PolygonCut,
    PolylineCut,
    Rectangle,
    Scene,
    Traction,
    read_mesh,
)
from verify.scene.parts import on_part
from verify.xfem.cuts import Cut, ImplicitCut, PolygonPatch
from verify.xfem.elasticity import Material, State, isotropic
from verify.xfem.loads import Density, body_force, traction
from verify.xfem.mesh import SimplexMesh
from verify.xfem.polyline import Polyline
from verify.xfem.structured_meshes import box_mesh, rectangle_mesh
from verify.xfem.supports import Supports
from verify.xfem.virtual import VirtualMesh

__all__ = ["background_mesh", "cuts_of", "loads_of", "material_of", "supports_of"]

_ARC_SEGMENTS_PER_CELL = 8


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
    assert not isinstance(geometry, Box)
    points, cells = unstructured(geometry.outline(), size)
    return SimplexMesh(points, cells), size


def _size(scene: Scene, level: int) -> float:
    assert scene.mesh.sizes is not None
    return scene.mesh.sizes[level]


def cuts_of(scene: Scene, size: float) -> list[Cut]:
    """Return the cuts as the solver's own; an arc that ends is sampled finely against `size`."""
    return [_cut(cut, size) for cut in scene.cuts]


def _cut(cut: PolylineCut | ArcCut | PolygonCut, size: float) -> Cut:
    if isinstance(cut, PolygonCut):
        return PolygonPatch(cut.points)
    if isinstance(cut, ArcCut) and cut.sweep == 360.0:
        centre, radius = np.array(cut.centre), cut.radius
        return ImplicitCut(lambda points: radius - np.linalg.norm(points - centre, axis=1))
    vertices = cut.vertices(size / _ARC_SEGMENTS_PER_CELL)
    closed = bool(np.array_equal(vertices[0], vertices[-1]))
    return Polyline(vertices[:-1] if closed else vertices, closed)


def material_of(scene: Scene) -> Material:
    """Return the elasticity of the scene."""
    states: dict[str | None, State] = {"strain": "plane strain", "stress": "plane stress"}
    state = states.get(scene.material.plane, "solid")
    return isotropic(scene.material.young, scene.material.poisson, state)


def supports_of(scene: Scene, virtual: VirtualMesh, exact: Any) -> Supports:
    """Return the supports; a later one wins where two hold the same node.

    A field with jumps is taken at each unknown node on the side of its own material.
    """
    mesh = virtual.mesh
    boundary = _boundary_nodes(mesh)
    supports = Supports.none(virtual)
    for i, support in enumerate(scene.supports):
        key = f"supports[{i}].where"
        nodes = boundary[on_part(scene, support.where, mesh.points[boundary], key)]
        held = support.held(scene.dimension)
        if support.displacement == "exact":
            mark = np.zeros(len(mesh.points), dtype=bool)
            mark[nodes] = True
            at = np.flatnonzero(mark[virtual.node_parent])
            values = exact.displacement(virtual.node_points[at], virtual.node_piece_points[at])
        else:
            values = np.zeros(scene.dimension)
            values[list(held)] = support.displacement
        supports = supports.prescribe(virtual, nodes, values, held)
    return supports


def loads_of(scene: Scene, virtual: VirtualMesh, exact: Any) -> NDArray[np.float64]:
    """Return the consistent nodal forces (N, d) of all loads, N (per metre in 2D)."""
    load = np.zeros_like(virtual.node_points)
    for i, entry in enumerate(scene.loads):
        if isinstance(entry, Gravity):
            assert scene.material.density is not None  # the scene has checked it
            weight = scene.material.density * np.asarray(entry.acceleration)
            load += body_force(virtual, weight)
        elif isinstance(entry, Traction):
            facets = _facets_on(scene, virtual.mesh, entry.where, f"loads[{i}].where")
            load += _traction(virtual, facets, entry.traction, exact)
        elif entry.force == "exact":
            load += body_force(virtual, lambda points, sides: exact.body_force(points))
        else:
            load += body_force(virtual, entry.force)
    return load


def _traction(
    virtual: VirtualMesh, facets: NDArray[np.int64], given: Any, exact: Any
) -> NDArray[np.float64]:
    if given != "exact":
        return traction(virtual, facets, given)
    mesh = virtual.mesh
    normals = -mesh.gradients[facets[:, 0], facets[:, 1]]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    load = np.zeros_like(virtual.node_points)
    distinct, group = np.unique(np.round(normals, 12), axis=0, return_inverse=True)
    for k, normal in enumerate(distinct):
        load += traction(virtual, facets[group.ravel() == k], _stress_vector(exact, normal))
    return load


def _stress_vector(exact: Any, normal: NDArray[np.float64]) -> Density:
    def density(points: NDArray[np.float64], sides: NDArray[np.int8]) -> NDArray[np.float64]:
        vector: NDArray[np.float64] = np.einsum("qij,j->qi", exact.stress(points), normal)
        return vector

    return density


def _boundary_nodes(mesh: SimplexMesh) -> NDArray[np.int64]:
    cells, opposite = mesh.boundary_facets.T
    on_facet = np.ones((len(cells), mesh.dim + 1), dtype=bool)
    on_facet[np.arange(len(cells)), opposite] = False
    return np.unique(mesh.cells[cells][on_facet])


def _facets_on(scene: Scene, mesh: SimplexMesh, where: str, key: str) -> NDArray[np.int64]:
    """Boundary facets whose nodes all lie on the part."""
    nodes = _boundary_nodes(mesh)
    mark = np.zeros(len(mesh.points), dtype=bool)
    mark[nodes[on_part(scene, where, mesh.points[nodes], key)]] = True
    facets = mesh.boundary_facets
    inside = mark[mesh.cells[facets[:, 0]]]
    inside[np.arange(len(facets)), facets[:, 1]] = True
    chosen = facets[inside.all(axis=1)]
    if not len(chosen):
        raise InputError(f"{key}: no boundary facet lies in '{where}'", str(scene.file or ""))
    return chosen
