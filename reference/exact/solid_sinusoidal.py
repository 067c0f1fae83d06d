"""F4 in space: plane waves along a plane cut, kept in equilibrium by a body force."""

import numpy as np

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.plane_cut import Above, PlaneCutSolution
from reference.exact.solution import Array


class SolidSinusoidal(PlaneCutSolution):
    """u_α = U_α − t ∂_α V, u_t = V − η t div U with U_1, U_2, V = A sin(k1 s1 + k2 s2 + φ).

    Parameters ``above`` and ``below``: rows (A, k1, k2, φ) of U_1, U_2 and V, φ in degrees; and
    the ``shift``. The body force is −div σ.
    """

    has_body_force = True

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._rows = np.stack([parameters.take(side, (3, 4)) for side in ("above", "below")])

    def _local_displacement(self, s: Array, above: Above) -> Array:
        t, wave = s[:, 2:], self._wave
        slope = np.column_stack([wave(s, above, 2, 1, 0), wave(s, above, 2, 0, 1)])
        plane = np.column_stack([wave(s, above, 0), wave(s, above, 1)])
        across = wave(s, above, 2) - self.law.eta * s[:, 2] * self._divergence(s, above)
        return np.column_stack([plane - t * slope, across])

    def _local_gradient(self, s: Array, above: Above) -> Array:
        t, wave = s[:, 2], self._wave
        gradient = np.empty((len(s), 3, 3))
        for i, a in enumerate([(1, 0), (0, 1)]):
            for j, b in enumerate([(1, 0), (0, 1)]):
                bend = wave(s, above, 2, a[0] + b[0], a[1] + b[1])
                gradient[:, i, j] = wave(s, above, i, *b) - t * bend
            gradient[:, i, 2] = -wave(s, above, 2, *a)
            gradient[:, 2, i] = wave(s, above, 2, *a) - self.law.eta * t * self._divergence(
                s, above, *a
            )
        gradient[:, 2, 2] = -self.law.eta * self._divergence(s, above)
        return gradient

    def _local_body_force(self, s: Array, above: Above) -> Array:
        lame, shear, t = self.law.lame, self.law.shear, s[:, 2]
        m = lame + 2 * shear
        columns = []
        for i, a in enumerate([(1, 0), (0, 1)]):
            force = -shear * self._laplacian(s, above, i)
            force -= 2 * shear * (lame + shear) / m * self._divergence(s, above, *a)
            columns.append(force + m * t * self._laplacian(s, above, 2, *a))
        of_divergence = self._divergence(s, above, 2, 0) + self._divergence(s, above, 0, 2)
        across = lame * self._laplacian(s, above, 2) + lame * shear / m * t * of_divergence
        return np.column_stack([*columns, across])

    def _wave(self, s: Array, above: Above, which: int, n1: int = 0, n2: int = 0) -> Array:
        """Give the derivative ∂₁ⁿ¹ ∂₂ⁿ² of U_1, U_2 or V, (n,)."""
        size, k1, k2, phase = np.where(above[:, None], self._rows[0, which], self._rows[1, which]).T
        angle = k1 * s[:, 0] + k2 * s[:, 1] + np.deg2rad(phase) + (n1 + n2) * np.pi / 2
        return np.asarray(size * k1**n1 * k2**n2 * np.sin(angle))

    def _divergence(self, s: Array, above: Above, n1: int = 0, n2: int = 0) -> Array:
        return self._wave(s, above, 0, n1 + 1, n2) + self._wave(s, above, 1, n1, n2 + 1)

    def _laplacian(self, s: Array, above: Above, which: int, n1: int = 0, n2: int = 0) -> Array:
        return self._wave(s, above, which, n1 + 2, n2) + self._wave(s, above, which, n1, n2 + 2)
