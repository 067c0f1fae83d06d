"""Sufficiency of a reference for the errors that it has to judge, and what its levels cost."""

from collections.abc import Mapping, Sequence
from math import isfinite
from statistics import median
from typing import Any

from verify.judge.intervals import quotient_half_width, reference_share
from verify.result import SUFFICIENT, Metric, SolveRecord, Status, finest_of
from verify.scene import Scene
from verify.solution import Solution


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
