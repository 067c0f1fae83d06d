"""Factors in time, of supports and loads of a dynamic analysis."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, Field

from verify.scene.strict import Finite, NonNegative


def _ordered(history: list[tuple[float, float]]) -> list[tuple[float, float]]:
    times = [time for time, _ in history]
    if times != sorted(times) or any(a == b for a, b in zip(times, times[2:], strict=False)):
        raise ValueError("times must ascend; two equal ones are a jump, three are too many")
    return history


History = Annotated[
    list[tuple[NonNegative, Finite]],
    Field(
        min_length=1,
        description="dynamic: [[time in s, factor], …]; the value times the factor, linear between "
        "the times and constant before and after them; two equal times make a jump",
    ),
    AfterValidator(_ordered),
]
_Table = Sequence[tuple[float, float]] | None


def factor_at(history: _Table, time: float) -> float:
    """Factor at a time, after a jump there; 1 without a history."""
    if history is None:
        return 1.0
    times, factors = np.array(history, dtype=float).T
    last = int(np.searchsorted(times, time, side="right"))
    if last in (0, len(times)):
        return float(factors[min(last, len(times) - 1)])
    share = (time - times[last - 1]) / (times[last] - times[last - 1])
    return float((1.0 - share) * factors[last - 1] + share * factors[last])


def slope_at(history: _Table, time: float) -> float:
    """Rate of the factor at a time, 1/s; after a kink there."""
    if history is None:
        return 0.0
    times, factors = np.array(history, dtype=float).T
    last = int(np.searchsorted(times, time, side="right"))
    if last in (0, len(times)):
        return 0.0
    return float((factors[last] - factors[last - 1]) / (times[last] - times[last - 1]))


def first_factor(history: _Table) -> float:
    """Factor of the initial equilibrium: the first, before a jump at the time 0."""
    return 1.0 if history is None else float(history[0][1])


def jumps(history: _Table) -> list[float]:
    """Return the times at which the factor jumps, s."""
    return [a for (a, _), (b, _) in pairwise(history or ()) if a == b]
