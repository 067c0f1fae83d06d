"""Stress intensity factors and G, by integrals in domain form.

At a tip in the plane over rings of cells, along a front in space over tubes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.exact.solution import ExactSolution, Hooke, hooke
from reference.fracture.cells import (
    CellGradients,
    Force,
    NetForce,
    Stresses,
    cell_gradients,
    net_force,
    stress_of,
)  # fmt: skip
from reference.fracture.tips import Front, ahead_of, mode_field, tip_fields
from verify.errors import InputError
from verify.scene import ArcCut, Material
from verify.solution import Solution

Array = NDArray[np.float64]
_CHUNK = 20_000  # cells at a time
_ROUND_OFF = 1e-6  # of a cell
_SAMPLES = 480  # places along a front, where weights are integrated


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
    away = np.linalg.norm(solution.points - tip, axis=1)
    inside = away < radius
    first, second, third = inside[corners.T]
    every = first & second & third
    mixed = (first | second | third) & ~every
    at_tip = away[corners[mixed]] <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    if not mixed.any() or at_tip.any() or every.all():
        raise DomainError(
            f"a domain of radius {radius:.4g} m around ({tip[0]:.4g}, {tip[1]:.4g}) does not fit "
            "between the cells at the tip and what is next to it"
        )
    cells = np.flatnonzero(mixed | every if whole else mixed)
    at = cell_gradients(solution, cells, step)
    hat = inside[corners[cells]].astype(float)
    grad_q = np.einsum("mk,mqkj->mqj", hat, at.hats)
    near = np.broadcast_to(
        solution.points[corners[cells]].mean(axis=1)[:, None, :], at.points.shape
    )
    # the value of a linear q, from its gradient and a corner
    corner = solution.points[corners[cells, 0]][:, None, :]
    q = hat[:, :1] + np.sum((at.points - corner) * grad_q, axis=2)
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
    """Compute K_I and K_II of a crack that is straight, or an arc, from a plane field.

    The interaction integral with fields of each mode (Yau, Wang & Corten, J. Appl. Mech. 47, 1980):

        M = ∫ (σ_ij δû_i + σ̂_ij δu_i − σ_ij ε̂_ij t_j) q_,j dA
            − ∫ (f_i − ρ (ü_i + α u̇_i)) δû_i q dA.

    K = E' M / 2 with E' = E/(1−ν²) in plane strain, E in plane stress. At a straight crack t is its
    direction and δu = u_,t. At an arc t = ω (x − c) is the turn about its centre that moves the tip
    by one. There δu = u_,t − ω u. It leaves the faces of the arc and an isotropic law unchanged, so
    the integral has no terms of the curvature (J. K. Knowles & E. Sternberg, Arch. Ration. Mech.
    Anal. 44, 1972). The fields of both modes are in equilibrium and free of traction on the crack;
    a tip that stands still has them in a motion too. G is the domain form of Rice's J of the field
    alone (C. F. Shih, B. Moran & T. Nakamura, Int. J. Fract. 30, 1986), ∫ (σ_ij δu_i − ½ σ:ε t_j)
    q,_j dA − ∫ (f_i − ρ (ü_i + α u̇_i)) δu_i q dA.

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
    found = []
    for radius in np.atleast_1d(radii):
        around = ring(solution, tip, float(radius), force is not None, step)
        ways = ahead_of(around.at.points, tip, direction, arc)
        moved = around.at.shape @ solution.displacement[step][solution.cells[around.cells]]
        stress = stresses(around.cells, around.at)
        forces = None if force is None else force(around.cells, around.at)
        found.append(_of_ring(around, law, stress, moved, ways, modes, forces))
    domains, release = np.array([factors for factors, _ in found]), [g for _, g in found]
    mean, spread = _mean(domains)
    first, second = map(float, mean)
    return StressIntensity(first, second, float(np.mean(release)), spread, domains)


def _mean(domains: Array) -> tuple[Array, Array]:
    """Compute the mean over domains, and the largest deviation of one from it."""
    mean = domains.mean(axis=0)
    return mean, np.abs(domains - mean).max(axis=0)


