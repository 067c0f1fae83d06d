"""Statics in the shifted or the plain Heaviside basis, for comparison with the side-wise one.

The same space, so the same displacements up to round-off; what differs is the conditioning. The
transformed system is solved by SciPy's SuperLU, because the plain basis is too badly conditioned
for a factorisation without pivoting.
"""

from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.linalg import splu

from verify.xfem.bases import (
    Basis,
    from_sidewise,
    sidewise_from,
    transformation,
    transformed_matrix,
)
from verify.xfem.block_pattern import body_pattern
from verify.xfem.elasticity import Material
from verify.xfem.errors import BasisError
from verify.xfem.internal_force import InternalForce
from verify.xfem.phantom import PhantomMesh
from verify.xfem.supports import Supports, check_bodies


def solve_in_basis(
    phantom: PhantomMesh,
    material: Material,
    supports: Supports,
    load: NDArray[np.float64],
    basis: Basis,
) -> tuple[NDArray[np.float64], dict[str, float]]:
    """Solve K u = f in another basis.

    Returns
    -------
    displacement : (N, d) array
        At the dof nodes of the side-wise basis, m.
    timings : dict of str to float
        Wall seconds of ``assembly``, ``factorisation`` and ``solve``.

    Raises
    ------
    XfemError
        If a node has more than two unknowns, or a free piece can move rigidly.
    """
    check_bodies(phantom, supports)
    clock = [perf_counter()]
    pattern = body_pattern(phantom)
    blocks = InternalForce(phantom, material, "linear").stiffness(pattern)
    matrix = transformed_matrix(phantom, basis, csr_array(pattern.matrix(blocks)))
    known = from_sidewise(phantom, basis, supports.values).ravel()
    held = held_in_basis(phantom, supports, basis)
    transposed = transformation(phantom, basis).T
    force = (transposed @ load).ravel() - matrix @ np.where(held, known, 0.0)
    free = np.flatnonzero(~held)
    inner = matrix[free][:, free].tocsc()
    clock.append(perf_counter())
    factors = splu(inner)
    clock.append(perf_counter())
    unknowns = np.where(held, known, 0.0)
    unknowns[free] = factors.solve(force[free])
    clock.append(perf_counter())
    displacement = sidewise_from(phantom, basis, unknowns.reshape(-1, load.shape[1]))
    phases = ("assembly", "factorisation", "solve")
    return displacement, dict(zip(phases, np.diff(clock).tolist(), strict=True))


def held_in_basis(phantom: PhantomMesh, supports: Supports, basis: Basis) -> NDArray[np.bool_]:
    """Which unknowns (u of all nodes, then a of the enriched) are prescribed.

    The plain basis knows the two sides of a node only together; in the shifted one u is the
    node's own side, and a the difference.
    """
    count = len(phantom.mesh.points)
    nodes, beyond = supports.fixed[:count], supports.fixed[count:]
    own = nodes[phantom.node_parent[count:]]
    if (beyond & ~own).any() or (basis == "heaviside" and (own != beyond).any()):
        raise BasisError(
            f"a support holds one side of a cut element and not the other, which the {basis} "
            "unknowns cannot say; the side-wise ones can"
        )
    return np.concatenate([nodes, beyond]).ravel()
