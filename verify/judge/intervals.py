"""Intervals of measured errors: a value, the bounds of its true value, the share of the reference.

Below: whether a reference suffices for the errors that it has to judge, and how well each of its
levels is known.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite
from statistics import median
from typing import Any

from verify.compare.errors import ERROR_NAMES
from verify.compare.part_account import ACCOUNT
from verify.result import SUFFICIENT, CaseResult, Metric, SolveRecord, Status, finest_of
from verify.scene import Scene
from verify.scene.acceptance import OVERLAP
from verify.solution import Solution

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
    if metric.name in ERROR_METRICS or metric.name in (OVERLAP, "contact_overlap"):
        error, width = metric.value, metric.uncertainty
        return Interval(error, max(0.0, error - width), error + width)
    if metric.reference is None:  # never take the quantity itself for an error
        raise NotMeasuredError(f"{metric.name} has no reference to be compared with")
    if metric.reference == 0.0:
        raise NotMeasuredError(f"the reference of {metric.name} is 0: it has no relative error")
    return Interval(*metric.relative_distance())


def interval_of(solve: SolveRecord, name: str) -> Interval | None:
    """Interval in which a metric of a solve lies; None if there is no such number."""
    measured = solve.metric(name)
    if solve.status is not Status.SOLVED or measured is None:
        return None
    try:
        found = error_interval(measured)
    except NotMeasuredError:
        return None
    return found if isfinite(found.value) and isfinite(found.high) else None


def number_on_finest(result: CaseResult, name: str, solver: str) -> Interval | str:
    """Interval of a metric of a solver on its finest level, or why there is none."""
    last = finest_of(result.solves).get(solver)
    if last is None:
        return "was not run on this case"
    if (found := interval_of(last, name)) is not None:
        return found
    if last.status is not Status.SOLVED:
        return f"level {last.level} {last.status}: {last.reason or 'no reason given'}"
    said = last.notes.get(name) or last.notes.get("comparison") or "not measured"
    return f"level {last.level}: {said}"


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


def sufficiency(
    scene: Scene, solves: Sequence[SolveRecord], reference: str, levels: int
) -> dict[str, Any]:
    """Compare the reference's uncertainty with the error of each solver's finest solution.

    Parameters
    ----------
    scene : Scene
        Its quantities of interest, and the errors that its acceptance asks for, count.
    solves : sequence of SolveRecord
        Measured.
    reference : str
        Name of the solver that is the reference.
    levels : int
        Levels of the reference so far.

    Returns
    -------
    dict
        ``suffices``, ``suffices_reason`` and, by metric and solver, ``judged_errors`` with
        ``error``, ``uncertainty`` and their ``ratio``, worst first. Plain values, for the record.
    """
    names = dict.fromkeys(
        [quantity.name for quantity in scene.quantities]
        + [check.metric for check in scene.acceptance]
    )
    finest = finest_of(s for s in solves if s.solver != reference and s.status is Status.SOLVED)
    rows = {
        f"{name} of {solve.solver}, level {solve.level}": _row(metric)
        for solve in finest.values()
        for name in names
        if (metric := solve.metric(name)) is not None and metric.source and isfinite(metric.value)
    }
    rows = dict(sorted(rows.items(), key=lambda item: -(item[1]["ratio"] or 0.0)))
    if not rows:
        return {"suffices": False, "suffices_reason": "no error was judged", "judged_errors": {}}
    name, worst = next(iter(rows.items()))
    ratio = worst["ratio"] or 0.0
    reached = ratio <= SUFFICIENT
    said = "reached" if reached else "not reached"
    reason = (
        f"{said} with {levels} levels: its uncertainty is at most {ratio:.2g} of an error "
        f"({name}); {SUFFICIENT:g} is wanted"
    )
    return {"suffices": reached, "suffices_reason": reason, "judged_errors": rows}


def _row(metric: Metric) -> dict[str, float | None]:
    return {
        "error": float(abs(metric.value - (metric.reference or 0.0))),
        "uncertainty": float(metric.uncertainty),
        "ratio": reference_share(metric),
    }


def time_to_accuracy(
    levels: Mapping[int, Solution], metrics: Mapping[str, Mapping[str, Any]]
) -> dict[str, dict[str, float | int | None]]:
    """Bound the relative error of every level by what the finest says of itself.

    A quantity: its distance from the finest level plus the half-width there. A norm: the sum of
    the differences up to the finest level plus the bound there.

    Parameters
    ----------
    levels : mapping of int to Solution
    metrics : mapping of str to record
        As in the record of a reference: ``values`` by level (of norms: relative differences of
        successive levels, one fewer) and ``uncertainty``.

    Returns
    -------
    dict
        By level: ``unknowns``, wall ``seconds`` (None where it was not timed) and the bound by
        metric (None of a quantity that vanishes, or that the level does not have).
    """
    rows: dict[str, dict[str, float | int | None]] = {}
    for place, level in enumerate(sorted(levels)):
        solution = levels[level]
        seconds = sum(median(each) for each in solution.timings.values() if each)
        bounds = {
            name: _bound(entry["values"], entry["uncertainty"], place, len(levels))
            for name, entry in metrics.items()
        }
        rows[f"level {level}"] = {
            "unknowns": int(solution.unknowns),
            "seconds": seconds or None,
            **bounds,
        }
    return rows


def _bound(
    values: Sequence[float | None], half_width: float, place: int, levels: int
) -> float | None:
    if len(values) < levels:
        return float(sum(v for v in values[place:] if v is not None)) + half_width
    here, finest = values[place], values[-1]
    if here is None or not finest:
        return None
    apart = here - finest
    return abs(apart / finest) + quotient_half_width(apart, half_width, finest, half_width)
