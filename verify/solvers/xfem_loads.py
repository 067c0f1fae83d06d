"""Loads of a scene as consistent nodal forces of a cut body."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.scene import BodyForce, Gravity, Scene, Traction, is_uniform
from verify.scene.physics import Load
from verify.solvers.xfem_boundary import facets_on
from verify.xfem.loads import Density, body_force, traction
from verify.xfem.virtual import VirtualMesh

__all__ = ["NodalForces", "loads_of", "nodal_forces"]

_Floats = NDArray[np.float64]


class NodalForces(NamedTuple):
    """A load of the scene and its nodal forces (N, d), N (per metre of thickness in 2D)."""

    load: Load
    forces: _Floats


def loads_of(scene: Scene, virtual: VirtualMesh, exact: Any) -> _Floats:
    """Return the consistent nodal forces (N, d) of all loads, N (per metre in 2D)."""
    total = np.zeros_like(virtual.node_points)
    for one in nodal_forces(scene, virtual, exact):
        total += one.forces
    return total


def nodal_forces(scene: Scene, virtual: VirtualMesh, exact: Any) -> list[NodalForces]:
    """Return the nodal forces of every load, in the order of the scene.

    Those of a membrane are times its thickness: forces per volume and per area stay what they
    are.
    """
    thickness = scene.material.thickness or 1.0
    found = []
    for i, entry in enumerate(scene.loads):
        if isinstance(entry, Gravity):
            assert scene.material.density is not None  # the scene has checked it
            weight = scene.material.density * np.asarray(entry.acceleration)
            forces = body_force(virtual, weight)
        elif isinstance(entry, Traction):
            facets = facets_on(scene, virtual.mesh, entry.where, f"loads[{i}].where")
            if entry.traction == "exact":
                forces = _stresses(virtual, facets, exact)
            else:
                forces = traction(virtual, facets, _density(entry, entry.traction))
        elif entry.force == "exact":
            forces = body_force(virtual, lambda points, sides: exact.body_force(points))
        else:
            forces = body_force(virtual, _density(entry, entry.force))
        found.append(NodalForces(entry, thickness * forces))
    return found


def _density(load: BodyForce | Traction, given: Any) -> Any:
    """Numbers as they are, which are integrated in closed form; formulas as a function."""
    return given if is_uniform(given) else lambda points, sides: load.values(points)


def _stresses(virtual: VirtualMesh, facets: NDArray[np.int64], exact: Any) -> _Floats:
    """Nodal forces (N, d) of the exact solution's stress vectors on facets."""
    mesh = virtual.mesh
    normals = -mesh.gradients[facets[:, 0], facets[:, 1]]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    load = np.zeros_like(virtual.node_points)
    distinct, group = np.unique(np.round(normals, 12), axis=0, return_inverse=True)
    for k, normal in enumerate(distinct):
        load += traction(virtual, facets[group.ravel() == k], _stress_vector(exact, normal))
    return load


def _stress_vector(exact: Any, normal: _Floats) -> Density:
    def density(points: _Floats, sides: NDArray[np.int8]) -> _Floats:
        vector: _Floats = np.einsum("qij,j->qi", exact.stress(points), normal)
        return vector

    return density
