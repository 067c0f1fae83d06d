"""Boundary of a mesh of a scene, and what acts there: loads, and supports of a body."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.errors import InputError, UnsupportedSceneError
from verify.geometry.simplices import measures
from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction, faces_of, is_uniform
from verify.scene.parts import (
    HeldFacets,
    Pieces,
    held_facets,
    held_nodes,
    no_node,
    pieces_on_part,
    points_apart,
    shifted_ends,
)
from verify.scene.physics import CLOSE, Load, PrescribedMotion, first_factor
from verify.solution import Regularisation
from verify.solvers.body_of_scene import moduli_of
from verify.xfem.body import MovingSupports
from verify.xfem.loads_and_supports import (
    Supports,
    body_force,
    facet_parts,
    facet_places,
    simplex_rule,
    traction,
)
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
        return self.cells[cell][on_facet].reshape(len(cell), self.cells.shape[1] - 1)

    @cached_property
    def nodes(self) -> _Ints:
        """Nodes of the boundary, ascending."""
        return np.unique(self.corners)

    @cached_property
    def places(self) -> _Floats:
        """Corners (b, k, d) of each facet, m."""
        return self.points[self.corners]

    def loaded(self, scene: Scene, where: str, key: str) -> Pieces:
        """Find pieces of the facets that lie on the part `where` of a scene, on which a load acts.

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
        """Find nodes (h,) that a support on the part `where` holds, ascending, and by which facets.

        Raises
        ------
        InputError
            If there is none.
        """
        if scene.geometry.holds_inside(where):
            every = self.cells, self.points[self.cells]
            return held_nodes(scene, where, self.points, every, key)
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
        normals *= np.where(np.einsum("qc,qc->q", normals, outward) < 0.0, -1.0, 1.0)[:, None]
        return normals / np.linalg.norm(normals, axis=1)[:, None]


