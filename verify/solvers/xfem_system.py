"""The linear system of a body on virtual nodes: stiffness, mass and supports of a scene."""

from typing import Any

from scipy.sparse import csr_array, identity, kron

from verify.errors import InputError
from verify.scene import Scene
from verify.solvers.body_of_scene import density_of
from verify.solvers.supports_of_scene import supports_of
from verify.solvers.xfem_steps import MASSES
from verify.system import System
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
    mass : str
        As of the solver ``xfem``.
    penalise : bool
        With a ghost penalty.

    Raises
    ------
    InputError
        If the mass is unknown.
    XfemError
        If it is not defined on this body.
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
    return System(stiffness, matrix, supports.fixed.ravel())
