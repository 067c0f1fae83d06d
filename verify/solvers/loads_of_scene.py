"""Boundary of a mesh of a scene, and the loads: densities at points, and nodal forces of a body."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction, faces_of, is_uniform
from verify.scene.parts import HeldFacets, Pieces, held_nodes, pieces_on_part
from verify.scene.physics import Load
from verify.solvers.body_of_scene import volumetric_mass
from verify.xfem.loads import body_force, simplex_rule, traction
from verify.xfem.phantom import PhantomMesh
from verify.xfem.subdivision import Subdivision, subdivide

_Ints = NDArray[np.int64]
_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Boundary:
    """Facets on the boundary of a body, of any mesh of simplices.

    Attributes
    ----------
    points : (n, d) array
        Nodes of the mesh, m.
    cells : (m, k + 1) int array
        Of k = d dimensions, or of a membrane k = d − 1.
    facets : (b, 2) int array
        Cell and opposite local node of each facet.
    """

    points: _Floats
    cells: _Ints
    facets: _Ints

    @cached_property
    def corners(self) -> _Ints:
        """Nodes (b, k) of each facet."""
        cell, opposite = self.facets.T
        on_facet = np.ones((len(cell), self.cells.shape[1]), dtype=bool)
        on_facet[np.arange(len(cell)), opposite] = False
        corners: _Ints = self.cells[cell][on_facet].reshape(len(cell), -1)
        return corners

    @cached_property
    def nodes(self) -> _Ints:
        """Nodes of the boundary, ascending."""
        return np.unique(self.corners)

    @cached_property
    def places(self) -> _Floats:
        """Corners (b, k, d) of each facet, m."""
        places: _Floats = self.points[self.corners]
        return places

    def loaded(self, scene: Scene, where: str, key: str) -> Pieces:
        """Pieces of the facets that lie on the part `where` of a scene, on which a load acts.

        Raises
        ------
        InputError
            If there is none; `key` is the key of the scene that names the part.
        """
        pieces = pieces_on_part(scene.geometry, where, self.places)
        if not len(pieces.facet):
            raise no_facet(scene, where, key)
        return pieces

    def held(self, scene: Scene, where: str, key: str) -> tuple[_Ints, HeldFacets]:
        """Nodes (h,) that a support on the part `where` holds, ascending, and by which facets.

        Raises
        ------
        InputError
            If there is none.
        """
        facets = np.searchsorted(self.nodes, self.corners), self.places
        found, by = held_nodes(scene, where, self.points[self.nodes], facets, key)
        return self.nodes[found], by

    def outward_normals(self, chosen: _Ints) -> _Floats:
        """Return the unit normals (q, d) of some facets (q,); of a membrane's edge in its plane."""
        corners, (cell, opposite) = self.points[self.corners[chosen]], self.facets[chosen].T
        outward = corners[:, 0] - self.points[self.cells[cell, opposite]]
        edges = corners[:, 1:] - corners[:, :1]
        if self.points.shape[1] == 2:
            normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
        elif self.cells.shape[1] == 4:
            normals = np.cross(edges[:, 0], edges[:, 1])
        else:
            normals = np.cross(edges[:, 0], np.cross(edges[:, 0], outward))
        normals *= np.sign(np.einsum("qc,qc->q", normals, outward))[:, None]
        unit: _Floats = normals / np.linalg.norm(normals, axis=1)[:, None]
        return unit


def no_facet(scene: Scene, where: str, key: str) -> InputError:
    """Error of a load on a part of no area."""
    return InputError(f"{key}: no boundary facet lies in '{where}'", str(scene.file or ""))


_DEGREE = 4  # of a load on a cut's faces times the shape functions, integrated exactly


