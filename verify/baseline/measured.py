"""Quantities and speeds of a run, by their names in a baseline."""

from dataclasses import dataclass
from math import isfinite
from statistics import median
from typing import Any

from verify.baseline.record import Independent, Own, Quantity, Speed
from verify.calibration import KERNEL, seconds_of_note
from verify.judge.intervals import ERROR_METRICS
from verify.result import CaseResult, Metric, SolveRecord, Status, finest_of

# errors below this are round-off; how large round-off is says nothing
_ROUND_OFF = 1e-10


@dataclass(frozen=True)
class MeasuredSpeed:
    """Ratio to the calibration kernel with its relative half-width; or why there is none."""

    ratio: float = 0.0
    spread: float = 0.0
    reason: str = ""


def finest(result: CaseResult) -> list[SolveRecord]:
    """Return the finest level of each solver, solved or not."""
    return list(finest_of(result.solves).values())


def metric_of(result: CaseResult, name: str) -> tuple[Metric | None, str]:
    """Find ``solver/level/metric`` in a result, or say why it is not there."""
    place, _, metric_name = name.rpartition("/")
    solver, _, level = place.rpartition("/")
    for solve in result.solves:
        if (solve.solver, str(solve.level)) == (solver, level):
            metric = solve.metric(metric_name)
            if metric is not None and isfinite(metric.value):
                return metric, ""
            if metric is not None:
                return None, "it is not finite"
            why = solve.reason or solve.notes.get(metric_name, "it was not measured")
            return None, f"{solve.status}: {why}" if solve.status is not Status.SOLVED else why
    return None, f"'{solver}' level {level} was not run"


def quantities_of(result: CaseResult, origin: dict[str, Any]) -> dict[str, Quantity]:
    """Return every metric of the finest solved levels, with both its axes."""
    found = {}
    for solve in finest(result):
        if solve.status is not Status.SOLVED:
            continue
        for metric in solve.metrics:
            if not isfinite(metric.value):
                continue
            absolute = _ROUND_OFF if metric.name in ERROR_METRICS else 0.0
            found[f"{solve.solver}/{solve.level}/{metric.name}"] = Quantity(
                unit=metric.unit,
                own=Own(value=float(metric.value), absolute=absolute, **origin),
                independent=_independent(result, solve.solver, metric, origin),
            )
    return found


def _independent(
    result: CaseResult, solver: str, metric: Metric, origin: dict[str, Any]
) -> Independent | None:
    """Take the independent value and tolerance that the case states, else the reference's value."""
    checks = [
        check
        for check in result.scene.get("acceptance", [])
        if check["solver"] in (None, solver) and check["metric"] == metric.name
    ]
    for check in checks:
        if check["check"] == "value":
            return Independent(
                value=check["equals"],
                tolerance=check["relative_tolerance"],
                source=check["source"],
                **origin,
            )
    bound = next((check["at_most"] for check in checks if check["check"] == "error"), None)
    if metric.name in ERROR_METRICS:
        return Independent(value=0.0, tolerance=bound, source=metric.source, **origin)
    if metric.reference is None:
        return None
    return Independent(
        value=metric.reference,
        uncertainty=metric.uncertainty,
        tolerance=bound,
        source=metric.source,
        **origin,
    )


def speed_of(solve: SolveRecord) -> MeasuredSpeed:
    """Return the time of one solve, over all its phases, in units of the calibration kernel."""
    kernel = seconds_of_note(solve.notes.get("calibration", ""))
    if solve.status is not Status.SOLVED:
        return MeasuredSpeed(reason=f"{solve.status}: {solve.reason}")
    if kernel is None:
        return MeasuredSpeed(reason="the calibration kernel was not timed beside it")
    if not solve.timings or not all(solve.timings.values()):
        return MeasuredSpeed(reason="the solver gives no timings")
    if solve.notes.get("timing", "").startswith("contended"):
        return MeasuredSpeed(reason=solve.notes["timing"])
    count = max(len(seconds) for seconds in solve.timings.values())
    if count < 3:
        return MeasuredSpeed(reason=f"{count} repetitions; a spread needs 3")
    # a phase timed once (meshing) is the same in all repetitions
    totals = [
        sum(s[i] if len(s) == count else median(s) for s in solve.timings.values())
        for i in range(count)
    ]
    if not median(totals) > 0.0:
        return MeasuredSpeed(reason="its times are zero")
    spread = _half_width(totals) + _half_width(kernel)
    return MeasuredSpeed(median(totals) / median(kernel), spread)


def _half_width(seconds: list[float]) -> float:
    """Half the range over the median; a range, because the few values are no normal sample."""
    return 0.5 * (max(seconds) - min(seconds)) / median(seconds)


def speed_entry(measured: MeasuredSpeed, cpu: str, origin: dict[str, Any]) -> Speed:
    """Make the entry of a baseline."""
    return Speed(ratio=measured.ratio, spread=measured.spread, kernel=KERNEL, cpu=cpu, **origin)
