"""Stress-intensity factors and G of tips in the plane, by integrals over rings of cells."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.exact.field import Hooke, hooke
from reference.exact.solution import ExactSolution
from reference.fracture.cells import (
    CellGradients,
    Force,
    Stresses,
    cell_gradients,
    net_force,
    stress_of,
)  # fmt: skip
from reference.fracture.tips import ahead_of, tip_fields
from verify.errors import InputError
from verify.scene import ArcCut, Material
from verify.solution import Solution

Array = NDArray[np.float64]


class DomainError(InputError):
    """A domain around a tip is too small for the cells there, or larger than the body."""


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
    DomainError
        If the circle is so small that a cell of the tip reaches across it, or leaves no cells.
    InputError
        If the field is not plane, or the radius not positive.
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
        raise DomainError(
            f"a domain of radius {radius:.4g} m around ({tip[0]:.4g}, {tip[1]:.4g}) does not fit "
            "between the cells at the tip and what is next to it"
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


@dataclass(frozen=True)
class StressIntensity:
    """Stress intensity factors at a tip, Pa·√m, and its energy release rate.

    Attributes
    ----------
    mode_1, mode_2 : float
        K_I and K_II, means over the domains.
    release : float
        G, J/m²: mean over the domains of the integral of the field itself.
    spread : (2,) array
        Largest deviation of a domain from the mean, of each factor.
    domains : (r, 2) array
        Factors by domain.
    """

    mode_1: float
    mode_2: float
    release: float
    spread: Array
    domains: Array


def stress_intensity(
    solution: Solution,
    material: Material,
    tip: Array,
    direction: Array,
    radii: Array,
    body_force: Force = None,
    drag: float = 0.0,
    step: int = -1,
    arc: ArcCut | None = None,
    stresses: Stresses | None = None,
) -> StressIntensity:
    """K_I and K_II of a crack that is straight, or an arc, from a plane field.

    The interaction integral with fields of each mode (Yau, Wang & Corten, J. Appl. Mech. 47,
    1980), M = ∫ (σ_ij δû_i + σ̂_ij δu_i − σ_ij ε̂_ij t_j) q_,j dA − ∫ (f_i − ρ (ü_i + α u̇_i)) δû_i q
    dA, and K = E' M / 2 with E' = E/(1−ν²) in plane strain, E in plane stress. At a straight crack
    t is its direction and δu = u_,t. At an arc t = ω (x − c) is the turn about its centre that
    moves the tip by one, and δu = u_,t − ω u: the faces of the arc and an isotropic law stay what
    they are in it (J. K. Knowles & E. Sternberg, Arch. Ration. Mech. Anal. 44, 1972), so that the
    integral has no terms of the curvature. The fields of both modes are in equilibrium and free
    of traction on the crack; a tip that stands still has them in a motion too. G is the domain
    form of Rice's J of the field alone (C. F. Shih, B. Moran & T. Nakamura, Int. J. Fract. 30,
    1986), ∫ (σ_ij δu_i − ½ σ:ε t_j) q,_j dA − ∫ (f_i − ρ (ü_i + α u̇_i)) δu_i q dA.

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
        Radii of the domains, m. Within the largest the crack is straight, or the arc, and free of
        traction, and nothing else is met.
    body_force : (2,) array or callable, optional
        Force per volume, or its values (n, 2) at points (n, 2), N/m³: under gravity the specific
        weight.
    drag : float
        α, Rayleigh's damping by the mass, 1/s.
    step : int
        Which output time; default the last.
    arc : ArcCut, optional
        Of which the tip is an end.
    stresses : callable, optional
        What `stress_of` gives for the solution: where several tips share it.

    Raises
    ------
    InputError
        If a radius is not positive or too small for the mesh, or the field is in motion and
        carries no accelerations.
    """
    law = hooke(material)
    stresses = stresses or stress_of(solution, law, step)
    force = net_force(solution, material, body_force, drag, step)
    modes = tip_fields(material, tip, direction, arc)
    u = solution.displacement[step]
    values, released = [], []
    for radius in np.atleast_1d(radii):
        around = ring(solution, tip, float(radius), force is not None, step)
        at = around.at
        way, turn = ahead_of(at.points, tip, direction, arc)
        moved = at.shape @ u[solution.cells[around.cells]]
        change = np.einsum("mqij,mqj->mqi", at.gradient, way) - moved @ turn.T
        stress = stresses(around.cells, at)
        forces = None if force is None else force(around.cells, at)
        found = [
            _interaction(around, law, stress, change, way, turn, mode, forces) for mode in modes
        ]
        values.append([0.5 * law.plane_modulus * one for one in found])
        flux = np.einsum("mqij,mqi->mqj", stress, change)
        flux -= 0.5 * np.sum(stress * at.gradient, axis=(2, 3))[..., None] * way
        released.append(_integral(around, flux, change, forces))
    domains = np.array(values)
    mean = domains.mean(axis=0)
    spread = np.abs(domains - mean).max(axis=0)
    release = float(np.mean(released))
    return StressIntensity(float(mean[0]), float(mean[1]), release, spread, domains)


def _interaction(
    around: Ring,
    law: Hooke,
    stress: Array,
    change: Array,
    way: Array,
    turn: Array,
    mode: list[tuple[float, ExactSolution]],
    forces: Array | None,
) -> float:
    """M of a field, of which stress and δu are given, with one of unit intensity."""
    at = around.at
    points, near = at.points.reshape(-1, 2), around.near.reshape(-1, 2)
    gradient = sum(share * field.gradient(points, near) for share, field in mode)
    gradient = np.reshape(gradient, at.gradient.shape)
    own = np.einsum("mqij,mqj->mqi", gradient, way)
    if turn.any():
        moved = sum(share * field.displacement(points, near) for share, field in mode)
        own -= np.reshape(moved, at.points.shape) @ turn.T
    flux = np.einsum("mqij,mqi->mqj", stress, own)
    flux += np.einsum("mqij,mqi->mqj", law.stress(gradient), change)
    flux -= np.sum(stress * gradient, axis=(2, 3))[..., None] * way
    return _integral(around, flux, own, forces)


def _integral(around: Ring, flux: Array, change: Array, forces: Array | None) -> float:
    """Integrate a flux (m, q, 2) on ∇q, less the work of forces on the change (m, q, 2) on q."""
    density = np.sum(flux * around.grad_q, axis=2)
    if forces is not None:
        density -= np.sum(forces * change, axis=2) * around.q
    return float(np.sum(density * around.at.weights))
