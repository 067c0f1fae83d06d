"""L2 error of the displacement jump along the cuts."""

import numpy as np
from numpy.typing import NDArray

from verify.compare.cut_line import CutRule
from verify.compare.error_norm import ErrorNorm
from verify.compare.locate import Field


def displacement_jump(field: Field, rule: CutRule) -> NDArray[np.float64]:
    """Displacement (n, d) of the positive side minus that of the negative side, m."""
    above = field.displacement(rule.points, rule.positive)
    return above - field.displacement(rule.points, rule.negative)


def jump_error(field: Field, reference: Field, rule: CutRule) -> ErrorNorm:
    """‖[u] − [u_ref]‖ and ‖[u_ref]‖ in L2 of the cuts as asked."""
    expected = displacement_jump(reference, rule)
    difference = displacement_jump(field, rule) - expected
    return ErrorNorm(
        float(np.sqrt(rule.weights @ np.sum(difference**2, axis=1))),
        float(np.sqrt(rule.weights @ np.sum(expected**2, axis=1))),
    )
