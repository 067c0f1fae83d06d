"""Supports of a scene on the unknowns of a cut body, each on its own side of the cuts."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene import Scene
from verify.scene.history import factor_at, first_factor
from verify.scene.parts import copies_on_part, lie_on_part
from verify.scene.prescribed import PrescribedMotion
from verify.solvers.boundary_of_scene import Boundary
from verify.xfem.body import MovingSupports
from verify.xfem.phantom import PhantomMesh
from verify.xfem.supports import Supports

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
    """Supports at a share of the path of a static scene: of displacements and angles."""
    held = _held(scene, phantom, exact)
    return lambda share: Supports(*_filled(phantom, held, [one.values(share) for one in held]))


def initial_path(scene: Scene, phantom: PhantomMesh, exact: Any) -> Callable[[float], Supports]:
    """Supports at a share of the first factor of their history."""
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


def _held(scene: Scene, phantom: PhantomMesh, exact: Any) -> list[_Held]:
    """Find what each support holds.

    A node of the boundary is on a part by its place, and so is every unknown whose material
    reaches that node; where a cut runs through the node, each by the boundary of its own material.
    The other unknowns there belong to material beyond a cut: they are held if the boundary of
    *that* material is on the part. So a part may end at a cut, and a cut close to a support frees
    what is behind it.
    """
    mesh = phantom.mesh
    unknowns, parts = _facet_parts(phantom)
    at_node = _own_corners(phantom)
    outer = np.zeros(len(mesh.points), dtype=bool)
    outer[Boundary(mesh.points, mesh.cells, mesh.boundary_facets).nodes] = True
    own = np.flatnonzero(at_node & outer[phantom.node_parent])
    number = np.full(len(at_node), -1)
    number[own] = np.arange(len(own))
    beside = number[unknowns] >= 0
    own_parts = number[unknowns[beside]], parts[beside]
    beyond = ~at_node[unknowns]
    unknowns, parts = unknowns[beyond], parts[beyond]
    size = float(np.ptp(mesh.points, axis=0).max())
    found = []
    for i, support in enumerate(scene.supports):
        key = f"supports[{i}].where"
        mark = np.zeros(len(at_node), dtype=bool)
        places = phantom.node_points[own]
        mark[own[copies_on_part(scene, support.where, places, own_parts, key)]] = True
        mark[unknowns[lie_on_part(scene, support.where, parts, size)]] = True
        at = np.flatnonzero(mark)
        components = support.held(scene.dimension)
        field = exact if support.displacement == "exact" else None
        points, near = phantom.node_points[at], phantom.node_piece_points[at]
        found.append(_Held(support, points, near, field, at, components))
    return found


def _own_corners(phantom: PhantomMesh) -> NDArray[np.bool_]:
    """(N,) whether the node of an unknown lies in the material that the unknown moves.

    Behind a cut it does not: the unknown belongs to a node that is beyond.
    """
    piece, barycentric, _ = phantom.solid_simplices
    own = np.zeros(phantom.corners.node_count, dtype=bool)
    simplex, vertex = np.nonzero(barycentric.max(axis=2) == 1.0)
    own[phantom.cells[piece[simplex], barycentric[simplex, vertex].argmax(axis=1)]] = True
    return own[phantom.node_corner]


def _facet_parts(phantom: PhantomMesh) -> tuple[_Ints, _Floats]:
    """Boundary facets, of those that are cut the parts, each for every unknown that moves it.

    Returns
    -------
    unknowns : (k,) int array
        Dof nodes at the nodes of a facet, on the side of the part; nodes that follow a root
        cell have none.
    points : (k, space) array
        Centroid of the part, m.
    """
    mesh = phantom.mesh
    piece, in_cell, _ = phantom.solid_simplices
    facets = mesh.boundary_facets
    outer = np.zeros(len(mesh.cells), dtype=bool)
    outer[facets[:, 0]] = True
    mine = outer[phantom.parent[piece]]
    piece, cell, in_cell = piece[mine], phantom.parent[piece[mine]], in_cell[mine]
    unknowns, points = [], []
    corners = mesh.dim + 1
    for local in range(corners):
        wanted = np.zeros(len(mesh.cells), dtype=bool)
        wanted[facets[facets[:, 1] == local, 0]] = True
        here = np.flatnonzero(wanted[cell])
        rest = [k for k in range(corners) if k != local]
        for opposite in range(corners):
            side = [k for k in range(corners) if k != opposite]
            on_facet = here[(in_cell[here][:, side, local] == 0.0).all(axis=1)]
            middle = in_cell[on_facet][:, side].mean(axis=1)
            nodes = mesh.points[mesh.cells[cell[on_facet]]]
            centroid = np.einsum("ki,kij->kj", middle, nodes)
            unknowns.append(phantom.cells[piece[on_facet]][:, rest].ravel())
            points.append(np.repeat(centroid, mesh.dim, axis=0))
    node = phantom.corner_node[np.concatenate(unknowns)]
    return node[node >= 0], np.concatenate(points)[node >= 0]
