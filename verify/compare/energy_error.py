"""Error in the energy norm."""

import numpy as np

from verify.compare.error_norm import ErrorNorm, Squares
from verify.compare.hooke import Law
from verify.compare.locate import Field
from verify.compare.slabs import Rule

# Strain over gradient below which a reference is a rigid motion, solved to round-off.
_NO_STRAIN = 1e-10


def energy_error(field: Field, reference: Field, rule: Rule, law: Law) -> ErrorNorm:
    """Square roots of ∫(σ−σ_ref):(ε−ε_ref) and ∫σ_ref:ε_ref over the body, in √J.

    With the corotated energy: of twice its `error_density`, and twice the reference's energy.
    A reference that moves rigidly but for round-off has the norm 0.
    """
    return energy_squares(field, reference, rule, law).norm(rule.weights)


def energy_squares(field: Field, reference: Field, rule: Rule, law: Law) -> Squares:
    """Integrands of the squares of `energy_error` at the points of a rule, J/m^d."""
    law = law.at(rule.points)
    expected = rule.gradient(reference)
    difference = rule.gradient(field) - expected
    scale = 2 * law.energy_density(expected)
    square = law.shear * np.einsum("nij,nij->n", expected, expected)
    if np.sqrt(rule.weights @ scale) <= _NO_STRAIN * np.sqrt(2 * rule.weights @ square):
        scale = np.zeros_like(scale)
    return Squares(2 * law.error_density(difference, expected), scale)
