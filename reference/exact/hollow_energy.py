"""Strain energy of Lamé's field around a hollow ball, in a box that the ball may reach out of."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from reference.exact.field import Array

_GAUSS = np.polynomial.legendre.leggauss(40)


def radial_energy(
    corners: Array, centre: Array, radius: float, terms: tuple[float, float]
) -> float:
    """Integral over a box, outside a ball, of the density w₀ + w₁/r⁶, J.

    With g r³ = ∫_b^r s² (w₀ + w₁/s⁶) ds, which is 0 inside the ball, the density is div(x g). Its
    flux through a face at the distance h is h ∫ g dA; with G(ϱ) = ∫_0^ϱ g s ds around the foot of
    the centre that is Σ ∫ G (ξ dη − η dξ)/ϱ² over the edges.

    Parameters
    ----------
    corners : (2, 3) array
        Lower and upper corner of the box, m.
    centre : (3,) array
    radius : float
        b, m.
    terms : (float, float)
        w₀ (J/m³) and w₁ (J m³).
    """
    w0, w1, b = *terms, radius

    def primitive(r: Array) -> Array:
        """∫ g r dr from b to r ≥ b."""

        def at(r: Array) -> Array:
            return np.asarray(
                w0 / 3 * (r**2 / 2 + b**3 / r) + w1 / 3 * (0.25 / r**4 - 1.0 / (b**3 * r))
            )

        return at(np.maximum(r, b)) - at(np.asarray(b))

    low, high = corners - centre
    total = 0.0
    for axis in range(3):
        across = [k for k in range(3) if k != axis]
        rectangle = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
        outline = np.where(rectangle, high[across], low[across])
        for height in (high[axis], -low[axis]):
            total += height * _over_rectangle(outline, abs(height), b, primitive)
    return total


def _over_rectangle(
    outline: Array, height: float, radius: float, primitive: Callable[[Array], Array]
) -> float:
    """∫ g dA over a rectangle (4, 2) around the foot of the centre, which may lie outside it."""
    found = 0.0
    inner = primitive(np.asarray(height))  # G starts at the foot
    for start, end in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        edge = end - start
        moment = start[0] * edge[1] - start[1] * edge[0]
        for low, high in _smooth_parts(start, edge, height, radius):
            share = low + (high - low) * 0.5 * (_GAUSS[0] + 1.0)
            squared = np.sum((start + share[:, None] * edge) ** 2, axis=1)
            value = primitive(np.sqrt(squared + height**2)) - inner
            found += moment * 0.5 * (high - low) * float(value / squared @ _GAUSS[1])
    return found


def _smooth_parts(
    start: Array, edge: Array, height: float, radius: float
) -> list[tuple[float, float]]:
    """Parts of [0, 1], halved towards the point next to the foot, without the sphere inside."""
    a, b = edge @ edge, edge @ start
    stops = {0.0, 1.0, float(np.clip(-b / a, 0.0, 1.0))}
    root = b * b - a * (start @ start + height**2 - radius**2)
    if root > 0.0:
        stops |= {float(s) for s in ((-b - root**0.5) / a, (-b + root**0.5) / a) if 0 < s < 1}
    nearest = np.clip(-b / a, 0.0, 1.0)
    for k in range(1, 12):
        stops |= {float(nearest * (1 - 0.5**k)), float(nearest + (1 - nearest) * 0.5**k)}
    ordered = sorted(stops)
    return [(s, t) for s, t in pairwise(ordered) if t > s]
