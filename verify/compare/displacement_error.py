"""L2 error of the displacement."""

import numpy as np

from verify.compare.error_norm import ErrorNorm
from verify.compare.locate import Field
from verify.compare.slabs import Rule

__all__ = ["displacement_error"]


def displacement_error(field: Field, reference: Field, rule: Rule) -> ErrorNorm:
    """‖u − u_ref‖ and ‖u_ref‖ in L2 of the body; units m·m (2D), m·m^1.5 (3D)."""
    expected = reference.displacement(rule.points, rule.points)
    difference = field.displacement(rule.points, rule.points) - expected
    return ErrorNorm(
        float(np.sqrt(rule.weights @ np.sum(difference**2, axis=1))),
        float(np.sqrt(rule.weights @ np.sum(expected**2, axis=1))),
    )
