"""A disc cut out of a body that is drawn outwards all around: a jump without a tip."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution
from verify.errors import InputError

__all__ = ["CircularCut"]


class CircularCut(ExactSolution):
    """The disc r < b at rest; outside u_r = A r + B/r, free of traction at r = b (Lamé).

    With 2(λ+μ) A = 2μ B/b². The side inside the disc is the positive one: left of an arc that
    runs counter-clockwise.

    Parameters
    ----------
    law : Hooke
    parameters : Parameters
        ``centre`` (m, default the origin), ``radius`` b of the cut (m), and the displacement
        ``outward`` (m) at the distance ``at`` (m) from the centre.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        self._centre = parameters.take("centre", (2,), default=(0.0, 0.0))
        self._b = parameters.positive("radius")
        outward, at = float(parameters.take("outward", ())), parameters.positive("at")
        if at <= self._b:
            raise InputError(
                f"parameters.at = {at:g} lies inside the cut of radius {self._b:g}; expected a "
                "distance outside it"
            )
        inverse = (law.lame + law.shear) / law.shear * self._b**2
        self._a = outward / (at + inverse / at)
        self._inverse = self._a * inverse

    def _from_centre(self, points: Array, near: Array | None) -> tuple[Array, NDArray[np.bool_]]:
        decides = np.asarray(points if near is None else near) - self._centre
        inside = np.linalg.norm(decides, axis=1) <= self._b
        return np.asarray(points, dtype=float) - self._centre, inside

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 2), m; see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        squared = np.sum(r**2, axis=1)
        factor = self._a + self._inverse / np.where(inside, np.inf, squared)
        return np.asarray(np.where(inside, 0.0, factor)[:, None] * r)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 2, 2); see `ExactSolution`."""
        r, inside = self._from_centre(points, near)
        squared = np.where(inside, np.inf, np.sum(r**2, axis=1))
        round_ = self._inverse / squared
        found = (self._a + round_)[:, None, None] * np.eye(2)
        found -= (2 * round_ / squared)[:, None, None] * r[:, :, None] * r[:, None, :]
        return np.asarray(np.where(inside[:, None, None], 0.0, found))

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Where a segment crosses the cut; see `ExactSolution`."""
        along, away = end - start, start - self._centre
        a, b, c = along @ along, along @ away, away @ away - self._b**2
        root = b * b - a * c
        if root <= 0.0:
            return []
        both = ((-b - np.sqrt(root)) / a, (-b + np.sqrt(root)) / a)
        return [float(share) for share in both if 0.0 < share < 1.0]