def _of_ring(
    around: Ring,
    law: Hooke,
    stress: Array,
    moved: Array,
    ways: tuple[Array, Array],
    modes: list[list[tuple[float, ExactSolution]]],
    forces: Array | None,
) -> tuple[list[float], float]:
    """Compute K_I and K_II, and G, from one ring, of which stress and displacement are given."""
    way, turn = ways
    change = np.einsum("mqij,mqj->mqi", around.at.gradient, way) - moved @ turn.T
    each = [_interaction(around, law, stress, change, way, turn, mode, forces) for mode in modes]
    flux = np.einsum("mqij,mqi->mqj", stress, change)
    flux -= 0.5 * np.sum(stress * around.at.gradient, axis=(2, 3))[..., None] * way
    factors = [0.5 * law.plane_modulus * one for one in each]
    return factors, _integral(around, flux, change, forces)


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
    """Compute M of a field, of which stress and δu are given, with one of unit intensity."""
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


@dataclass(frozen=True)
class FrontIntensity:
    """Stress intensity factors along a front, Pa·√m, and its energy release rate.

    Attributes
    ----------
    along : (c,) array
        Arc length of each station, m.
    modes : (c, 3) array
        K_I, K_II and K_III, means over the domains. K_II is positive where the upper face, seen
        across the front, slides ahead; K_III where it slides along the front's third axis.
    release : (c,) array
        G, J/m², means over the domains.
    spread : (c, 3) array
        Largest deviation of a domain from the mean, of the factors.
    domains : (r, c, 3) array
        Factors by domain.
    """

    along: Array
    modes: Array
    release: Array
    spread: Array
    domains: Array


def front_intensity(
    solution: Solution,
    material: Material,
    front: Front,
    radii: Array,
    stations: int = 1,
    body_force: Force = None,
    drag: float = 0.0,
    step: int = -1,
    fitted: bool = True,
    stresses: Stresses | None = None,
) -> FrontIntensity:
    """Compute K_I, K_II and K_III along the front of a plane crack.

    The interaction integral with the plane tip fields in the coordinates of the front, with the
    terms of its curvature (M. Gosz & B. Moran, Eng. Fract. Mech. 69, 2002):

        M = ∫ (σ_ij û_i,k + σ̂_ij u_i,k − σ:ε̂ δ_kj) q_k,j
            + (σ_ij (û_i,kj − ε̂_ij,k) + σ̂_ij,j u_i,k − (f_i − ρ (ü_i + α u̇_i)) û_i,k) q_k dV.

    The virtual extension q points ahead of the front and falls off linearly from half the radius to
    the radius. Along the front it is a hat per station: K is a mean with that weight. Then K_I = E'
    M/(2∫w ds), K_III = μ M/∫w ds. For G the field alone counts:

        ∫ (σ_ij u_i,k − ½ σ:ε δ_kj) q_k,j − (f_i − ρ (ü_i + α u̇_i)) u_i,k q_k dV over ∫w ds.

    Parameters
    ----------
    solution : Solution
        In space and linear elastic.
    material : Material
    front : Front
        Within the largest radius the crack is plane, free of traction, and ends nowhere else.
    radii : (r,) array
        Radii of the tubes, m, below the front's own radius.
    stations : int
        Number of stations; with one, a closed front gives its mean.
    fitted : bool
        Whether cells of the mesh must touch the front. They need not in a mesh whose cut ends
        beside the front.
    body_force, drag, step, stresses
        As for `stress_intensity`; forces (3,) or at points (n, 3).

    Raises
    ------
    InputError
        If the field is plane, or in motion without accelerations, or a radius or the number of
        stations does not fit the mesh.
    """
    if solution.dimension != 3:
        raise InputError("stress intensities along a front of a plane field; expected one in space")
    corners = np.unique(solution.cells[:, :4])
    place = np.full(len(solution.points), -1, dtype=np.int64)
    place[corners] = np.arange(len(corners))
    radii = np.atleast_1d(np.asarray(radii, dtype=float))
    at = front.coordinates(solution.points[corners])
    away = np.hypot(at.ahead, at.across)
    centres, width = _stations(front, stations)
    within = _tube(solution, front, away[place], at.along[place], radii, fitted)
    nodes = place[solution.cells[within, :4]]
    force = net_force(solution, material, body_force, drag, step)
    stresses = stresses or stress_of(solution, hooke(material), step)
    nodal = _nodal_shares(
        solution, material, front, within, nodes, at.axes[:, 0], force, stresses, step
    )
    hats = np.array([_hat(front, at.along, centre, width) for centre in centres])
    falls = [np.clip(2.0 - 2.0 * away / radius, 0.0, 1.0) for radius in radii]
    modulus = 0.5 * material.young / (1 - material.poisson**2)
    extents = _lengths(front, solution.points[corners], nodes, away, hats)
    scale = np.array([modulus, modulus, hooke(material).shear, 1.0]) / extents[:, None]
    domains = np.array([(hats * fall) @ nodal * scale for fall in falls])
    mean, spread = _mean(domains)
    return FrontIntensity(centres, mean[:, :3], mean[:, 3], spread[:, :3], domains[:, :, :3])


