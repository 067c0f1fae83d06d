"""Straight cracks in the plane by complex potentials (Kolosov–Muskhelishvili).

In the axes of the crack, z = x + iy, with functions φ, ω that are analytic off the crack,

    2μ (u + iv) = κ φ(z) − ω(z̄) − (z − z̄) conj φ'(z),

which leaves the faces y = 0± free of traction wherever φ± = −ω∓ there up to a constant.
"""

from abc import abstractmethod
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.solution import Array, ExactSolution

Complex = NDArray[np.complex128]


class Potentials(NamedTuple):
    """Values (n,) of φ, φ', φ'' at z and of ω, ω' at z̄."""

    phi: Complex
    phi_1: Complex
    phi_2: Complex
    omega: Complex
    omega_1: Complex


class ComplexCrack(ExactSolution):
    """A straight crack on the x axis of its own frame.

    Parameters
    ----------
    law : Hooke
    origin : (2,) array
        Origin of the frame, m.
    angle : float
        Angle of its x axis, degrees.
    """

    def __init__(self, law: Hooke, origin: Array, angle: float) -> None:
        super().__init__(law)
        c, s = np.cos(np.deg2rad(angle)), np.sin(np.deg2rad(angle))
        self._origin = origin
        self._axes = np.array([[c, s], [-s, c]])

    @abstractmethod
    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        """Potentials; `sheet` is −1 where the root is to be continued across the crack."""

    @abstractmethod
    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        """Whether points of the x axis lie on the crack."""

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, 2), m; see `ExactSolution`."""
        z, f = self._evaluate(points, near)
        # at a tip φ' is infinite, but its factor is zero there
        slope = np.where(z.imag == 0.0, 0.0, f.phi_1)
        w = self.law.kolosov * f.phi - f.omega - (z - z.conj()) * slope.conj()
        w = w / (2 * self.law.shear)
        return np.column_stack([w.real, w.imag]) @ self._axes

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, 2, 2), nan at a tip. See `ExactSolution`."""
        z, f = self._evaluate(points, near)
        with np.errstate(invalid="ignore"):  # at a tip ∞ − ∞: the limit depends on the way there
            dz = self.law.kolosov * f.phi_1 - f.phi_1.conj()
            dz_bar = -f.omega_1 + f.phi_1.conj() - (z - z.conj()) * f.phi_2.conj()
        along_x = (dz + dz_bar) / (2 * self.law.shear)
        along_y = 1j * (dz - dz_bar) / (2 * self.law.shear)
        rows = [along_x.real, along_y.real, along_x.imag, along_y.imag]
        turned: Array = self._axes.T @ np.stack(rows, axis=1).reshape(-1, 2, 2) @ self._axes
        return turned

    def kinks(self, start: Array, end: Array) -> list[float]:
        """Find where the segment from `start` to `end` meets the crack."""
        (x0, y0), (x1, y1) = (np.stack([start, end]) - self._origin) @ self._axes.T
        if y0 == y1:
            return []
        t = float(y0 / (y0 - y1))
        return [t] if 0.0 < t < 1.0 and self._on_crack(np.array([x0 + t * (x1 - x0)]))[0] else []

    def potentials(self, points: Array, near: Array | None = None) -> Potentials:
        """Potentials at points (n, 2), on the sides of `near` (n, 2)."""
        return self._evaluate(points, near)[1]

    def _evaluate(self, points: Array, near: Array | None) -> tuple[Complex, Potentials]:
        x, y = ((np.asarray(points, dtype=float) - self._origin) @ self._axes.T).T
        y = y + 0.0  # −0 would choose the lower face
        sheet = np.ones(len(x))
        if near is not None:
            x_n, y_n = ((np.asarray(near, dtype=float) - self._origin) @ self._axes.T).T
            y = np.where((y == 0.0) & (y_n < 0.0), -0.0, y)
            across = y * y_n < 0.0
            # where the way from `near` crosses the x axis
            share = np.divide(y_n, y_n - y, out=np.zeros_like(y), where=across)
            sheet[across & self._on_crack(x_n + share * (x - x_n))] = -1.0
        z = np.empty(len(x), dtype=complex)
        z.real, z.imag = x, y  # x + 1j*y would lose the sign of −0
        with np.errstate(divide="ignore", invalid="ignore"):
            return z, self._potentials(z, sheet)
