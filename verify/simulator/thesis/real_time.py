"""Cost of steps of the hand: per simulated second, and each while it is cut and pulled open.

Tables 4.4 and 4.5 and Figure 4.25 against numbers of cuts and sizes of meshes; then real time.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter, thread_time

import numpy as np

from verify.calibration import kernel_seconds
from verify.simulator import PHASES, Session, Stage, quality_of
from verify.simulator.session import LIMITS
from verify.simulator.thesis.delays import CutHand, cut_hand, hand, published_rows, stroke_along
from verify.xfem.arrays import Floats

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


_TETRAHEDRA = 1000
_STROKES = ((-0.022, 1.8), (0.024, 3.0))  # m, s: after the incision, while it is pulled open
_STROKE, _DURATION = 1.1, 4.6  # s
_LOOK = 10  # steps
_REPLAYS = 5


@dataclass(frozen=True)
class RealTime:
    """The hand, played.

    Attributes
    ----------
    tetrahedra, cuts, unknowns, steps, cutting_steps : int
        Cuts are split elements, unknowns displacement components, both at the end.
    within : dict
        Share of all steps within each of the `LIMITS`, in processor time of one thread, of each
        step the median over replays.
    within_wall : dict
        Likewise in wall time, the other work of the machine included.
    resting, cutting : dict
        Median by phase, and of the whole step, of steps without and with newly split elements:
        processor time, s.
    slowest : float
        Processor time, s.
    kernel : float
        Processor time of the calibration kernel beside it, s.
    volume_error, loose_edges, inverted : float, int, int
        Worst over every tenth step: see `verify.simulator.quality.Quality`.
    energy_gain : float
        Largest excess of the mechanical energy over the work done, relative to that work.
    """

    tetrahedra: int
    cuts: int
    unknowns: int
    steps: int
    cutting_steps: int
    within: dict[str, float]
    within_wall: dict[str, float]
    resting: dict[str, float]
    cutting: dict[str, float]
    slowest: float
    kernel: float
    volume_error: float
    loose_edges: int
    inverted: int
    energy_gain: float


def real_time() -> RealTime:
    """Cut the hand as in the case, cut it twice more along its whole length, and time each step."""
    stage = hand(_TETRAHEDRA)
    more = [stroke_along(stage, place, begin, _STROKE) for place, begin in _STROKES]
    stage = replace(stage, strokes=[*stage.strokes, *more], duration=_DURATION)
    volume, loose, inverted, gain = _soundness(stage)  # compiles what is timed below
    # each replay is the same work step by step: the median over them is what a step costs
    replays, walls = [], []
    for _ in range(_REPLAYS):
        session = Session(stage, account=False, clock=thread_time)
        while not session.finished:
            start = perf_counter()
            session.step()
            walls.append(perf_counter() - start)
        replays.append([[r.seconds[name] for name in PHASES] for r in session.records])
    wall = np.median(np.reshape(walls, (_REPLAYS, -1)), axis=0)
    by_phase = np.median(replays, axis=0)
    kernel = float(np.median(kernel_seconds(clock=thread_time)))
    total = by_phase.sum(axis=1)
    cutting = np.array([record.newly_split > 0 for record in session.records])
    phases = dict(zip(PHASES, by_phase.T, strict=True)) | {"step": total}
    return RealTime(
        tetrahedra=len(stage.mesh.cells),
        cuts=session.records[-1].split,
        unknowns=session.records[-1].unknowns,
        steps=len(total),
        cutting_steps=int(cutting.sum()),
        within=_shares(total),
        within_wall=_shares(wall),
        resting={name: float(np.median(values[~cutting])) for name, values in phases.items()},
        cutting={name: float(np.median(values[cutting])) for name, values in phases.items()},
        slowest=float(total.max()),
        kernel=kernel,
        volume_error=volume,
        loose_edges=loose,
        inverted=inverted,
        energy_gain=gain,
    )


def _shares(seconds: Floats) -> dict[str, float]:
    return {name: float(np.mean(seconds <= limit)) for name, limit in LIMITS.items()}


def _soundness(stage: Stage) -> tuple[float, int, int, float]:
    """Play with the account kept and the body measured every few steps."""
    session = Session(stage)
    seen = []
    while not session.finished:
        session.step()
        if len(session.records) % _LOOK == 0 or session.finished:
            seen.append(quality_of(session))
    largest = max(record.work for record in session.records)
    gain = max(record.mechanical - record.work for record in session.records) / largest
    return (
        max(quality.volume_error for quality in seen),
        max(quality.loose_edges for quality in seen),
        max(quality.inverted_elements + quality.inverted_facets for quality in seen),
        float(gain),
    )
