"""A measure together with the error of its quadrature.

Finite element fields have kinks along edges that the neutral quadrature does not know. Its
error is estimated by two coarser rules in other directions: it is taken to be as large as the
largest difference among them, although the finest rule is the one that counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from verify.compare.body import Body
from verify.compare.cut_line import CutRule, cut_rule
from verify.compare.error_norm import ErrorNorm
from verify.compare.slabs import Rule, area_rule, slab_angles

__all__ = ["MeasuredNorm", "cut_rules", "integrate_norm", "rules"]

# spacings over the wanted one, without small common multiples
_FAMILY = (1.0, 1.31, 1.73)
# The few elements at a tip hold most of the error; finer cells around it make the integration
# error of the energy norm there three to ten times smaller for twice the points.
_GRADING = 0.3


@dataclass(frozen=True)
class MeasuredNorm:
    """An error norm by the finest rule, and the integration error of its relative value."""

    norm: ErrorNorm
    integration_error: float


def rules(body: Body, size: float) -> list[Rule]:
    """Area rules for fields on elements of size `size` m, the finest first."""
    return [
        area_rule(body, factor * size / 3, angle, grading=_GRADING)
        for factor, angle in zip(_FAMILY, slab_angles(body), strict=True)
    ]


def cut_rules(body: Body, size: float) -> list[CutRule]:
    """Rules along the cuts for fields on elements of size `size` m, the finest first."""
    return [cut_rule(body, factor * size / 8) for factor in _FAMILY]


def integrate_norm[R: (Rule, CutRule)](
    measure: Callable[[R], ErrorNorm], family: Sequence[R]
) -> MeasuredNorm:
    """Apply `measure` with each rule of a family."""
    norms = [measure(rule) for rule in family]
    values = [norm.relative for norm in norms]
    spread = max(abs(value - values[0]) for value in values) if values[0] < float("inf") else 0.0
    return MeasuredNorm(norms[0], spread)
