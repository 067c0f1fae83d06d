"""A uniform strain: what an uncut body must reproduce to round-off."""

import numpy as np

from reference.exact.hooke import Hooke
from reference.exact.parameters import Parameters
from reference.exact.solution import Array, ExactSolution


class Linear(ExactSolution):
    """u = G x + shift, with ``matrix`` G (d rows) and ``shift``; in the plane or in space."""

    def __init__(self, law: Hooke, parameters: Parameters) -> None:
        super().__init__(law)
        d = law.dimension
        self._matrix = parameters.take("matrix", (d, d))
        self._shift = parameters.take("shift", (d,), default=np.zeros(d))

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d), m."""
        return np.asarray(points, dtype=float) @ self._matrix.T + self._shift

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d)."""
        return np.broadcast_to(self._matrix, (len(points), *self._matrix.shape)).copy()
