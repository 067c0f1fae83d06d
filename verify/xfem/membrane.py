"""Tension of membranes: what holds triangles in space across their plane.

A membrane has no stiffness against the displacement φ along its turned normal n but w (∇φ · S ∇φ)
of its tension S, the second Piola–Kirchhoff stress with principal values
(2μ(λ_k − 1) + λ(λ_1 + λ_2 − 2))/λ_k at the stretches λ_k. The geometric stiffness takes its
positive part alone, so that it has no negative mode.
"""

import numpy as np

from verify.xfem.arrays import Floats
from verify.xfem.element import Elements

_COLLAPSED = 1e-6  # stretch below which a direction carries no tension that could be meant


def turned_normals(elements: Elements, R: Floats) -> Floats:
    """Turn the normals of membranes by rotations (p, 3, 3): n (p, 3)."""
    return np.einsum("pkl,pl->pk", R, elements.normals[elements.parent])


def tension_moduli(elements: Elements, R: Floats, F: Floats, least: float) -> Floats:
    """Moduli A (p, 3, 3, 3, 3) of the geometric stiffness, as of a tangent of `element`."""
    n = turned_normals(elements, R)
    # A_knlm = n_k n_l S_nm
    return np.einsum("pk,pl,pnm->pknlm", n, n, positive_tension(elements, R, F, least))


def tension_forces(elements: Elements, R: Floats, F: Floats, vectors: Floats) -> Floats:
    """Geometric stiffness times vectors (p, 3, 3) at the corners of cells: forces (p, 3, 3)."""
    n, S = turned_normals(elements, R), positive_tension(elements, R, F, 0.0)
    b, w = elements.gradients[elements.parent], elements.volumes
    # f_i = w n (b_i · S ∇φ), ∇φ = Σ_j b_j (n · v_j)
    slope = b.transpose(0, 2, 1) @ (vectors @ n[:, :, None])
    return w[:, None, None] * (b @ S @ slope) * n[:, None, :]


def positive_tension(elements: Elements, R: Floats, F: Floats, least: float) -> Floats:
    """Positive part (p, 3, 3) of the tension of membranes, α I + β U in the tangent plane.

    Principal values below `least` times μ are taken as that: without it what is slack has no
    stiffness.
    """
    lam, mu = elements.lam[elements.parent], elements.mu[elements.parent]
    U = R.transpose(0, 2, 1) @ F
    U = 0.5 * (U + U.transpose(0, 2, 1))
    trace, square = np.einsum("pkk->p", U), np.einsum("pkl,pkl->p", U, U)
    gap = np.sqrt(np.maximum(2.0 * square - trace**2, 0.0))
    high, low = 0.5 * (trace + gap), 0.5 * (trace - gap)

    def tension(stretch: Floats) -> Floats:
        carries = stretch > _COLLAPSED
        value = 2.0 * mu * (stretch - 1.0) + lam * (trace - 2.0)
        return np.maximum(
            least * mu, np.where(carries, value / np.where(carries, stretch, 1.0), -np.inf)
        )

    first, second = tension(high), tension(low)
    apart = gap > 1e-12 * trace
    beta = np.where(apart, (first - second) / np.where(apart, gap, 1.0), 0.0)
    alpha = np.where(apart, first - beta * high, 0.5 * (first + second))
    return alpha[:, None, None] * np.eye(3) + beta[:, None, None] * U
