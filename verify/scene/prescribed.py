"""Prescribed motion of the points that a support holds, by its own values or an exact field."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from verify.scene.history import factor_at, slope_at
from verify.scene.physics import Support

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedMotion:
    """Displacement and velocity of the points that a support holds.

    Attributes
    ----------
    support : Support
    points : (k, d) array
        In m.
    near : (k, d) array or None
        Points of the material that the points move, which say on which side of a cut they are, m;
        None: the points themselves say it.
    exact : object or None
        The exact solution, where the support says ``"exact"``.
    """

    support: Support
    points: Array
    near: Array | None
    exact: Any

    @property
    def moves(self) -> bool:
        """Whether the values change in time."""
        timed = self.support.timed if self.exact is None else self.exact.moves
        return bool(timed or self.support.history)

    def values(self, factor: float, time: float = 0.0) -> Array:
        """Prescribed displacement (k, held), m, of a factor of the history at a time in s."""
        if self.exact is None:
            return self.support.values(self.points, factor, time)
        return factor * self._held(self.exact.at(time).displacement(self.points, self.near))

    def velocities(self, time: float) -> Array:
        """Prescribed velocity (k, held), m/s, at a time in s; after a kink there."""
        history = self.support.history
        factor, slope = factor_at(history, time), slope_at(history, time)
        if self.exact is None:
            return self.support.velocities(self.points, factor, slope, time)
        field = self.exact.at(time)
        speed = factor * field.velocity(self.points, self.near)
        if slope:
            speed = speed + slope * field.displacement(self.points, self.near)
        return self._held(speed)

    def _held(self, values: Array) -> Array:
        return np.asarray(values[:, list(self.support.held(values.shape[1]))])