@dataclass(frozen=True)
class ForceDensity:
    """Force per volume (N/m³) or per area (Pa) of a load at a time, without its history's factor.

    Attributes
    ----------
    scene : Scene
    load : BodyForce, Traction or Gravity
    exact : object or None
        The exact solution at that time.
    time : float
        In s.
    """

    scene: Scene
    load: BodyForce | Traction | Gravity
    exact: Any = None
    time: float = 0.0

    def uniform(self, centroids: _Floats) -> _Floats | None:
        """Value (d,) that holds everywhere, or values (m, d) by cell; None if neither does.

        Only the weight differs by cell, where materials do: by that at the centroids (m, d).
        """
        if isinstance(self.load, Gravity):
            density = volumetric_mass(self.scene, centroids)
            return np.multiply.outer(density, np.asarray(self.load.acceleration))
        given = self.load.traction if isinstance(self.load, Traction) else self.load.force
        return np.asarray(given, dtype=float) if is_uniform(given) else None

    def at(
        self, points: _Floats, near: _Floats | None = None, normals: _Floats | None = None
    ) -> _Floats:
        """Values (q, d) at points (q, d).

        Parameters
        ----------
        points : (q, d) array
            m.
        near : (q, d) array, optional
            Points of the material, which say on which side of a cut the points are; default: on
            their own.
        normals : (q, d) array, optional
            Outward, for the traction of an exact solution.
        """
        assert not isinstance(self.load, Gravity)
        if not self.load.exact:
            return np.asarray(self.load.values(points, self.time))
        if isinstance(self.load, Traction):
            assert normals is not None
            return np.einsum("qij,qj->qi", self.exact.stress(points, near), normals)
        return np.asarray(self.exact.body_force(points, near))


def loads_of(scene: Scene, phantom: PhantomMesh, exact: Any) -> _Floats:
    """Return the consistent nodal forces (N, d) of all loads, N (per metre in 2D)."""
    total = np.zeros_like(phantom.node_points)
    for i in range(len(scene.loads)):
        total += forces_of(scene, i, phantom, exact)
    return total


def is_moving(load: Load, exact: Any) -> bool:
    """Whether a load is another field at every time, apart from the factor of its history."""
    if isinstance(load, Gravity):
        return False
    return bool(load.timed or (load.exact and exact.moves))


def forces_of(scene: Scene, i: int, phantom: PhantomMesh, exact: Any, time: float = 0.0) -> _Floats:
    """Return the nodal forces (N, d) of a load at a time, without the factor of its history, N.

    Those of a membrane are times its thickness: forces per volume and per area stay what they
    are.
    """
    entry = scene.loads[i]
    if isinstance(entry, CutFaces):
        forces = _face_forces(scene, phantom, i, time)
    else:
        density = ForceDensity(scene, entry, None if exact is None else exact.at(time), time)
        if isinstance(entry, Traction):
            forces = _traction(phantom, density, f"loads[{i}].where")
        else:
            mesh = phantom.mesh
            uniform = density.uniform(mesh.points[mesh.cells].mean(axis=1))
            given: Any = uniform if uniform is not None else _of_points(density)
            forces = body_force(phantom, given)
    return np.asarray((scene.material.thickness or 1.0) * forces)


def _traction(phantom: PhantomMesh, density: ForceDensity, key: str) -> _Floats:
    """Nodal forces (N, d); those of an exact field by facets of one direction after the other."""
    load, mesh = density.load, phantom.mesh
    assert isinstance(load, Traction)
    boundary = Boundary(mesh.points, mesh.cells, mesh.boundary_facets)
    found = 0

    def loaded(corners: _Floats) -> tuple[_Ints, _Floats]:
        nonlocal found
        pieces = pieces_on_part(density.scene.geometry, load.where, corners, boundary.places)
        found += len(pieces.facet)
        return pieces.facet, pieces.barycentric

    if load.exact:
        normals = boundary.outward_normals(np.arange(len(boundary.facets)))
        distinct, group = np.unique(np.round(normals, 12), axis=0, return_inverse=True)
        forces = np.zeros_like(phantom.node_points)
        for k, normal in enumerate(distinct):
            facets = boundary.facets[group.ravel() == k]
            forces += traction(phantom, facets, _of_points(density, normal), loaded=loaded)
    else:
        given: Any = load.traction if is_uniform(load.traction) else _of_points(density)
        forces = traction(phantom, boundary.facets, given, loaded=loaded)
    if not found:
        raise no_facet(density.scene, load.where, key)
    return forces


