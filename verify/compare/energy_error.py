"""Error in the energy norm."""

import numpy as np

from verify.compare.error_norm import ErrorNorm
from verify.compare.hooke import Law
from verify.compare.locate import Field
from verify.compare.slabs import Rule

__all__ = ["energy_error"]

# Strain over gradient below which a reference is a rigid motion, solved to round-off.
_NO_STRAIN = 1e-10


def energy_error(field: Field, reference: Field, rule: Rule, law: Law) -> ErrorNorm:
    """Square roots of ∫(σ−σ_ref):(ε−ε_ref) and ∫σ_ref:ε_ref over the body, in √J.

    With the corotated energy: of twice its `error_density`, and twice the reference's energy.
    A reference that moves rigidly but for round-off has the norm 0.
    """
    law = law.at(rule.points)
    expected = rule.gradient(reference)
    difference = rule.gradient(field) - expected
    scale = float(np.sqrt(2 * rule.weights @ law.energy_density(expected)))
    square = law.shear * np.sum(expected**2, axis=(1, 2))
    whole = float(np.sqrt(2 * rule.weights @ square))
    return ErrorNorm(
        float(np.sqrt(2 * rule.weights @ law.error_density(difference, expected))),
        scale if scale > _NO_STRAIN * whole else 0.0,
    )
