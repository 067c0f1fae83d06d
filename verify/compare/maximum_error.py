"""Largest error of the displacement."""

import numpy as np

from verify.compare.error_norm import ErrorNorm
from verify.compare.locate import Field
from verify.compare.slabs import Rule


def maximum_error(field: Field, reference: Field, rule: Rule) -> ErrorNorm:
    """Largest |u − u_ref| and |u_ref| over the points of a rule, m.

    The points lie close to everything but do not hit the maximum: the difference between
    rules, taken as the integration error, says how much that matters.
    """
    expected = reference.displacement(rule.points, rule.points)
    difference = field.displacement(rule.points, rule.points) - expected
    return ErrorNorm(
        float(np.linalg.norm(difference, axis=1).max()),
        float(np.linalg.norm(expected, axis=1).max()),
    )
