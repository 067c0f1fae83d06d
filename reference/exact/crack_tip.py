"""The singular field at the tip of a crack, modes I and II."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.complex_crack import Complex, ComplexCrack, Potentials
from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array


class CrackTip(ComplexCrack):
    """φ = ω = (K_I − i K_II) √(z/2π); the crack lies on x < 0 of the frame of the tip.

    Parameters ``tip`` (m), ``angle`` of the direction in which the crack points (degrees,
    default 0) and ``intensity`` (K_I, K_II), Pa·√m.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        tip = parameters.take("tip", (2,))
        super().__init__(law, tip, float(parameters.take("angle", (), default=0.0)))
        k_1, k_2 = parameters.take("intensity", (2,))
        self._k = complex(k_1, -k_2) / np.sqrt(2 * np.pi)

    @property
    def singular_points(self) -> Array:
        """The tip (1, 2)."""
        return self._origin[None]

    @property
    def stress_intensity(self) -> tuple[float, float]:
        """K_I and K_II, Pa·√m."""
        k = self._k * np.sqrt(2 * np.pi)
        return float(k.real), float(-k.imag)

    def _on_crack(self, x: Array) -> NDArray[np.bool_]:
        return np.asarray(x < 0.0)

    def _potentials(self, z: Complex, sheet: Array) -> Potentials:
        root = sheet * np.sqrt(z)
        bar = root.conj()
        k = self._k
        return Potentials(k * root, 0.5 * k / root, -0.25 * k / root**3, k * bar, 0.5 * k / bar)
