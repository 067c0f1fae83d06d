"""Loads of a scene as consistent nodal forces of a cut body."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from verify.scene import BodyForce, CutFaces, Gravity, Scene, Traction, is_uniform
from verify.scene.physics import Load
from verify.solvers.body_of_scene import density_of
from verify.solvers.xfem_boundary import facets_on
from verify.solvers.xfem_faces import face_forces
from verify.xfem.loads import Density, body_force, traction
from verify.xfem.mesh import SimplexMesh
from verify.xfem.phantom import PhantomMesh

__all__ = ["NodalForces", "forces_of", "is_moving", "loads_of", "nodal_forces"]

_Floats = NDArray[np.float64]


class NodalForces(NamedTuple):
    """A load of the scene and its nodal forces (N, d), N (per metre of thickness in 2D)."""

    load: Load
    forces: _Floats


def loads_of(scene: Scene, phantom: PhantomMesh, exact: Any) -> _Floats:
    """Return the consistent nodal forces (N, d) of all loads, N (per metre in 2D)."""
    total = np.zeros_like(phantom.node_points)
    for one in nodal_forces(scene, phantom, exact):
        total += one.forces
    return total


def nodal_forces(scene: Scene, phantom: PhantomMesh, exact: Any) -> list[NodalForces]:
    """Return the nodal forces of every load at the time 0, in the order of the scene.

    Those of a membrane are times its thickness: forces per volume and per area stay what they
    are.
    """
    return [
        NodalForces(entry, forces_of(scene, i, phantom, exact))
        for i, entry in enumerate(scene.loads)
    ]


def is_moving(load: Load, exact: Any) -> bool:
    """Whether a load is another field at every time, apart from the factor of its history."""
    if isinstance(load, Gravity):
        return False
    return bool(load.timed or (load.exact and exact.moves))


def forces_of(scene: Scene, i: int, phantom: PhantomMesh, exact: Any, time: float = 0.0) -> _Floats:
    """Return the nodal forces (N, d) of a load at a time, without the factor of its history, N."""
    entry = scene.loads[i]
    field: Any = None if exact is None else exact.at(time)
    if isinstance(entry, Gravity):
        forces = body_force(phantom, _weight(scene, phantom.mesh, entry))
    elif isinstance(entry, CutFaces):
        forces = face_forces(scene, phantom, i, time)
    elif isinstance(entry, Traction):
        facets = facets_on(scene, phantom.mesh, entry.where, f"loads[{i}].where")
        if entry.exact:
            forces = _stresses(phantom, facets, field)
        else:
            forces = traction(phantom, facets, _density(entry, entry.traction, time))
    elif entry.exact:
        forces = body_force(phantom, lambda points, sides: field.body_force(points))
    else:
        forces = body_force(phantom, _density(entry, entry.force, time))
    return np.asarray((scene.material.thickness or 1.0) * forces)


def _weight(scene: Scene, mesh: SimplexMesh, load: Gravity) -> _Floats:
    """Force per volume (d,), or (m, d) by cell where materials differ, N/m³."""
    density = np.asarray(density_of(scene, mesh)) / (scene.material.thickness or 1.0)
    return np.multiply.outer(density, np.asarray(load.acceleration))


def _density(load: BodyForce | Traction, given: Any, time: float) -> Any:
    """Numbers as they are, which are integrated in closed form; formulas as a function."""
    return given if is_uniform(given) else lambda points, sides: load.values(points, time)


def _stresses(phantom: PhantomMesh, facets: NDArray[np.int64], exact: Any) -> _Floats:
    """Nodal forces (N, d) of the exact solution's stress vectors on facets."""
    mesh = phantom.mesh
    normals = -mesh.gradients[facets[:, 0], facets[:, 1]]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    load = np.zeros_like(phantom.node_points)
    distinct, group = np.unique(np.round(normals, 12), axis=0, return_inverse=True)
    for k, normal in enumerate(distinct):
        load += traction(phantom, facets[group.ravel() == k], _stress_vector(exact, normal))
    return load


def _stress_vector(exact: Any, normal: _Floats) -> Density:
    def density(points: _Floats, sides: NDArray[np.int8]) -> _Floats:
        vector: _Floats = np.einsum("qij,j->qi", exact.stress(points), normal)
        return vector

    return density
