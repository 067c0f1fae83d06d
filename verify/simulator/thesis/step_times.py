"""Tables 4.4 and 4.5, Figure 4.25: time per simulated second, against cuts and mesh size."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import thread_time

import numpy as np

from verify.simulator import Session, Stage
from verify.simulator.thesis.published import published_rows
from verify.simulator.thesis.strokes import CutHand, cut_hand, hand

TETRAHEDRA = (200, 400, 600, 800, 1000)
CUTS = (0, 50, 100, 150, 200)
_STEP = 0.5  # s: the thesis' own
_CUTTING, _MEASURED = 2, 21  # steps
_GRAVITY = np.array([0.0, 0.0, -9.8])


@dataclass(frozen=True)
class StepTime:
    """One entry of Tables 4.4 and 4.5.

    Attributes
    ----------
    asked_tetrahedra, asked_cuts : int
        Row and column.
    tetrahedra, cuts : int
        As they are here; an element that two strokes split counts twice.
    nodes : int
        With unknowns of their own.
    step : float
        Median processor time of a step of 0.5 s with all surfaces, s.
    slowest : float
        Of the steps measured, s.
    per_second : float
        Processor time per simulated second at that step, s.
    thesis_per_second : float
        Table 4.4, s.
    thesis_nodes : int
        Table 4.5.
    """

    asked_tetrahedra: int
    asked_cuts: int
    tetrahedra: int
    cuts: int
    nodes: int
    step: float
    slowest: float
    per_second: float
    thesis_per_second: float
    thesis_nodes: int


def step_times(tetrahedra: Sequence[int], cuts: Sequence[int]) -> list[StepTime]:
    """Play the hand at each size, cut so often, and time its steps.

    Steps that cut are not among them: the thesis recorded what a second takes *after* cuts.
    """
    times = {int(row[0]): row[1:] for row in published_rows("4.4")}
    nodes = {int(row[0]): row[1:] for row in published_rows("4.5")}
    stage = replace(hand(tetrahedra[0]), hooks=[], gravity=_GRAVITY)
    _measure(stage, cut_hand(stage, [cuts[-1]], _STEP)[0])  # compiles
    found = []
    for size in tetrahedra:
        stage = replace(hand(size), hooks=[], gravity=_GRAVITY)
        for asked, made in zip(cuts, cut_hand(stage, cuts, _STEP), strict=True):
            steps, count = _measure(stage, made)
            step, column = float(np.median(steps)), CUTS.index(asked)
            found.append(
                StepTime(
                    size,
                    asked,
                    len(stage.mesh.cells),
                    made.cuts,
                    count,
                    step,
                    max(steps),
                    step / _STEP,
                    times[size][column],
                    int(nodes[size][column]),
                )
            )
    return found


def _measure(stage: Stage, made: CutHand) -> tuple[list[float], int]:
    steps = _CUTTING + _MEASURED
    played = replace(stage, strokes=made.strokes, time_step=_STEP, duration=steps * _STEP)
    session = Session(played, account=False, clock=thread_time)
    records = session.run()
    if not np.isfinite(session.state.displacement).all():
        raise ValueError(f"motion of {made.cuts} cuts is not finite")
    seconds = [record.total_seconds for record in records[_CUTTING:]]
    return seconds, session.phantom.node_count
