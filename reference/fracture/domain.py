"""The J-integral in its domain form on rings of cells around a tip."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import hooke
from reference.fracture.balance import Force, net_force
from reference.fracture.cells import CellGradients, cell_gradients
from reference.fracture.pressure import stress_of
from verify.errors import InputError
from verify.scene import Material
from verify.solution import Solution

__all__ = ["JIntegral", "Ring", "j_integral", "ring"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class JIntegral:
    """Energy release rate at a tip.

    Attributes
    ----------
    value : float
        Mean over the domains, J/m².
    spread : float
        Largest deviation of a domain from the mean, J/m²: how far it depends on the path.
    domains : (r,) array
        By domain.
    """

    value: float
    spread: float
    domains: Array


@dataclass(frozen=True)
class Ring:
    """The cells that a domain integral runs over.

    Attributes
    ----------
    cells : (m,) int array
    at : CellGradients
        The field there.
    q : (m, p) array
        The weight at the quadrature points: 1 at the tip, 0 outside the ring.
    grad_q : (m, p, 2) array
        1/m.
    near : (m, p, 2) array
        Centroid of the cell of each point, which says the side of the cut.
    """

    cells: NDArray[np.int64]
    at: CellGradients
    q: Array
    grad_q: Array
    near: Array


def j_integral(
    solution: Solution,
    material: Material,
    tip: Array,
    direction: Array,
    radii: Array,
    body_force: Force = None,
    drag: float = 0.0,
    step: int = -1,
) -> JIntegral:
    """Energy release rate of a crack that grows straight on, by several domains.

    J = ∫ (σ_ij u_i,1 − W δ_1j) q_,j dA − ∫ (f_i − ρ (ü_i + α u̇_i)) u_i,1 q dA with q linear in
    each cell (Li, Shih & Needleman, Eng. Fract. Mech. 21, 1985; Moran & Shih, same journal 27,
    1987, for a tip that stands still in a motion). The faces are straight in the domain, and free
    of traction.

    Parameters
    ----------
    solution : Solution
        Plane and linear elastic.
    material : Material
    tip : (2,) array
        m.
    direction : (2,) array
        Unit vector in which the crack points.
    radii : (r,) array
        Radii of the domains, m.
    body_force : (2,) array or callable, optional
        Force per volume, or its values (n, 2) at points (n, 2), N/m³: under gravity the specific
        weight.
    drag : float
        α, Rayleigh's damping by the mass, 1/s.
    step : int
        Which output time; default the last.

    Raises
    ------
    InputError
        If a radius is not positive or too small for the mesh, or the field is in motion and
        carries no accelerations.
    """
    law = hooke(material)
    stresses = stress_of(solution, law, step)
    force = net_force(solution, material, body_force, drag, step)
    values = []
    for radius in np.atleast_1d(radii):
        around = ring(solution, tip, float(radius), force is not None, step)
        at = around.at
        stress = stresses(around.cells, at)
        energy = 0.5 * np.sum(stress * at.gradient, axis=(2, 3))
        along = at.gradient @ direction  # u_i,1
        flux = np.einsum("mqij,mqi->mqj", stress, along) - energy[..., None] * direction
        density = np.sum(flux * around.grad_q, axis=2)
        if force is not None:
            density -= np.sum(force(around.cells, at) * along, axis=2) * around.q
        values.append(float(np.sum(density * at.weights)))
    domains = np.array(values)
    mean = float(domains.mean())
    return JIntegral(mean, float(np.abs(domains - mean).max()), domains)


def ring(
    solution: Solution, tip: Array, radius: float, whole: bool = False, step: int = -1
) -> Ring:
    """Gather the cells where q falls from 1 to 0: those with corners on both sides of a circle.

    Parameters
    ----------
    solution : Solution
    tip : (2,) array
    radius : float
        m.
    whole : bool
        Also gather the cells inside, where q = 1.
    step : int
        Which output time; default the last.

    Raises
    ------
    InputError
        If the circle is so small that a cell of the tip reaches across it, or leaves no cells.
    """
    if solution.dimension != 2 or not radius > 0:
        raise InputError(
            f"a domain of radius {radius} m; expected a plane field, a positive radius"
        )
    corners = solution.cells[:, :3]
    away = np.linalg.norm(solution.points[corners] - tip, axis=2)
    inside = away < radius
    at_tip = away.min(axis=1) <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    mixed = inside.any(axis=1) & ~inside.all(axis=1)
    if not mixed.any() or (mixed & at_tip).any() or inside.all():
        raise InputError(
            f"a domain of radius {radius:.4g} m around ({tip[0]:.4g}, {tip[1]:.4g}) does not fit "
            "between the cells at the tip and the body's boundary"
        )
    cells = np.flatnonzero(mixed | inside.all(axis=1)) if whole else np.flatnonzero(mixed)
    at = cell_gradients(solution, cells, step)
    hat = inside[cells].astype(float)
    grad_q = np.einsum("mk,mqkj->mqj", hat, at.hats)
    near = np.broadcast_to(
        solution.points[corners[cells]].mean(axis=1)[:, None, :], at.points.shape
    )
    # the value of a linear q, from its gradient and a corner
    first = solution.points[corners[cells, 0]][:, None, :]
    q = hat[:, :1] + np.sum((at.points - first) * grad_q, axis=2)
    return Ring(cells, at, q, grad_q, near)
