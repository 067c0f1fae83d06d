"""F3: a curved field without body force on each side of a traction-free straight cut."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.straight_cut import StraightCutSolution, side


class Airy(StraightCutSolution):
    """Airy stress function cos ks·[C (t cosh kt − sinh kt/k) + D t sinh kt] per side.

    Parameters ``above`` and ``below``, each (C, D, k), and ``shift`` of u_t.
    """

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._c, self._d, self._k = np.column_stack(
            [parameters.take("above", (3,)), parameters.take("below", (3,))]
        )

    def _local_displacement(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        k = side(self._k, above)
        along, across, _, _ = self._profiles(t, above)
        return np.sin(k * s) * along, -np.cos(k * s) * across

    def _local_gradient(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array, Array]:
        k = side(self._k, above)
        along, across, along_t, across_t = self._profiles(t, above)
        sin, cos = np.sin(k * s), np.cos(k * s)
        return k * cos * along, sin * along_t, k * sin * across, -cos * across_t

    def _profiles(self, t: Array, above: NDArray[np.bool_]) -> tuple[Array, Array, Array, Array]:
        """Functions of t in u_s and u_t, and their derivatives."""
        lame, shear = self.law.lame, self.law.shear
        c, d, k = (side(pair, above) for pair in (self._c, self._d, self._k))
        ch, sh, both, m = np.cosh(k * t), np.sinh(k * t), k * (lame + shear), lame + 2 * shear
        scale = 1.0 / (2 * shear * (lame + shear))
        along = c * (both * t * ch + shear * sh) + d * (both * t * sh + m * ch)
        across = c * (both * t * sh - m * ch) + d * (both * t * ch - shear * sh)
        rise, fall = both * (ch + k * t * sh), both * (sh + k * t * ch)
        along_t = c * (rise + shear * k * ch) + d * (fall + m * k * sh)
        across_t = c * (fall - m * k * sh) + d * (rise - shear * k * ch)
        return scale * along, scale * across, scale * along_t, scale * across_t
