"""Norms of the error of a field, the norms that they are divided by, and their quadrature error.

Finite element fields have kinks along edges that the neutral quadrature does not know. Its error is
estimated by two coarser rules in other directions: it is taken to be as large as the largest
difference among them, although the finest rule is the one that counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial, inf

import numpy as np
from numpy.typing import NDArray

from verify.compare.body import AnyBody, Body
from verify.compare.body_rule import Rule, area_rule, body_rule, slab_angles
from verify.compare.cut_rule import CutRule, cut_rule, membrane_cut_rule, surface_rule
from verify.compare.hooke import Law
from verify.compare.locate import Field, squares
from verify.compare.simplex_bodies import MembraneBody

Array = NDArray[np.float64]


# Of what cancels (a gradient, a displacement over the size of the body, a displacement on both
# sides of a cut) below which a strain or a jump is none: round-off of 1e-16, times the 1e6 that a
# solve, and elements of a thousandth of the body, may amplify it by. Nothing is divided by it.
_NOTHING = 1e-10
_LOOKED_AT = 200  # points at which the displacement of a body is looked at


@dataclass(frozen=True)
class ErrorNorm:
    """An error norm, and the same norm of the reference.

    Parameters
    ----------
    absolute : float
        Norm of the difference.
    scale : float
        Norm of the reference.
    """

    absolute: float
    scale: float

    @property
    def relative(self) -> float:
        """Relative error; infinite where something differs from a reference that is zero."""
        if self.absolute == 0.0:
            return 0.0
        return self.absolute / self.scale if self.scale > 0.0 else inf


@dataclass(frozen=True)
class Squares:
    """Integrands of the squares of both norms at the points of a rule.

    Near a tip and far from it the integrands are the same, with other weights.

    Parameters
    ----------
    difference, expected : (n,) arrays
        Of the difference and of the reference.
    """

    difference: Array
    expected: Array

    def norm(self, weights: Array, whole: Array | None = None) -> ErrorNorm:
        """Integrate with the weights (n,) of the points, the scale with the weights `whole`."""
        of_scale = weights if whole is None else whole
        return ErrorNorm(
            float(np.sqrt(weights @ self.difference)), float(np.sqrt(of_scale @ self.expected))
        )

    def above(self, share: float, whole: float, weights: Array) -> "Squares":
        """Set round-off to zero: the reference, and then a difference as small.

        A norm with the weights (n,) is round-off if it is at most a share of the root of `whole`.
        """
        bound = share**2 * whole
        if weights @ self.expected > bound:
            return self
        nothing = np.zeros_like(self.expected)
        small = weights @ self.difference <= bound
        return Squares(nothing if small else self.difference, nothing)

    def largest(self) -> ErrorNorm:
        """Compute largest values at the points.

        The points lie close to everything but do not hit the maximum: the difference between
        rules, taken as the integration error, says how much that matters.
        """
        return ErrorNorm(
            *(float(s.max(initial=0.0)) ** 0.5 for s in (self.difference, self.expected))
        )


def displacement_error(field: Field, reference: Field, rule: Rule) -> ErrorNorm:
    """Compute ‖u − u_ref‖ and ‖u_ref‖ in L2 of the body; units m·m (2D), m·m^1.5 (3D)."""
    return displacement_squares(field, reference, rule).norm(rule.weights)


def energy_error(field: Field, reference: Field, rule: Rule, law: Law) -> ErrorNorm:
    """Square roots of ∫(σ−σ_ref):(ε−ε_ref) and ∫σ_ref:ε_ref over the body, in √J.

    With the corotated energy: of twice its `error_density`, and twice the reference's energy.
    A reference that moves rigidly but for round-off has the norm 0, and errors as small are none.
    """
    return energy_squares(field, reference, rule, law).norm(rule.weights)


def jump_error(field: Field, reference: Field, rule: CutRule) -> ErrorNorm:
    """Compute ‖[u] − [u_ref]‖ and ‖[u_ref]‖ in L2 of the cuts as asked."""
    return jump_squares(field, reference, rule).norm(rule.weights)


def displacement_squares(
    field: Field, reference: Field, rule: Rule, law: Law | None = None
) -> Squares:
    """Compute |u − u_ref|² and |u_ref|² at the points of a rule, m²."""
    expected = reference.displacement(rule.points, rule.points)
    return _squares(field.displacement(rule.points, rule.points), expected)


def energy_squares(field: Field, reference: Field, rule: Rule, law: Law) -> Squares:
    """Compute integrands of the squares of `energy_error` at the points of a rule, J/m^d."""
    law = law.at(rule.points)
    difference, energy, entries = law.compared(rule.gradient(field), rule.gradient(reference))
    # a solution's field has both at once, a formula was asked for these before
    some = reference.displacement(rule.points, rule.points)[:: 1 + len(rule.points) // _LOOKED_AT]
    slope = np.abs(some).max(initial=0.0) / rule.extent if len(some) else 0.0
    cancels = 2 * law.shear * (entries + slope**2)
    found = Squares(2 * difference, 2 * energy)
    return found.above(_NOTHING, float(rule.weights @ cancels), rule.weights)


def jump_squares(field: Field, reference: Field, rule: CutRule, law: Law | None = None) -> Squares:
    """Compute |[u] − [u_ref]|² and |[u_ref]|² at the points of a rule of the cuts as asked, m²."""
    found, expected = displacement_jump(field, rule), displacement_jump(reference, rule)
    return _of_jumps(found, expected, reference, rule)


def opening_squares(
    field: Field, reference: Field, rule: CutRule, law: Law | None = None
) -> Squares:
    """Compute |[u_n] − [u_ref,n]|² and |[u_ref,n]|² of jump along the normal of the cuts, m²."""
    found, expected = (
        np.einsum("ni,ni->n", displacement_jump(one, rule), rule.normals)[:, None]
        for one in (field, reference)
    )
    return _of_jumps(found, expected, reference, rule)


def displacement_jump(field: Field, rule: CutRule) -> Array:
    """Subtract the displacement of the negative side from the positive side's, (n, d), m."""
    above = field.displacement(rule.points, rule.positive)
    return above - field.displacement(rule.points, rule.negative)


