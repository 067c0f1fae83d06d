"""A disc or a ball cut out of a body that is drawn outwards all around: a jump without a tip."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hollow_energy import radial_energy
from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solid_energy import box_of
from reference.exact.solution import Array, ExactSolution
from verify.errors import InputError
from verify.scene import Scene


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
        return radial_energy(box_of(body), self._centre, self._b, (uniform, 6 * shear * b**2))

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Where a segment crosses the cut; see `ExactSolution`."""
        along, away = end - start, start - self._centre
        a, b, c = along @ along, along @ away, away @ away - self._b**2
        root = b * b - a * c
        if root <= 0.0:
            return []
        both = ((-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a)
        return [float(share) for share in both if 0.0 < share < 1.0]