def no_facet(scene: Scene, where: str, key: str) -> InputError:
    """Compute the error of a load on a part of no area."""
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
        """Compute value (d,) that holds everywhere, or values (m, d) by cell; None if neither does.

        Only the weight differs by cell, where materials do: by that at the centroids (m, d).
        """
        if isinstance(self.load, Gravity):
            density = moduli_of(self.scene, centroids)[2]
            return np.multiply.outer(density, np.asarray(self.load.acceleration))
        given = self.load.traction if isinstance(self.load, Traction) else self.load.force
        return np.asarray(given, dtype=float) if is_uniform(given) else None

    def at(
        self, points: _Floats, near: _Floats | None = None, normals: _Floats | None = None
    ) -> _Floats:
        """Return values (q, d) at points (q, d).

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
    each = (forces_of(scene, i, phantom, exact) for i in range(len(scene.loads)))
    return sum(each, np.zeros_like(phantom.node_points))


def is_moving(load: Load, exact: Any) -> bool:
    """Tell whether a load is another field at every time, apart from the factor of its history."""
    if isinstance(load, Gravity):
        return False
    return bool(load.timed or (load.exact and exact.moves))


def forces_of(scene: Scene, i: int, phantom: PhantomMesh, exact: Any, time: float = 0.0) -> _Floats:
    """Return the nodal forces (N, d) of a load at a time, without the factor of its history, N.

    Forces of a membrane are times its thickness: per volume and per area they stay the same.
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
    """Sum nodal forces (N, d); an exact field acts on facets of one direction at a time."""
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
    """Compute nodal forces (N, d) of load i, on faces of a cut as realised, N (per metre in 2D).

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
    faces = _faces(body)
    area, corners = measures(faces.places), faces.places
    place = next(k for k, cut in enumerate(scene.cuts) if cut.name == load.cut)
    found = faces_of(scene.cuts, corners.mean(axis=1))
    mine = np.flatnonzero(found.cut == place)
    if not len(mine) and scene.analysis.kind == "static":
        raise UnsupportedSceneError(f"{key}: cut '{load.cut}' as realised has no faces to bear it")
    mine = mine[area[mine] > 0.0]
    corners, nodes, normals = corners[mine], faces.corners[mine], found.normal[mine]
    outward, area, d = faces.outward_normals(mine), area[mine], scene.dimension
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


def _faces(body: Subdivision) -> Boundary:
    """Find facets that lie on another one."""
    facets = np.indices(body.cells.shape).reshape(2, -1).T
    alone = facets[_times(Boundary(body.points, body.cells, facets).corners) == 1]
    _, place = np.unique(body.points, axis=0, return_inverse=True)
    corners = Boundary(body.points, body.cells, alone).corners
    return Boundary(body.points, body.cells, alone[_times(place.ravel()[corners]) == 2])


def _times(rows: _Ints) -> _Ints:
    """Tell how often (n,) each row of (n, k) numbers occurs, in whatever order its numbers are."""
    rows = np.sort(rows, axis=1)
    _, which, count = np.unique(rows, axis=0, return_inverse=True, return_counts=True)
    return np.asarray(count[which.ravel()])


# Of a facet, beside a curved cut: so far the realised cut may be off. Chords of arcs of a radius
# above two diameters D of the elements lie within D/16, and meet the facet at 39° or more.
_BESIDE = 0.1


@dataclass(frozen=True)
class _Held(PrescribedMotion):
    """Motion that a support prescribes, and of which unknowns (k,) and components."""

    unknowns: _Ints
    components: tuple[int, ...]


def supports_of(scene: Scene, phantom: PhantomMesh, exact: Any) -> Supports:
    """Return the supports of a static scene; a later one wins where two hold the same node.

    A field with jumps is taken at each dof node on the side of its own material.
    """
    return path_of_supports(scene, phantom, exact)(1.0)


def path_of_supports(scene: Scene, phantom: PhantomMesh, exact: Any) -> Callable[[float], Supports]:
    """Return supports at a share of the path to equilibrium: of displacements and angles.

    At its end they have the first factor of their history, which is 1 in a static scene.
    """
    held = _held(scene, phantom, exact)
    factors = [first_factor(one.support.history) for one in held]

    def at(share: float) -> Supports:
        values = [one.values(share * f) for one, f in zip(held, factors, strict=True)]
        return Supports(*_filled(phantom, held, values))

    return at


def motion_of_supports(scene: Scene, phantom: PhantomMesh, exact: Any) -> Supports | MovingSupports:
    """Return supports of a dynamic scene: moving ones if one changes in time."""
    held = _held(scene, phantom, exact)
    fixed, values = _filled(phantom, held, [one.values(1.0) for one in held])
    if not any(one.moves for one in held):
        return Supports(fixed, values)

    def motion(time: float) -> tuple[_Floats, _Floats]:
        before = time > held[0].close  # at the end of a step; a motion starts after what jumps
        where = [one.at(time, before) for one in held]
        speed = [one.velocities(time, before) for one in held]
        return _filled(phantom, held, where)[1], _filled(phantom, held, speed)[1]

    def acceleration(time: float) -> _Floats:
        duration = scene.analysis.duration
        assert duration is not None
        return _filled(phantom, held, [one.accelerations(time, duration) for one in held])[1]

    def after(time: float) -> _Floats:
        return _filled(phantom, held, [one.velocities(time) for one in held])[1]

    return MovingSupports(fixed, motion, acceleration, after)


def _filled(
    phantom: PhantomMesh, held: list[_Held], values: list[_Floats]
) -> tuple[NDArray[np.bool_], _Floats]:
    fixed = np.zeros(phantom.node_points.shape, dtype=bool)
    filled = np.zeros(phantom.node_points.shape)
    for one, value in zip(held, values, strict=True):
        place = np.ix_(one.unknowns, one.components)
        fixed[place], filled[place] = True, value
    return fixed, filled


def support_ends(scene: Scene, phantom: PhantomMesh, size: float) -> list[Regularisation]:
    """Report where supports hold more than their parts; `size` is the element size, m."""
    parts = _boundary_parts(phantom)
    ended = [s.where for s in scene.supports if not scene.geometry.holds_inside(s.where)]
    return shifted_ends([_held_parts(scene, where, parts) for where in ended], size)


def _held(scene: Scene, phantom: PhantomMesh, exact: Any) -> list[_Held]:
    """Find what each support holds.

    A facet that a cut crosses is held on each side for itself, by the unknowns that move that side.
    So a part may end at a cut, and a cut close to a support frees the material behind it. Where a
    part is a mere point or line, it holds the unknowns whose material reaches there.
    """
    mesh, parts, corners = phantom.mesh, _boundary_parts(phantom), _own_corners(phantom)
    own = np.flatnonzero(corners & np.isin(phantom.node_parent, parts.boundary.nodes))
    close, found = CLOSE * (scene.analysis.duration or 0.0), []
    for i, support in enumerate(scene.supports):
        mark = np.zeros(phantom.node_count, dtype=bool)
        if scene.geometry.holds_inside(support.where):
            cells = held_facets(scene.geometry, support.where, mesh.points[mesh.cells]).held
            unknowns = phantom.corner_node[phantom.cells[cells[phantom.parent]]]
            asked = np.flatnonzero(corners)
        else:
            unknowns = parts.unknowns[_held_parts(scene, support.where, parts).held]
            asked = own
        mark[unknowns[unknowns >= 0]] = True
        mark[asked] |= points_apart(scene, support.where, phantom.node_points[asked], mark[asked])
        at = np.flatnonzero(mark)
        if not len(at):
            raise no_node(scene, support.where, f"supports[{i}].where")
        components = support.held(scene.dimension)
        field = exact if support.displacement == "exact" else None
        points, near = phantom.node_points[at], phantom.node_piece_points[at]
        found.append(_Held(support, points, near, field, at, components, close=close))
    return found


def _held_parts(scene: Scene, where: str, parts: "_BoundaryParts") -> HeldFacets:
    # whether linear level sets realise all cuts as they are asked
    straight = all(cut.faceted and cut.plane_normal is not None for cut in scene.cuts)
    depth = None if straight else _BESIDE * parts.diameter
    return held_facets(
        scene.geometry, where, parts.corners, parts.boundary.places, parts.facet, depth
    )


@dataclass(frozen=True)
class _BoundaryParts:
    """Boundary facets, those that are cut as simplices on either side.

    Attributes
    ----------
    boundary : Boundary
        Of the uncut mesh.
    corners : (q, d, space) array
        Places of the corners of the simplices, m.
    facet : (q,) int array
        Number of the facet of each, on its side of the cuts.
    unknowns : (q, d) int array
        Dof nodes at the nodes of the facet that move that side; −1 where one follows a root cell.
    diameter : (q,) array
        Of the facet, m; 0 where no cut divides it.
    """

    boundary: Boundary
    corners: _Floats
    facet: _Ints
    unknowns: _Ints
    diameter: _Floats


def _boundary_parts(phantom: PhantomMesh) -> _BoundaryParts:
    mesh = phantom.mesh
    corners, facet, unknowns, diameter = [], [], [], []
    for local in range(mesh.dim + 1):
        cells = mesh.boundary_facets[mesh.boundary_facets[:, 1] == local, 0]
        piece, barycentric, _ = facet_parts(phantom, cells, local)
        corners.append(facet_places(phantom, piece, barycentric))
        facet.append(piece * (mesh.dim + 1) + local)
        rest = [k for k in range(mesh.dim + 1) if k != local]
        unknowns.append(phantom.corner_node[phantom.cells[piece][:, rest]])
        nodes = mesh.points[mesh.cells[phantom.parent[piece]][:, rest]]
        longest = np.linalg.norm(nodes - np.roll(nodes, 1, axis=1), axis=2).max(axis=1)
        sides = phantom.parent[np.unique(piece)]
        divided = np.bincount(sides, minlength=len(mesh.cells))[phantom.parent[piece]] > 1
        diameter.append(np.where(divided, longest, 0.0))
    _, number = np.unique(np.concatenate(facet), return_inverse=True)
    return _BoundaryParts(
        Boundary(mesh.points, mesh.cells, mesh.boundary_facets),
        np.concatenate(corners), number.ravel(), np.concatenate(unknowns),
        np.concatenate(diameter),
    )  # fmt: skip


def _own_corners(phantom: PhantomMesh) -> NDArray[np.bool_]:
    """Tell whether the node of an unknown (N,) lies in the material that the unknown moves.

    Behind a cut it does not: the unknown belongs to a node that is beyond.
    """
    piece, barycentric, _ = phantom.solid_simplices
    own = np.zeros(phantom.corners.node_count, dtype=bool)
    simplex, vertex = np.nonzero(barycentric.max(axis=2) == 1.0)
    own[phantom.cells[piece[simplex], barycentric[simplex, vertex].argmax(axis=1)]] = True
    return own[phantom.node_corner]
