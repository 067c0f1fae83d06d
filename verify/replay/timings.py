"""What the steps of a played scene cost, phase by phase: medians, and how many meet a limit."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from verify.replay.step_record import PHASES, StepRecord

__all__ = ["LIMITS", "Timings", "timings_of"]

LIMITS = {"2 ms": 2e-3, "1/60 s": 1.0 / 60.0}  # touch, and sight


@dataclass(frozen=True)
class Timings:
    """Medians over steps.

    Attributes
    ----------
    steps : int
    median : dict
        Seconds by phase, and "step" for all together.
    cutting_median : float
        Seconds of a whole step in which elements were split; NaN if there is none.
    within : dict
        Share of the steps within each of the `LIMITS`.
    """

    steps: int
    median: dict[str, float]
    cutting_median: float
    within: dict[str, float]


def timings_of(records: Sequence[StepRecord]) -> Timings:
    """Sum up the steps; the first and the first that cuts, which compile, are for the caller."""
    total = np.array([record.total_seconds for record in records])
    median = {
        phase: float(np.median([record.seconds[phase] for record in records])) for phase in PHASES
    }
    cutting = total[[record.newly_split > 0 for record in records]]
    return Timings(
        len(records),
        {**median, "step": float(np.median(total))},
        float(np.median(cutting)) if len(cutting) else float("nan"),
        {name: float(np.mean(total <= limit)) for name, limit in LIMITS.items()},
    )
