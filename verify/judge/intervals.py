"""Intervals of measured errors: a value and the bounds of its true value."""

from dataclasses import dataclass
from math import inf

from verify.compare.errors import ERROR_NAMES
from verify.compare.part_account import ACCOUNT
from verify.result import Metric
from verify.scene.acceptance import OVERLAP

# metrics that are relative errors themselves; all others are quantities with a reference
ERROR_METRICS = (*ERROR_NAMES, *ACCOUNT)

_ROUND_OFF = 1e-10  # relative: an error that small is none, and needs no reference to say so
# Relative: a half-width that small is none. It is the difference of two levels, each off by
# round-off, times a safety factor of up to three.
_NO_WIDTH = 10 * _ROUND_OFF


@dataclass(frozen=True)
class Interval:
    """A measured number and the bounds of its true value."""

    value: float
    low: float
    high: float

    @property
    def half_width(self) -> float:
        """Largest distance of the bounds from the value."""
        return max(self.value - self.low, self.high - self.value)


class NotMeasuredError(Exception):
    """A solve, a metric or its reference that the check needs is not there."""


def error_interval(metric: Metric) -> Interval:
    """Relative error that a metric stands for, with the bounds of its true value.

    For an error metric that is its value, for the depth of an overlap the depth in m; for a
    quantity its relative distance from the reference, whatever the true reference is within its
    uncertainty.

    Raises
    ------
    NotMeasuredError
        If the metric is a quantity without a reference, or with one that is 0.
    """
    if metric.name in ERROR_METRICS or metric.name == OVERLAP:
        error, width = metric.value, metric.uncertainty
        return Interval(error, max(0.0, error - width), error + width)
    if metric.reference is None:  # never take the quantity itself for an error
        raise NotMeasuredError(f"{metric.name} has no reference to be compared with")
    if metric.reference == 0.0:
        raise NotMeasuredError(f"the reference of {metric.name} is 0: it has no relative error")
    return Interval(*metric.relative_distance())


def quotient_half_width(part: float, width: float, whole: float, whole_width: float) -> float:
    """Half-width of part/whole where both are uncertain; infinite where the whole may be 0."""
    least = abs(whole) - whole_width
    return (abs(part) + width) / least - abs(part / whole) if least > 0.0 else inf


def reference_share(metric: Metric) -> float | None:
    """Half-width of the reference over the error that it judges.

    None where no reference judges, and where error and half-width are round-off. Infinite where
    only the error is: nothing is divided by round-off.
    """
    if not metric.source or metric.name in ACCOUNT:
        return None
    scale = 1.0 if metric.reference is None else abs(metric.reference)
    # measured values may be numpy's, whose comparisons JSON cannot hold
    error = float(abs(metric.value - (metric.reference or 0.0)))
    width = float(metric.uncertainty)
    if error > _ROUND_OFF * scale:
        return width / error
    return inf if width > _NO_WIDTH * scale else None
