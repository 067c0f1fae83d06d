"""Stress intensity factors along a front in space, by the interaction integral in domain form."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import hooke
from reference.fracture.cells import cell_gradients
from reference.fracture.front import Front
from reference.fracture.front_modes import mode_field
from verify.errors import InputError
from verify.scene import Material
from verify.solution import Solution

__all__ = ["FrontIntensity", "front_intensity"]

Array = NDArray[np.float64]
_CHUNK = 20_000  # cells at a time


@dataclass(frozen=True)
class FrontIntensity:
    """Stress intensity factors along a front, Pa·√m.

    Attributes
    ----------
    along : (c,) array
        Arc length of each station, m.
    modes : (c, 3) array
        K_I, K_II and K_III, means over the domains. K_II is positive where the upper face, seen
        across the front, slides ahead; K_III where it slides along the front's third axis.
    spread : (c, 3) array
        Largest deviation of a domain from the mean.
    domains : (r, c, 3) array
        By domain.
    """

    along: Array
    modes: Array
    spread: Array
    domains: Array


def front_intensity(
    solution: Solution,
    material: Material,
    front: Front,
    radii: Array,
    stations: int = 1,
    body_force: Array | None = None,
) -> FrontIntensity:
    """K_I, K_II and K_III along the front of a plane crack.

    The interaction integral with the plane tip fields in the coordinates of the front, with the
    terms of its curvature (M. Gosz & B. Moran, Eng. Fract. Mech. 69, 2002):
    M = ∫ (σ_ij û_i,k + σ̂_ij u_i,k − σ:ε̂ δ_kj) q_k,j
    + (σ_ij (û_i,kj − ε̂_ij,k) + σ̂_ij,j u_i,k − f_i û_i,k) q_k dV. The virtual extension q points
    ahead of the front, falls off linearly from half the radius to the radius, and along the front
    by a hat per station: K is a mean with that weight. Then K_I = E' M/(2∫w ds), K_III = μ M/∫w ds.

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
    body_force : (3,) array, optional
        Force per volume, N/m³.

    Raises
    ------
    InputError
        If the field is plane, or a radius does not fit the mesh.
    """
    if solution.dimension != 3:
        raise InputError("stress intensities along a front of a plane field; expected one in space")
    corners = np.unique(solution.cells[:, :4])
    place = np.full(len(solution.points), -1, dtype=np.int64)
    place[corners] = np.arange(len(corners))
    at = front.coordinates(solution.points[corners])
    away = np.hypot(at.ahead, at.across)
    centres, width = _stations(front, stations)
    on = away <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    values = []
    for radius in np.atleast_1d(np.asarray(radii, dtype=float)):
        fall = np.clip(2.0 - 2.0 * away / radius, 0.0, 1.0)
        _check_fit(solution, place, away, radius)
        row = []
        for centre in centres:
            weight = fall * _hat(front, at.along, centre, width)
            cells = np.flatnonzero((weight[place[solution.cells[:, :4]]] > 0).any(axis=1))
            q = weight[:, None] * at.axes[:, 0]
            total = np.zeros(3)
            for start in range(0, len(cells), _CHUNK):
                part = cells[start : start + _CHUNK]
                total += _interaction(solution, material, front, part, q, place, body_force)
            extent = _mean_length(front, at.along[on], weight[on])
            modulus = 0.5 * material.young / (1 - material.poisson**2)
            row.append(total * [modulus, modulus, hooke(material).shear] / extent)
        values.append(row)
    domains = np.array(values)
    mean = domains.mean(axis=0)
    return FrontIntensity(centres, mean, np.abs(domains - mean).max(axis=0), domains)


def _stations(front: Front, count: int) -> tuple[Array, float | None]:
    """Arc lengths of the stations, and the half width of the hat of each (None: the whole)."""
    if count < 1:
        raise InputError(f"{count} stations along a front; expected at least one")
    if front.closed:
        step = front.length / count
        return step * np.arange(count, dtype=float), step if count > 2 else None
    step = front.length / (count + 1)
    return step * np.arange(1.0, count + 1), step


def _hat(front: Front, along: Array, centre: float, width: float | None) -> Array:
    """Weights of a station at places along the front."""
    if width is None:
        return np.ones(len(along))
    apart = along - centre
    if front.closed:
        apart = np.mod(apart + 0.5 * front.length, front.length) - 0.5 * front.length
    return np.clip(1.0 - np.abs(apart) / width, 0.0, 1.0)


def _mean_length(front: Front, along: Array, weight: Array) -> float:
    """Integrate the weight, linear between the nodes on the front, along the front."""
    order = np.argsort(along, kind="stable")
    s, w = along[order], weight[order]
    if front.closed:
        s, w = np.append(s, s[0] + front.length), np.append(w, w[0])
    return float(np.sum(0.5 * (w[1:] + w[:-1]) * np.diff(s)))


def _check_fit(solution: Solution, place: NDArray[np.int64], away: Array, radius: float) -> None:
    corner = away[place[solution.cells[:, :4]]]
    touching = corner.min(axis=1) <= 1e-9 * float(np.ptp(solution.points, axis=0).max())
    if not touching.any():
        raise InputError("no cell of the mesh touches the front: is it where the cut ends?")
    if not corner[touching].max() < radius:
        raise InputError(
            f"a domain of radius {radius:.4g} m is too small: cells at the front reach "
            f"{corner[touching].max():.4g} m; expected less"
        )


def _interaction(
    solution: Solution,
    material: Material,
    front: Front,
    cells: NDArray[np.int64],
    q: Array,
    place: NDArray[np.int64],
    body_force: Array | None,
) -> Array:
    """Sum up M of the three modes over some cells."""
    at = cell_gradients(solution, cells)
    local = front.coordinates(at.points.reshape(-1, 3))
    axes = local.axes
    nodal = q[place[solution.cells[cells, :4]]]  # (m, 4, 3)
    share = at.corner_shares
    q_here = np.einsum("qk,mki->mqi", share, nodal).reshape(-1, 3)
    q_slope = np.einsum("mqkj,mki->mqij", at.hats, nodal).reshape(-1, 3, 3)
    gradient = axes @ at.gradient.reshape(-1, 3, 3) @ axes.swapaxes(1, 2)
    q_slope = axes @ q_slope @ axes.swapaxes(1, 2)
    q_here = np.einsum("nij,nj->ni", axes, q_here)
    stress = hooke(material).stress(gradient)
    weights = at.weights.ravel()
    found = []
    for mode in (1, 2, 3):
        field = mode_field(mode, material, local.ahead, local.across, front.curvature)
        work = np.sum(field.stress * gradient, axis=(1, 2))  # σ̂ : ε = σ : ε̂
        flux = np.einsum("nij,nik->nkj", stress, field.gradient)
        flux += np.einsum("nij,nik->nkj", field.stress, gradient)
        density = np.sum(flux * q_slope, axis=(1, 2)) - work * np.trace(q_slope, axis1=1, axis2=2)
        density += np.sum(stress * field.misfit, axis=(1, 2)) * q_here[:, 0]
        density += np.einsum("ni,nik,nk->n", field.divergence, gradient, q_here)
        if body_force is not None:
            force = axes @ np.asarray(body_force, dtype=float)
            density -= np.einsum("ni,nik,nk->n", force, field.gradient, q_here)
        found.append(float(density @ weights))
    return np.array(found)
