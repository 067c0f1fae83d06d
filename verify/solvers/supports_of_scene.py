"""Supports of a scene on the unknowns of a cut body, each on its own side of the cuts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene
from verify.scene.parts import HeldFacets, held_facets, no_node, points_apart, shifted_ends
from verify.scene.physics import PrescribedMotion, factor_at, first_factor
from verify.solution import Regularisation
from verify.solvers.loads_of_scene import Boundary
from verify.xfem.body import MovingSupports
from verify.xfem.loads import facet_parts, facet_places
from verify.xfem.phantom import PhantomMesh
from verify.xfem.supports import Supports

# Of a facet, beside a curved cut: so far the realised cut may be off. Chords of arcs of a radius
# above two diameters D of the elements lie within D/16, and meet the facet at 39° or more.
_BESIDE = 0.1
_Floats = NDArray[np.float64]
_Ints = NDArray[np.int64]


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
    """Supports at a share of the path to equilibrium: of displacements and angles.

    At its end they have the first factor of their history, which is 1 in a static scene.
    """
    held = _held(scene, phantom, exact)
    factors = [first_factor(one.support.history) for one in held]

    def at(share: float) -> Supports:
        values = [one.values(share * f) for one, f in zip(held, factors, strict=True)]
        return Supports(*_filled(phantom, held, values))

    return at


def motion_of_supports(scene: Scene, phantom: PhantomMesh, exact: Any) -> Supports | MovingSupports:
    """Supports of a dynamic scene: moving ones if one changes in time."""
    held = _held(scene, phantom, exact)
    fixed, values = _filled(phantom, held, [one.values(1.0) for one in held])
    if not any(one.moves for one in held):
        return Supports(fixed, values)

    def motion(time: float) -> tuple[_Floats, _Floats]:
        where = [one.values(factor_at(one.support.history, time), time) for one in held]
        speed = [one.velocities(time) for one in held]
        return _filled(phantom, held, where)[1], _filled(phantom, held, speed)[1]

    return MovingSupports(fixed, motion)


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
    """Report where supports hold more than their parts; `size` is that of the elements, m."""
    parts = _boundary_parts(phantom)
    return shifted_ends([_held_parts(scene, s.where, parts) for s in scene.supports], size)


def _held(scene: Scene, phantom: PhantomMesh, exact: Any) -> list[_Held]:
    """Find what each support holds.

    A facet that a cut crosses is held on each side for itself, by the unknowns that move that side.
    So a part may end at a cut, and a cut close to a support frees what is behind it. Where a part
    is a mere point or line, it holds the unknowns whose material reaches there.
    """
    parts, corners = _boundary_parts(phantom), _own_corners(phantom)
    own = np.flatnonzero(corners & np.isin(phantom.node_parent, parts.boundary.nodes))
    found = []
    for i, support in enumerate(scene.supports):
        mark = np.zeros(phantom.node_count, dtype=bool)
        unknowns = parts.unknowns[_held_parts(scene, support.where, parts).held]
        mark[unknowns[unknowns >= 0]] = True
        mark[own] |= points_apart(scene, support.where, phantom.node_points[own], mark[own])
        at = np.flatnonzero(mark)
        if not len(at):
            raise no_node(scene, support.where, f"supports[{i}].where")
        components = support.held(scene.dimension)
        field = exact if support.displacement == "exact" else None
        points, near = phantom.node_points[at], phantom.node_piece_points[at]
        found.append(_Held(support, points, near, field, at, components))
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
        sides = np.unique(np.column_stack([phantom.parent[piece], piece]), axis=0)[:, 0]
        divided = np.bincount(sides, minlength=len(mesh.cells))[phantom.parent[piece]] > 1
        diameter.append(np.where(divided, longest, 0.0))
    _, number = np.unique(np.concatenate(facet), return_inverse=True)
    return _BoundaryParts(
        Boundary(mesh.points, mesh.cells, mesh.boundary_facets),
        np.concatenate(corners), number.ravel(), np.concatenate(unknowns),
        np.concatenate(diameter),
    )  # fmt: skip


def _own_corners(phantom: PhantomMesh) -> NDArray[np.bool_]:
    """(N,) whether the node of an unknown lies in the material that the unknown moves.

    Behind a cut it does not: the unknown belongs to a node that is beyond.
    """
    piece, barycentric, _ = phantom.solid_simplices
    own = np.zeros(phantom.corners.node_count, dtype=bool)
    simplex, vertex = np.nonzero(barycentric.max(axis=2) == 1.0)
    own[phantom.cells[piece[simplex], barycentric[simplex, vertex].argmax(axis=1)]] = True
    return own[phantom.node_corner]
