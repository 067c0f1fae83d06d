"""The curves of a case: error against mesh size, unknowns and time, as the result holds them."""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import median

from verify.report.notation import SECONDARY, solver_title
from verify.result import CaseResult, Metric, Rate, SolveRecord, Status, repeated_totals

# Beyond these a number is a symptom, and powers of ten around it overflow
_DRAWABLE = (1e-200, 1e200)


@dataclass(frozen=True)
class Duration:
    """Wall seconds of what a cut costs anew (`SolveRecord.paid`), over the repetitions."""

    median: float
    low: float
    high: float
    repetitions: int
    phases: tuple[str, ...]


@dataclass(frozen=True)
class Point:
    """One solve in a figure; `value` ± `uncertainty` is a relative error or deviation."""

    level: int
    size: float | None
    unknowns: float | None
    value: float
    uncertainty: float
    duration: Duration | None


@dataclass(frozen=True)
class Curve:
    """One solver in a figure.

    Parameters
    ----------
    label, solver : str
    stretches : list of list of Point
        Points of successive levels; a level that failed ends a stretch.
    ends : list of (int, str)
        Level that failed, and how.
    rate : Rate or None
    """

    label: str
    solver: str
    stretches: list[list[Point]]
    ends: list[tuple[int, str]]
    rate: Rate | None

    @property
    def points(self) -> list[Point]:
        """All points, coarse to fine."""
        return [point for stretch in self.stretches for point in stretch]


def metric_names(result: CaseResult) -> list[str]:
    """Return the names of the metrics to show that some solve has, in order of appearance.

    Of the errors beside the three main ones only those that the case judges are shown.
    """
    names = dict.fromkeys(m.name for solve in result.solves for m in solve.metrics)
    judged = {verdict.metric for verdict in result.verdicts}
    return [name for name in names if name not in SECONDARY or name in judged]


def limits(point: Point) -> bool:
    """Whether the uncertainty of the comparison is near enough to the error to be drawn."""
    return point.uncertainty > point.value / 30


def floor(
    curves: Sequence[Curve], abscissa: Callable[[Point], float | None]
) -> list[tuple[float, float]]:
    """Return (abscissa, uncertainty) of every point: the least uncertainty on its level.

    That is what no solver can be below; what a point has beyond it is its own error bar.
    """
    points = [point for curve in curves for point in curve.points]
    least: dict[int, float] = {}
    for point in points:
        least[point.level] = min(point.uncertainty, least.get(point.level, point.uncertainty))
    return sorted((x, least[p.level]) for p in points if (x := abscissa(p)) is not None)


def error_curves(result: CaseResult, metric: str) -> list[Curve]:
    """Return one curve per solver (and set of parameters) that was measured by `metric`.

    A quantity is drawn by its relative deviation from the reference value stored with it.
    """
    groups: dict[tuple[str, str], list[SolveRecord]] = {}
    for solve in result.solves:
        parameters = json.dumps(solve.parameters, sort_keys=True)
        groups.setdefault((solve.solver, parameters), []).append(solve)
    rates = {rate.solver: rate for rate in result.rates if rate.metric == metric}
    curves = []
    for (solver, parameters), solves in groups.items():
        alone = sum(key[0] == solver for key in groups) == 1
        label = solver_title(solver) if alone else f"{solver_title(solver)} {parameters}"
        curve = _curve(label, solver, solves, metric, rates.get(solver))
        if curve.points:
            curves.append(curve)
    # XFEM last: its small discs are drawn onto the larger open markers of what it is held against
    return sorted(curves, key=lambda curve: curve.solver == "xfem")


def duration(solve: SolveRecord) -> Duration | None:
    """Return the time of a solve, or None if it was not measured.

    See `repeated_totals` for phases that were timed less often than others.
    """
    everything = [second for times in solve.paid.values() for second in times]
    totals = repeated_totals(solve.paid)
    if not totals or not all(math.isfinite(second) and second >= 0 for second in everything):
        return None
    return Duration(median(totals), min(totals), max(totals), len(totals), tuple(solve.paid))


def _curve(
    label: str, solver: str, solves: list[SolveRecord], metric: str, rate: Rate | None
) -> Curve:
    stretches: list[list[Point]] = [[]]
    ends = []
    for solve in sorted(solves, key=lambda solve: solve.level):
        measured = solve.metric(metric)
        if solve.status is not Status.SOLVED:
            ends.append((solve.level, str(solve.status)))
            stretches.append([])
        elif measured is not None and _can_be_drawn(measured):
            stretches[-1].append(_point(solve, measured))
        else:
            stretches.append([])
    return Curve(label, solver, [stretch for stretch in stretches if stretch], ends, rate)


def _can_be_drawn(measured: Metric) -> bool:
    """Whether it is an error, or a quantity that has a reference value to differ from."""
    known = (
        measured.unit == "1" if measured.reference is None else math.isfinite(measured.reference)
    )
    return known and all(
        math.isfinite(n) and abs(n) < _DRAWABLE[1]
        for n in (measured.value, measured.uncertainty, *error_of(measured))
    )


def error_of(measured: Metric) -> tuple[float, float]:
    """Return an error, or the relative error of a quantity with a reference, and its half-width."""
    if not measured.reference:
        return measured.value, measured.uncertainty
    value, low, high = measured.relative_distance()
    return value, max(value - low, high - value)


def _point(solve: SolveRecord, measured: Metric) -> Point:
    value, uncertainty = error_of(measured)
    drawn = abs(value) if abs(value) >= _DRAWABLE[0] else 0.0
    size = solve.size if solve.size and _DRAWABLE[0] < solve.size < _DRAWABLE[1] else None
    unknowns = float(solve.unknowns) if solve.unknowns and solve.unknowns > 0 else None
    return Point(solve.level, size, unknowns, drawn, max(uncertainty, 0.0), duration(solve))