def _stations(front: Front, count: int) -> tuple[Array, float | None]:
    """Return arc lengths of stations, and the half width of the hat of each (None: the whole)."""
    if count < 1:
        raise InputError(f"{count} stations along a front; expected at least one")
    if front.closed:
        step = front.length / count
        return step * np.arange(count, dtype=float), step if count > 2 else None
    step = front.length / (count + 1)
    return step * np.arange(1.0, count + 1), step


def _hat(front: Front, along: Array, centre: float, width: float | None) -> Array:
    """Compute weights of a station at places along the front."""
    if width is None:
        return np.ones(len(along))
    apart = along - centre
    if front.closed:
        apart = np.mod(apart + 0.5 * front.length, front.length) - 0.5 * front.length
    return np.clip(1.0 - np.abs(apart) / width, 0.0, 1.0)


def _tube(
    solution: Solution, front: Front, away: Array, along: Array, radii: Array, fitted: bool
) -> NDArray[np.int64]:
    """Cells within the largest radius, by the distances and places of nodes; radii must fit."""
    away, along = away[solution.cells[:, :4]], along[solution.cells[:, :4]]
    beside = np.ones(len(along), dtype=bool)
    if not front.closed:  # hats are zero beyond its ends
        beside = (along.max(axis=1) > 0.0) & (along.min(axis=1) < front.length)
    for radius in radii:
        _check_fit(solution, away[beside], radius, fitted)
    return np.flatnonzero((away < radii.max()).any(axis=1))


def _lengths(
    front: Front, points: Array, cells: NDArray[np.int64], away: Array, hats: Array
) -> Array:
    """Integrate weights (c, n) of nodes, linear in cells, along the front, m.

    Cells may be longer than the hats, and nodes, `away` (n,) from the front, beside it: what
    they make of a hat is what weighs K, be it beyond the ends of the front.
    """
    step = front.length / _SAMPLES
    beyond = 0 if front.closed else _SAMPLES
    along = step * (np.arange(-beyond, _SAMPLES + beyond, dtype=np.float64) + 0.5)
    longest = np.linalg.norm(np.ptp(points[cells], axis=1), axis=1)
    cells = cells[away[cells].min(axis=1) <= longest]  # no other holds a place of the front
    corners, size = points[cells], 1e-9 * float(np.ptp(points, axis=0).max())
    low, high = corners.min(axis=1) - size, corners.max(axis=1) + size
    total = np.zeros(len(hats))
    for place in front.places(along):
        near = np.flatnonzero(((low <= place) & (place <= high)).all(axis=1))
        if not len(near):
            continue
        edges = (corners[near, 1:] - corners[near, :1]).swapaxes(1, 2)
        share = np.linalg.solve(edges, (place - corners[near, 0])[:, :, None])[:, :, 0]
        share = np.column_stack([1.0 - share.sum(axis=1), share])
        inside = int(share.min(axis=1).argmax())
        if share[inside].min() > -_ROUND_OFF:  # else beyond the surface of the body
            total += hats[:, cells[near[inside]]] @ share[inside]
    if total.min() * step <= 1e-3 * front.length / len(hats):
        raise InputError(
            f"{len(hats)} stations along a front of {front.length:.4g} m: one of them has no node "
            "of the mesh; ask for fewer, or refine"
        )
    return total * step


