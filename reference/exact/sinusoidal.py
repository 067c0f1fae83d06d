"""F4: sinusoids along a straight cut, kept in equilibrium by a body force."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.straight_cut import StraightCutSolution, side


class Sinusoidal(StraightCutSolution):
    """u_s = U − t V', u_t = V − η t U' with U = A sin(k s + φ), V likewise, per side.

    Parameters ``above`` and ``below``: rows (A, k, φ) of U and of V, φ in degrees; ``shift``
    of u_t. The body force is −div σ.
    """

    has_body_force = True

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        rows = np.stack([parameters.take("above", (2, 3)), parameters.take("below", (2, 3))])
        rows[:, :, 2] = np.deg2rad(rows[:, :, 2])
        self._rows = rows  # side, function, (A, k, φ)

    def _local_displacement(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        U, V = self._derivatives(s, above)
        return U[0] - t * V[1], V[0] - self.law.eta * t * U[1]

    def _local_gradient(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array, Array]:
        U, V = self._derivatives(s, above)
        eta = self.law.eta
        return U[1] - t * V[2], -V[1], V[1] - eta * t * U[2], -eta * U[1]

    def _local_body_force(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        U, V = self._derivatives(s, above)
        lame, shear = self.law.lame, self.law.shear
        m = lame + 2 * shear
        along = -shear * (3 * lame + 4 * shear) / m * U[2] + m * t * V[3]
        return along, lame * V[2] + lame * shear / m * t * U[3]

    def _derivatives(self, s: Array, above: NDArray[np.bool_]) -> tuple[list[Array], list[Array]]:
        """U and V with their first three derivatives."""
        found = []
        for function in (0, 1):
            A, k, phase = (side(self._rows[:, function, i], above) for i in range(3))
            found.append([A * k**n * np.sin(k * s + phase + n * np.pi / 2) for n in range(4)])
        return found[0], found[1]