def _of_points(density: ForceDensity, normal: _Floats | None = None) -> Any:
    """Return the density as the library takes it: of points and their sides, on one direction."""

    def at(points: _Floats, sides: NDArray[np.int8]) -> _Floats:
        normals = None if normal is None else np.broadcast_to(normal, points.shape)
        return density.at(points, normals=normals)

    return at


def _face_forces(scene: Scene, phantom: PhantomMesh, i: int, time: float) -> _Floats:
    """Nodal forces (N, d) of load i, on the faces of a cut as realised, N (per metre in 2D).

    The faces are facets of the conforming sub-division on which the field is linear, so that the
    forces are the exact work of the load. A cut that is still closed in a motion bears none.

    Raises
    ------
    UnsupportedSceneError
        If the cut has no two faces that lie on each other: the method removed the material there,
        or opened nothing.
    """
    load, key = scene.loads[i], f"loads[{i}]"
    assert isinstance(load, CutFaces)
    body = subdivide(phantom)
    facets, outward = _faces(body)
    corners = body.points[facets]
    place = next(k for k, cut in enumerate(scene.cuts) if cut.name == load.cut)
    found = faces_of(scene.cuts, corners.mean(axis=1))
    mine = found.cut == place
    if not mine.any() and scene.analysis.kind == "static":
        raise UnsupportedSceneError(f"{key}: cut '{load.cut}' as realised has no faces to bear it")
    corners, nodes, normals = corners[mine], facets[mine], found.normal[mine]
    length = np.linalg.norm(outward[mine], axis=1)
    outward = outward[mine] / np.where(length > 0.0, length, 1.0)[:, None]
    area, d = length / (scene.dimension - 1), scene.dimension
    forces = np.zeros(body.points.shape)
    for shares, weight in zip(*simplex_rule(d - 1, _DEGREE), strict=True):
        points = np.einsum("i,kij->kj", shares, corners)
        try:
            traction = load.on_faces(points, outward, normals, time)
        except InputError as error:
            raise InputError(f"{key}: {error}", str(scene.file or "")) from None
        given = (weight * area)[:, None] * traction
        np.add.at(forces, nodes, shares[None, :, None] * given[:, None, :])
    return np.asarray(body.interpolation.T @ forces)


def _faces(body: Subdivision) -> tuple[_Ints, _Floats]:
    """Nodes (k, d) of the facets that lie on another one, and their normals out of the material.

    The normals are as long as the facets are large, times d − 1.
    """
    count = body.cells.shape[1]
    rest = [[j for j in range(count) if j != k] for k in range(count)]
    nodes = body.cells[:, rest].reshape(-1, count - 1)
    beyond = body.points[body.cells.ravel()]
    _, place = np.unique(body.points, axis=0, return_inverse=True)
    alone = _times(nodes) == 1
    nodes, beyond = nodes[alone], beyond[alone]
    twin = _times(place.ravel()[nodes]) == 2
    nodes, beyond = nodes[twin], beyond[twin]
    corners = body.points[nodes]
    edges = corners[:, 1:] - corners[:, :1]
    if count == 3:
        normals = np.column_stack([edges[:, 0, 1], -edges[:, 0, 0]])
    else:
        normals = np.cross(edges[:, 0], edges[:, 1])
    inward = np.sum(normals * (beyond - corners[:, 0]), axis=1) > 0.0
    normals[inward] *= -1.0
    return nodes, normals


def _times(rows: _Ints) -> _Ints:
    """How often (n,) each row of (n, k) numbers occurs, in whatever order its numbers are."""
    rows = np.sort(rows, axis=1)
    _, which, count = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[which.ravel()])
