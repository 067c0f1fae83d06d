"""Sufficiency of a reference for the errors that it has to judge."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from verify.judge.intervals import reference_share
from verify.result import SUFFICIENT, Metric, SolveRecord, Status, finest_of
from verify.scene import Scene


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
