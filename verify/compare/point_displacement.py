"""Displacement of a point of the body."""

from collections.abc import Sequence

import numpy as np

from verify.compare.locate import Field


def point_displacement(field: Field, point: Sequence[float], component: str) -> float:
    """Displacement in m of `point` in direction ``x``, ``y`` or ``z``."""
    at = np.array([point], dtype=float)
    return float(field.displacement(at, at)[0, "xyz".index(component)])
