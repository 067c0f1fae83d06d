"""Stiffness, mass and supports of a scene as scipy arrays."""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from reference.boundary_values import constrained_values
from reference.elasticity import mass_form, stiffness_form
from reference.nodal_algebra import assembled_matrix
from reference.space import ConformingSpace
from verify.scene import Scene


def linear_system(
    scene: Scene, space: ConformingSpace, exact: Any
) -> tuple[csr_array, csr_array | None, NDArray[np.bool_]]:
    """Stiffness, consistent mass and held unknowns of a scene, in one process.

    Returns
    -------
    stiffness : (k, k) csr_array
        N/m.
    mass : (k, k) csr_array or None
        kg; None where the scene states no density.
    held : (k,) bool array
    """
    import ufl

    u, v = (make(space.function_space) for make in (ufl.TrialFunction, ufl.TestFunction))
    unknowns, _ = constrained_values(scene, space, exact)
    held = np.zeros(space.node_points.size, dtype=bool)
    held[unknowns] = True
    mass = None
    if scene.material.density is not None:
        mass = _as_array(mass_form(scene.material, u, v))
    return _as_array(stiffness_form(scene.material, u, v)), mass, held


def _as_array(form: Any) -> csr_array:
    matrix = assembled_matrix(form)
    starts, columns, values = matrix.getValuesCSR()
    array = csr_array((values, columns, starts), shape=matrix.getSize())
    matrix.destroy()
    return array
