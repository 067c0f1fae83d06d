"""A field that remembers what it was at the points of a rule.

Several metrics ask the same field at the same points, and several solvers are compared with
the same reference: finding the cells once is most of the work.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.locate import Field

__all__ = ["Sampled"]

Array = NDArray[np.float64]


class Sampled:
    """`field`, with its values kept per array of points (by identity; arrays must not change)."""

    def __init__(self, field: Field) -> None:
        self._field = field
        self._kept: dict[tuple[int, int], tuple[Array, Array | None, Array, Array]] = {}

    def _at(self, points: Array, near: Array | None) -> tuple[Array, Array]:
        key = id(points), id(near)
        if key not in self._kept:
            evaluate = getattr(self._field, "evaluate", None)
            u, gradient = (
                evaluate(points, near)
                if evaluate is not None
                else (self._field.displacement(points, near), self._field.gradient(points, near))
            )
            self._kept[key] = points, near, u, gradient  # holds the arrays, so ids stay theirs
        return self._kept[key][2:]

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d) in m at `points` (n, d)."""
        return self._at(points, near)[0]

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d) at `points` (n, d)."""
        return self._at(points, near)[1]
