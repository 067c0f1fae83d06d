"""Stress intensity factors by the interaction integral."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.exact import exact_solution
from reference.exact.hooke import hooke
from reference.fracture.domain import ring
from reference.fracture.pressure import stress_of
from verify.scene import Material
from verify.solution import Solution

__all__ = ["StressIntensity", "stress_intensity"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StressIntensity:
    """Stress intensity factors at a tip, Pa·√m.

    Attributes
    ----------
    mode_1, mode_2 : float
        K_I and K_II, means over the domains.
    spread : (2,) array
        Largest deviation of a domain from the mean, of each.
    domains : (r, 2) array
        By domain.
    """

    mode_1: float
    mode_2: float
    spread: Array
    domains: Array


def stress_intensity(
    solution: Solution,
    material: Material,
    tip: Array,
    direction: Array,
    radii: Array,
    body_force: Array | None = None,
) -> StressIntensity:
    """K_I and K_II of a straight crack from a plane field.

    The interaction integral with the tip fields of each mode (Yau, Wang & Corten, J. Appl. Mech.
    47, 1980): M = ∫ (σ_ij û_i,1 + σ̂_ij u_i,1 − σ_ij ε̂_ij δ_1j) q_,j dA − ∫ f_i û_i,1 q dA and
    K = E' M / 2, with E' = E/(1−ν²) in plane strain, E in plane stress.

    Parameters
    ----------
    solution, material, tip, direction, radii, body_force
        As for `reference.fracture.j_integral`. Within the largest radius the crack is straight
        and free of traction, and nothing else is met.
    """
    law = hooke(material)
    stresses = stress_of(solution, law)
    angle = float(np.rad2deg(np.arctan2(direction[1], direction[0])))
    values = []
    for radius in np.atleast_1d(radii):
        around = ring(solution, tip, float(radius), whole=body_force is not None)
        at = around.at
        points, near = at.points.reshape(-1, 2), around.near.reshape(-1, 2)
        stress = stresses(around.cells, at)
        along = at.gradient @ direction
        both = []
        for intensity in ([1.0, 0.0], [0.0, 1.0]):
            mode = exact_solution(
                "tip", {"tip": tip.tolist(), "angle": angle, "intensity": intensity}, material
            )
            gradient = mode.gradient(points, near).reshape(at.gradient.shape)
            mode_along = gradient @ direction
            flux = np.einsum("mqij,mqi->mqj", stress, mode_along)
            flux += np.einsum("mqij,mqi->mqj", law.stress(gradient), along)
            flux -= np.sum(stress * gradient, axis=(2, 3))[..., None] * direction
            density = np.sum(flux * around.grad_q, axis=2)
            if body_force is not None:
                density -= (mode_along @ body_force) * around.q
            both.append(0.5 * law.plane_modulus * float(np.sum(density * at.weights)))
        values.append(both)
    domains = np.array(values)
    mean = domains.mean(axis=0)
    spread = np.abs(domains - mean).max(axis=0)
    return StressIntensity(float(mean[0]), float(mean[1]), spread, domains)
