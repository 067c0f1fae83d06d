"""Time integration of a cut body: generalised-α (Newmark), implicit Euler; states handed on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.space import ConformingSpace
from verify.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scheme:
    """Parameters of one-step schemes with one unknown acceleration a₊.

    M a_{n+1−α_m} + C v_{n+1−α_f} + K u_{n+1−α_f} = f, where n+1−α is (1−α)·new + α·old, with
    u₊ = u + Δt v + Δt² (β₀ a + β a₊) and v₊ = v + Δt (γ₀ a + γ a₊).
    """

    alpha_m: float
    alpha_f: float
    beta_old: float
    beta: float
    gamma_old: float
    gamma: float


def generalised_alpha(spectral_radius: float = 1.0) -> Scheme:
    """Make the generalised-α scheme of a spectral radius at infinite frequency.

    Of second order (Chung & Hulbert, J. Appl. Mech. 60, 1993). At 1 it is the midpoint form of
    the trapezoidal rule and dissipates nothing.
    """
    rho = spectral_radius
    if not 0.0 <= rho <= 1.0:
        raise InputError(f"spectral radius {rho}; expected 0 to 1")
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    beta, gamma = (1 - alpha_m + alpha_f) ** 2 / 4, 0.5 - alpha_m + alpha_f
    return Scheme(alpha_m, alpha_f, 0.5 - beta, beta, 1 - gamma, gamma)


def implicit_euler() -> Scheme:
    """Make implicit Euler: u₊ = u + Δt v₊, v₊ = v + Δt a₊.

    Of first order; an amplitude is multiplied by 1/√(1+(ωΔt)²) per step.
    """
    return Scheme(0.0, 0.0, 0.0, 1.0, 0.0, 1.0)


def inherit(closed: ConformingSpace, opened: ConformingSpace, field: Array) -> Array:
    """Carry nodal values (n, d) over to the same mesh with more of its cuts open.

    Every copy of a node starts with the value that the node had: nothing jumps when a cut
    opens, so energy and momentum go on.

    Raises
    ------
    InputError
        If the two are not the same cells.
    """
    same = closed.cell_nodes.shape == opened.cell_nodes.shape and np.allclose(
        closed.node_points[closed.cell_nodes],
        opened.node_points[opened.cell_nodes],
        rtol=0.0,
        atol=1e-12 * float(np.ptp(closed.node_points, axis=0).max()),
    )
    if not same:
        raise InputError("the opened mesh does not have the cells of the closed one")
    values = np.empty((len(opened.node_points), field.shape[1]))
    values[opened.cell_nodes] = field[closed.cell_nodes]
    return values
