"""Elasticity and mass of a body on virtual nodes, and its linear system."""

from typing import Any

from scipy.sparse import csr_array, identity, kron

from verify.accelerated import FAST
from verify.errors import UnsupportedSceneError
from verify.scene import Scene
from verify.solvers.body_of_scene import density_of, material_of
from verify.solvers.supports_of_scene import supports_of
from verify.solvers.xfem_steps import MASSES
from verify.system import System
from verify.xfem.block_pattern import body_pattern
from verify.xfem.errors import XfemError
from verify.xfem.ghost_penalty import GhostPenalty
from verify.xfem.internal_force import InternalForce, Kinematics
from verify.xfem.linear_solvers import Kernels
from verify.xfem.mass import Mass
from verify.xfem.phantom import PhantomMesh


def elasticity_of(
    scene: Scene,
    phantom: PhantomMesh,
    kinematics: Kinematics,
    penalise: bool = False,
    kernels: Kernels = FAST,
) -> tuple[InternalForce, GhostPenalty | None]:
    """Return the elasticity of a cut body, with a ghost penalty where asked for, and that."""
    material = material_of(scene, phantom.mesh)
    ghost = GhostPenalty(phantom, material) if penalise else None
    return InternalForce(phantom, material, kinematics, kernels, ghost), ghost


def mass_of(scene: Scene, phantom: PhantomMesh, mass: str, ghost: GhostPenalty | None) -> Mass:
    """Return the mass of a cut body, by its name among `MASSES`.

    Raises
    ------
    UnsupportedSceneError
        If it is not defined on this body: a lumping of the thesis, where cuts cross.
    """
    density = density_of(scene, phantom.mesh)
    try:
        found = MASSES[mass](phantom, density)
    except XfemError as error:
        raise UnsupportedSceneError(f"mass = '{mass}': {error}") from None
    return ghost.mass(found, density) if ghost else found


def system_of(
    scene: Scene,
    phantom: PhantomMesh,
    force: InternalForce,
    ghost: GhostPenalty | None,
    exact: Any,
    mass: str = "sidewise",
) -> System:
    """Assemble the system of a cut body.

    Parameters
    ----------
    scene : Scene
    phantom : PhantomMesh
        What has the mass and the supports.
    force, ghost
        Linear elasticity of what resists with the same unknowns, as of `elasticity_of`.
    exact : exact solution, optional
    mass : str
        As of the solver ``xfem``.

    Raises
    ------
    UnsupportedSceneError
        If the mass is not defined on this body.
    """
    pattern = body_pattern(force.phantom, ghost.couplings if ghost else None)
    stiffness = csr_array(pattern.matrix(force.stiffness(pattern)))
    supports = supports_of(scene, phantom, exact)
    matrix = None
    if scene.material.density is not None:
        inertia = mass_of(scene, phantom, mass, ghost)
        matrix = csr_array(kron(inertia.matrix, identity(supports.fixed.shape[1])))
    return System(stiffness, matrix, supports.fixed.ravel())
