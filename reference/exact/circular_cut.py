"""A disc or a ball cut out of a body that is drawn outwards all around: a jump without a tip."""

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution, box_of
from verify.errors import InputError
from verify.scene import Scene

_GAUSS = np.polynomial.legendre.leggauss(40)


class CircularCut(ExactSolution):
    """The disc or ball r < b at rest; outside u_r = A r + B r^(1−d), free of traction at r = b.

    Lamé's fields: (dλ+2μ) A = 2(d−1)μ B/b^d, with d = 2 in the plane and 3 in space. The inner
    side is the positive one: left of an arc that runs counter-clockwise.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``centre`` (m, default the origin), ``radius`` b of the cut (m), and the displacement
        ``outward`` (m) at the distance ``at`` (m) from the centre.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        d = law.dimension
        self._centre = parameters.take("centre", (d,), default=(0.0,) * d)
        self._b = parameters.positive("radius")
        outward, at = float(parameters.take("outward", ())), parameters.positive("at")
        if at <= self._b:
            raise InputError(
                f"parameters.at = {at:g} lies inside the cut of radius {self._b:g}; expected a "
                "distance outside it"
            )
        inverse = (d * law.lame + 2 * law.shear) / (2 * (d - 1) * law.shear) * self._b**d
        self._a = outward / (at + inverse * at ** (1 - d))
        self._inverse = self._a * inverse

    def _from_centre(self, points: Array, near: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        decides = np.asarray(points if near is None else near) - self._centre
        inside = np.linalg.norm(decides, axis=1) <= self._b
        return np.asarray(points, dtype=float) - self._centre, inside

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d), m; see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        power = np.linalg.norm(r, axis=1) ** self.dimension
        factor = self._a + self._inverse / np.where(inside, np.inf, power)
        return np.asarray(np.where(inside, 0.0, factor)[:, None] * r)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d); see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        d, squared = self.dimension, np.where(inside, np.inf, np.sum(r**2, axis=1))
        round_ = self._inverse / squared ** (d / 2)
        found = (self._a + round_)[:, None, None] * np.eye(d)
        found -= (d * round_ / squared)[:, None, None] * r[:, :, None] * r[:, None, :]
        return np.asarray(np.where(inside[:, None, None], 0.0, found))

    def strain_energy(self, body: Array | Scene) -> float:
        """Strain energy of a body, J; see `ExactSolution`. A box may reach into the ball."""
        if self.dimension == 2:
            return super().strain_energy(body)
        lame, shear, b = self.law.lame, self.law.shear, self._inverse
        uniform = 1.5 * (3 * lame + 2 * shear) * self._a**2
        return _radial_energy(box_of(body), self._centre, self._b, (uniform, 6 * shear * b**2))

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Where a segment crosses the cut; see `ExactSolution`."""
        along, away = end - start, start - self._centre
        a, b, c = along @ along, along @ away, away @ away - self._b**2
        root = b * b - a * c
        if root <= 0.0:
            return []
        both = ((-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a)
        return [float(share) for share in both if 0.0 < share < 1.0]


def _radial_energy(
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
