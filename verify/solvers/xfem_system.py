"""The linear system of a body on virtual nodes: stiffness, mass and supports of a scene."""

from typing import Any

from scipy.sparse import csr_array, identity, kron

from verify.errors import InputError
from verify.scene import Scene
from verify.solvers.body_of_scene import density_of
from verify.solvers.supports_of_scene import supports_of
from verify.solvers.xfem_bases import held_in_basis
from verify.solvers.xfem_steps import MASSES
from verify.system import System
from verify.xfem.bases import transformed_matrix
from verify.xfem.block_pattern import body_pattern
from verify.xfem.elasticity import Material
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce
from verify.xfem.phantom import PhantomMesh


def system_of(
    scene: Scene,
    phantom: PhantomMesh,
    resisting: PhantomMesh,
    material: Material,
    exact: Any,
    mass: str = "sidewise",
    basis: str = "sidewise",
    penalise: bool = False,
) -> System:
    """Assemble the system of a cut body.

    Parameters
    ----------
    scene : Scene
    phantom, resisting : PhantomMesh
        What has the mass and the supports, and what resists; the same unknowns.
    material : Material
        Of the cells of `resisting`.
    exact : exact solution, optional
    mass, basis : str
        As of the solver ``xfem``.
    penalise : bool
        With a ghost penalty.

    Raises
    ------
    InputError
        If the mass or the basis is unknown.
    XfemError
        If one of them is not defined on this body.
    """
    if mass not in MASSES:
        raise InputError(f"mass '{mass}'; expected one of {', '.join(MASSES)}")
    pattern = body_pattern(resisting)
    stiffness = csr_array(
        pattern.matrix(InternalForce(resisting, material, "linear").stiffness(pattern))
    )
    supports = supports_of(scene, phantom, exact)
    components = supports.fixed.shape[1]
    inertia = None
    if scene.material.density is not None:
        inertia = MASSES[mass](phantom, density_of(scene, phantom.mesh))
    if penalise:
        ghost = GhostPenalty(phantom, material)
        stiffness = csr_array(stiffness + kron(ghost.matrix, identity(components)))
        inertia = None if inertia is None else ghost.mass(inertia, density_of(scene, phantom.mesh))
    matrix = None if inertia is None else csr_array(kron(inertia.matrix, identity(components)))
    if basis == "sidewise":
        return System(stiffness, matrix, supports.fixed.ravel())
    other: Any = basis
    return System(
        transformed_matrix(phantom, other, stiffness),
        None if matrix is None else transformed_matrix(phantom, other, matrix),
        held_in_basis(phantom, supports, other),
    )
