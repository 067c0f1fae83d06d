"""F1: a uniform strain on each side of a straight cut, free of traction at the cut."""

import numpy as np
from numpy.typing import NDArray

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array
from reference.exact.straight_cut import StraightCutSolution, side


class Patch(StraightCutSolution):
    """u_s = ε s, u_t = −η ε t + shift, with ``strain`` ε and ``shift`` per side."""

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        self._strain = parameters.take("strain", (2,))

    def _local_displacement(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array]:
        strain = side(self._strain, above)
        return strain * s, -self.law.eta * strain * t

    def _local_gradient(
        self, s: Array, t: Array, above: NDArray[np.bool_]
    ) -> tuple[Array, Array, Array, Array]:
        strain = side(self._strain, above)
        zero = np.zeros_like(s)
        return strain, zero, zero, -self.law.eta * strain
