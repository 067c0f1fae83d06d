"""A measure together with the error of its quadrature.

Finite element fields have kinks along edges that the neutral quadrature does not know. Its
error is estimated by two coarser rules in other directions: it is taken to be as large as the
largest difference among them, although the finest rule is the one that counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import factorial

from verify.compare.body import AnyBody, Body
from verify.compare.body_rule import body_rule
from verify.compare.cut_line import CutRule, cut_rule, membrane_cut_rule
from verify.compare.error_norm import ErrorNorm
from verify.compare.membrane_body import MembraneBody
from verify.compare.slabs import Rule, area_rule, slab_angles
from verify.compare.surface_rule import surface_rule

# spacings over the wanted one, without small common multiples
_FAMILY = (1.0, 1.31, 1.73)
# The few elements at a tip hold most of the error; finer cells around it make the integration
# error of the energy norm there three to ten times smaller for twice the points.
_GRADING = 0.3
_MOST = 150_000  # cells in space before grading: bounds memory and time
# In space the rules are coarser, and their errors have a common part, which falls at least like
# the spacing: then it is at most 1 / (1.73 − 1) of the largest difference.
_SAFETY = {2: 1.0, 3: 1.5}


@dataclass(frozen=True)
class MeasuredNorm:
    """An error norm by the finest rule, and the integration error of its relative value."""

    norm: ErrorNorm
    integration_error: float


def rules(body: AnyBody, size: float, count: int = 3) -> list[Rule]:
    """Rules of a body for fields on elements of size `size` m, the finest first."""
    if isinstance(body, Body):
        return [
            area_rule(body, factor * size / 3, angle, grading=_GRADING)
            for factor, angle in list(zip(_FAMILY, slab_angles(body), strict=True))[:count]
        ]
    k = body.cell_dimension
    spacing = max(size / 3, (factorial(k) * body.measure / _MOST) ** (1 / k))
    # a front takes many more cells than a tip
    depth, grading = (0.05, _GRADING) if k == 2 else (0.25, 1.0)
    return [
        body_rule(body, factor * spacing, seed, depth=depth, grading=grading)
        for seed, factor in enumerate(_FAMILY[:count])
    ]


def cut_rules(body: AnyBody, size: float, count: int = 3) -> list[CutRule]:
    """Rules on the cuts for fields on elements of size `size` m, the finest first."""
    if isinstance(body, Body):
        return [cut_rule(body, factor * size / 8) for factor in _FAMILY[:count]]
    if isinstance(body, MembraneBody):
        return [membrane_cut_rule(body, factor * size / 8) for factor in _FAMILY[:count]]
    return [surface_rule(body, factor * size / 3) for factor in _FAMILY[:count]]


def integrate_norm[R: (Rule, CutRule)](
    measure: Callable[[R], ErrorNorm], family: Sequence[R]
) -> MeasuredNorm:
    """Apply `measure` with each rule of a family."""
    return spread_of([measure(rule) for rule in family], family[0].points.shape[1])


def spread_of(norms: Sequence[ErrorNorm], dimension: int) -> MeasuredNorm:
    """Take the norm by the finest rule, with the largest difference of the others from it."""
    values = [norm.relative for norm in norms]
    spread = max(abs(value - values[0]) for value in values) if values[0] < float("inf") else 0.0
    return MeasuredNorm(norms[0], _SAFETY[dimension] * spread)
