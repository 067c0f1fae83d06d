"""F1 in space: a uniform strain on each side of a plane cut, free of traction at the cut."""

import numpy as np

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.plane_cut import Above, PlaneCutSolution
from reference.exact.solution import Array


class SolidPatch(PlaneCutSolution):
    """u = (ε1 s1, ε2 s2, −η (ε1 + ε2) t) + shift, with ``strain`` rows (ε1, ε2) per side."""

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law, parameters)
        along = parameters.take("strain", (2, 2))
        self._strain = np.column_stack([along, -law.eta * along.sum(axis=1)])

    def _local_displacement(self, s: Array, above: Above) -> Array:
        return np.where(above[:, None], self._strain[0], self._strain[1]) * s

    def _local_gradient(self, s: Array, above: Above) -> Array:
        strain = np.where(above[:, None], self._strain[0], self._strain[1])
        return strain[:, :, None] * np.eye(3)
