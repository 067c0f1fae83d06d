"""F2: pure bending of each side, free of traction at the cut."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.straight_cut import StraightCutSolution, side


class Bending(StraightCutSolution):
    """σ_ss = k t: u_s = k/E'·s t, u_t = −k/(2E')·(s² + η t²) + shift.

    Parameters ``stress_gradient`` k (Pa/m) and ``shift`` (m) per side.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._curvature = parameters.take("stress_gradient", (2,)) / law.plane_modulus

    def _local_displacement(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        c = side(self._curvature, above)
        return c * s * t, -0.5 * c * (s**2 + self.law.eta * t**2)

    def _local_gradient(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array, Array]:
        c = side(self._curvature, above)
        return c * t, c * s, -c * s, -self.law.eta * c * t
