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
from verify.solvers.xfem_boundary import boundary_nodes, facet_parts, own_corners
from verify.xfem.body import MovingSupports
from verify.xfem.phantom import PhantomMesh
from verify.xfem.supports import Supports

__all__ = ["initial_path", "motion_of_supports", "path_of_supports", "supports_of"]

_Floats = NDArray[np.float64]


@dataclass(frozen=True)
class _Held(PrescribedMotion):
    """Motion that a support prescribes, and of which unknowns (k,) and components."""

    unknowns: NDArray[np.int64]
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
    unknowns, parts = facet_parts(phantom)
    at_node = own_corners(phantom)
    outer = np.zeros(len(mesh.points), dtype=bool)
    outer[boundary_nodes(mesh)] = True
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
