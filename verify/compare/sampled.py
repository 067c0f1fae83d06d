"""A field that remembers what it was at the points of a rule.

Several metrics ask the same field at the same points, and several solvers are compared with
the same reference: finding the cells once is most of the work.
"""

import numpy as np
from numpy.typing import NDArray

from verify.compare.locate import Field

Array = NDArray[np.float64]


class Sampled:
    """`field`, with its values kept per array of points (by identity; arrays must not change)."""

    def __init__(self, field: Field) -> None:
        self._field = field
        self._kept: dict[tuple[int, int, str], tuple[Array, Array | None, Array]] = {}

    def _at(self, what: str, points: Array, near: Array | None) -> Array:
        key = id(points), id(near)
        if (*key, what) not in self._kept:
            evaluate = getattr(self._field, "evaluate", None)
            if evaluate is None:  # a formula: only what is asked for
                found = {what: getattr(self._field, what)(points, near)}
            else:
                found = dict(zip(("displacement", "gradient"), evaluate(points, near), strict=True))
            for name, values in found.items():  # holds the arrays, so ids stay theirs
                self._kept[(*key, name)] = points, near, values
        return self._kept[(*key, what)][2]

    def displacement(self, points: Array, near: Array | None = None) -> Array:
        """Displacement (n, d) in m at `points` (n, d)."""
        return self._at("displacement", points, near)

    def gradient(self, points: Array, near: Array | None = None) -> Array:
        """Displacement gradient (n, d, d) at `points` (n, d)."""
        return self._at("gradient", points, near)
