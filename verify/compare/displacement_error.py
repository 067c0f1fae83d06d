"""L2 error of the displacement."""

import numpy as np

from verify.compare.error_norm import ErrorNorm, Squares
from verify.compare.locate import Field
from verify.compare.slabs import Rule


def displacement_error(field: Field, reference: Field, rule: Rule) -> ErrorNorm:
    """‖u − u_ref‖ and ‖u_ref‖ in L2 of the body; units m·m (2D), m·m^1.5 (3D)."""
    return displacement_squares(field, reference, rule).norm(rule.weights)


def displacement_squares(field: Field, reference: Field, rule: Rule) -> Squares:
    """|u − u_ref|² and |u_ref|² at the points of a rule, m²."""
    expected = reference.displacement(rule.points, rule.points)
    difference = field.displacement(rule.points, rule.points) - expected
    return Squares(
        np.einsum("ni,ni->n", difference, difference), np.einsum("ni,ni->n", expected, expected)
    )
