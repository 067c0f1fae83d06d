"""Cost of each level of a reference, and how exact it turned out to be."""

from collections.abc import Mapping, Sequence
from statistics import median
from typing import Any

from verify.judge.intervals import quotient_half_width
from verify.solution import Solution


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