def _check_fit(solution: Solution, corner: Array, radius: float, fitted: bool) -> None:
    """Compare a radius with the distances (c, 4) of corners of cells from the front."""
    touching = corner.min(axis=1) <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    if not fitted:  # what reaches from within a quarter of the radius may hold the front
        touching = corner.min(axis=1) <= 0.25 * radius
    if not touching.any():
        raise InputError("no cell of the mesh touches the front: is it where the cut ends?")
    if not corner[touching].max() < radius:
        raise InputError(
            f"a domain of radius {radius:.4g} m is too small: cells at the front reach "
            f"{corner[touching].max():.4g} m; expected less"
        )


def _nodal_shares(
    solution: Solution,
    material: Material,
    front: Front,
    cells: NDArray[np.int64],
    nodes: NDArray[np.int64],
    ahead: Array,
    force: NetForce | None,
    stresses: Stresses,
    step: int,
) -> Array:
    """M of the modes and G (c, 4), linear in the extension of each node along `ahead` (c, 3)."""
    nodal = np.zeros((len(ahead), 4))
    for start in range(0, len(cells), _CHUNK):
        part, corners = cells[start : start + _CHUNK], nodes[start : start + _CHUNK]
        field = cell_gradients(solution, part, step)
        stress = stresses(part, field)
        forces = None if force is None else force(part, field)
        found = _front_interaction(material, front, field, stress, ahead[corners], forces)
        for column in range(4):
            values = found[:, :, column].ravel()
            nodal[:, column] += np.bincount(corners.ravel(), values, minlength=len(ahead))
    return nodal


def _front_interaction(
    material: Material,
    front: Front,
    at: CellGradients,
    stress: Array,
    ahead: Array,
    forces: Array | None,
) -> Array:
    """Compute M of modes and G (m, 4, 4) in some cells, if a corner alone moves by one ahead."""
    local = front.coordinates(at.points.reshape(-1, 3))
    axes = local.axes
    # a corner's direction and slopes in the axes of each point: (points, 4, 3)
    unit = np.repeat(ahead, at.points.shape[1], axis=0)
    unit = unit @ axes.swapaxes(1, 2)
    slope = at.hats.reshape(-1, 4, 3) @ axes.swapaxes(1, 2)
    gradient = axes @ at.gradient.reshape(-1, 3, 3) @ axes.swapaxes(1, 2)
    stress = axes @ stress.reshape(-1, 3, 3) @ axes.swapaxes(1, 2)
    turned = gradient.swapaxes(1, 2)
    share = np.tile(at.corner_shares, (len(at.points), 1))
    weights = at.weights.reshape(-1, 1)
    found = np.empty((len(at.points), 4, 4))
    for mode in (1, 2, 3, 4):
        if mode < 4:
            field = mode_field(mode, material, local.ahead, local.across, front.curvature)
            work = np.sum(field.stress * gradient, axis=(1, 2))  # σ̂ : ε = σ : ε̂
            moved = field.gradient.swapaxes(1, 2)
            flux = moved @ stress + turned @ field.stress
            source = (turned @ field.divergence[:, :, None])[:, :, 0]
            source[:, 0] += np.sum(stress * field.misfit, axis=(1, 2))
        else:  # the field itself
            work, moved = 0.5 * np.sum(stress * gradient, axis=(1, 2)), turned
            flux, source = moved @ stress, np.zeros((len(turned), 3))
        flux[:, [0, 1, 2], [0, 1, 2]] -= work[:, None]
        if forces is not None:
            force = axes @ forces.reshape(-1, 3, 1)
            source -= (moved @ force)[:, :, 0]
        density = np.sum((unit @ flux) * slope, axis=2)
        density += share * (unit @ source[:, :, None])[:, :, 0]
        found[:, :, mode - 1] = (weights * density).reshape(len(at.points), -1, 4).sum(axis=1)
    return found