def _of_jumps(found: Array, expected: Array, reference: Field, rule: CutRule) -> Squares:
    beside = reference.displacement(rule.points, rule.positive)
    cancels = rule.weights @ np.einsum("ni,ni->n", beside, beside)
    return _squares(found, expected).above(_NOTHING, cancels, rule.weights)


def _squares(found: Array, expected: Array) -> Squares:
    return Squares(squares(found - expected), squares(expected))


# spacings over the wanted one, without small common multiples
_FAMILY = (1.0, 1.31, 1.73)
# The few elements at a tip hold most of the error; finer cells around it make the integration
# error of the energy norm there three to ten times smaller for twice the points.
_GRADING = 0.3
_MOST = 150_000  # cells in space before grading: bounds memory and time
# What the largest difference of two or three rules is multiplied with. In space the rules are
# coarser, and their errors have a common part, which falls at least like the spacing: of three it
# is at most 1 / (1.73 − 1) of the largest difference, of the two coarser 1.31 / (1.73 − 1.31). In
# the plane it falls at least like the square: 1.31² / (1.73² − 1.31²); the rest is random, and two
# rules are a smaller sample of it.
_SAFETY = {2: (0.0, 2.0, 1.0), 3: (0.0, 3.2, 1.5)}


@dataclass(frozen=True)
class MeasuredNorm:
    """An error norm by the finest rule, and the integration error of its relative value."""

    norm: ErrorNorm
    integration_error: float


def rule_of(body: AnyBody, size: float, k: int) -> Rule:
    """Make the rule `k` of a body for fields on elements of size `size` m; the finest is 0."""
    factor = _FAMILY[k]
    if isinstance(body, Body):
        return area_rule(body, factor * size / 3, slab_angles(body)[k], grading=_GRADING)
    d = body.cell_dimension
    spacing = max(size / 3, (factorial(d) * body.measure / _MOST) ** (1 / d))
    # a front takes many more cells than a tip
    depth, grading = (0.05, _GRADING) if d == 2 else (0.25, 1.0)
    return body_rule(body, factor * spacing, k, depth=depth, grading=grading)


def rules(body: AnyBody, size: float, count: int = 3) -> list[Rule]:
    """Compute rules of a body for fields on elements of size `size` m, the finest first."""
    return [rule_of(body, size, k) for k in range(count)]


def cut_rule_of(body: AnyBody, size: float, k: int = 0) -> CutRule:
    """Make the rule `k` on the cuts for fields on elements of size `size` m; the finest is 0."""
    factor = _FAMILY[k]
    if isinstance(body, Body):
        return cut_rule(body, factor * size / 8)
    if isinstance(body, MembraneBody):
        return membrane_cut_rule(body, factor * size / 8)
    return surface_rule(body, factor * size / 3)


def integrate_norm[R: (Rule, CutRule)](
    measure: Callable[[R], ErrorNorm], family: Sequence[R]
) -> MeasuredNorm:
    """Apply `measure` with each rule of a family."""
    return spread_of([measure(rule) for rule in family], family[0].points.shape[1])


def spread_of(norms: Sequence[ErrorNorm], dimension: int) -> MeasuredNorm:
    """Take the norm by the finest rule, with the largest difference of the others from it."""
    values = [norm.relative for norm in norms]
    spread = max(abs(value - values[0]) for value in values) if values[0] < float("inf") else 0.0
    return MeasuredNorm(norms[0], _SAFETY[dimension][len(norms) - 1] * spread)
