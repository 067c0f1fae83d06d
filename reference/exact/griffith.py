"""A straight crack in an infinite plate under any remote stress (Griffith's crack)."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.complex_crack import Complex, ComplexCrack, Potentials
from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array

__all__ = ["Griffith"]


class Griffith(ComplexCrack):
    """φ = ½ S R + Γ z, ω = ½ S R − Γ z, with R = √(z−a) √(z+a).

    S = σ_yy − iσ_xy and Γ = (σ_xx − σ_yy)/4 + iσ_xy/2 of the remote stress in the crack's
    axes. Parameters ``centre`` (m, default the origin), half-length ``a`` (m), ``angle``
    (degrees, default 0) and the remote ``stress`` (σ_xx, σ_yy, σ_xy) in the axes of the scene.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        centre = parameters.take("centre", (2,), default=(0.0, 0.0))
        super().__init__(law, centre, float(parameters.take("angle", (), default=0.0)))
        self._a = parameters.positive("a")
        s_xx, s_yy, s_xy = parameters.take("stress", (3,))
        local = self._axes @ np.array([[s_xx, s_xy], [s_xy, s_yy]]) @ self._axes.T
        self._s = complex(local[1, 1], -local[0, 1])
        self._gamma = complex((local[0, 0] - local[1, 1]) / 4, local[0, 1] / 2)

    @property
    def singular_points(self) -> Array:
        """Both tips (2, 2)."""
        reach: Array = self._a * self._axes[0]
        return np.stack([self._origin - reach, self._origin + reach])

    @property
    def stress_intensity(self) -> tuple[float, float]:
        """K_I and K_II, Pa·√m (negative K_I: the faces would overlap)."""
        root = np.sqrt(np.pi * self._a)
        return self._s.real * root, -self._s.imag * root

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(np.abs(x) < self._a)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        a, s, gamma = self._a, self._s, self._gamma
        # z ∓ a by parts, which keeps a negative zero of the imaginary part
        left, right = z.copy(), z.copy()
        left.real -= a
        right.real += a
        root = sheet * np.sqrt(left) * np.sqrt(right)
        bar = root.conj()
        return Potentials(
            0.5 * s * root + gamma * z,
            0.5 * s * z / root + gamma,
            np.asarray(-0.5 * s * a**2 / root**3, dtype=complex),
            0.5 * s * bar - gamma * z.conj(),
            0.5 * s * z.conj() / bar - gamma,
        )
