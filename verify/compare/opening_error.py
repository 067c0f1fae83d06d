"""Error of the opening profile: the normal displacement jump along the cuts."""

import numpy as np

from verify.compare.cut_line import CutRule
from verify.compare.error_norm import ErrorNorm
from verify.compare.jump_error import displacement_jump
from verify.compare.locate import Field


def opening_error(field: Field, reference: Field, rule: CutRule) -> ErrorNorm:
    """‖[u_n] − [u_ref,n]‖ and ‖[u_ref,n]‖ in L2 of the cuts as asked."""
    difference, expected = _profiles(field, reference, rule)
    return ErrorNorm(
        float(np.sqrt(rule.weights @ difference**2)), float(np.sqrt(rule.weights @ expected**2))
    )


def opening_maximum_error(field: Field, reference: Field, rule: CutRule) -> ErrorNorm:
    """Largest |[u_n] − [u_ref,n]| and |[u_ref,n]| along the cuts as asked, m."""
    difference, expected = _profiles(field, reference, rule)
    return ErrorNorm(
        float(np.abs(difference).max(initial=0.0)), float(np.abs(expected).max(initial=0.0))
    )


def _profiles(field: Field, reference: Field, rule: CutRule) -> tuple[np.ndarray, np.ndarray]:
    expected = np.sum(displacement_jump(reference, rule) * rule.normals, axis=1)
    found = np.sum(displacement_jump(field, rule) * rule.normals, axis=1)
    return found - expected, expected
