"""The force per volume that balances the stress of a field: what is given, less the inertia."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reference.fracture.cells import CellGradients
from verify.errors import InputError
from verify.scene import Material
from verify.solution import Solution

Array = NDArray[np.float64]
Force = Array | Callable[[Array], Array] | None
NetForce = Callable[[NDArray[np.int64], CellGradients], Array]


def net_force(
    solution: Solution,
    material: Material,
    body_force: Force = None,
    drag: float = 0.0,
    step: int = -1,
) -> NetForce | None:
    """Give −div σ = f − ρ (ü + α u̇) at the quadrature points of cells, N/m³; None where it is 0.

    In a domain integral inertia is a force like any other: while a crack stands still, neither the
    singular fields nor what the integral tends to at its tip know of it.

    Parameters
    ----------
    solution : Solution
        One with velocities is in motion, and must carry accelerations.
    material : Material
    body_force : (d,) array or callable, optional
        f, N/m³, or its values (n, d) at points (n, d).
    drag : float
        α, Rayleigh's damping by the mass, 1/s.
    step : int
        Which output time; default the last.

    Raises
    ------
    InputError
        If a field in motion carries no accelerations, or its material has no density.
    """

    def given(at: CellGradients) -> Array:
        if callable(body_force):
            points = at.points.reshape(-1, solution.dimension)
            return np.reshape(body_force(points), at.points.shape)
        return np.broadcast_to(0.0 if body_force is None else body_force, at.points.shape)

    if solution.velocity is None and solution.acceleration is None:
        return None if body_force is None else lambda _cells, at: given(at)
    if solution.acceleration is None or (drag and solution.velocity is None):
        raise InputError(
            "the solution is in motion and carries no accelerations: its inertia is not known"
        )
    density = material.density
    if density is None:
        raise InputError("a field in motion of a material without a density")
    rate = solution.acceleration[step]
    if drag:
        assert solution.velocity is not None
        rate = rate + drag * solution.velocity[step]

    def force(cells: NDArray[np.int64], at: CellGradients) -> Array:
        return given(at) - density * (at.shape @ rate[solution.cells[cells]])

    return force
