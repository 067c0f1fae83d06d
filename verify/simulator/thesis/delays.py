"""Table 4.6 and Figure 4.26: how long it takes the tool to cross an element."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from verify.simulator import Stage
from verify.simulator.cutting.semi_progressive import Crossings, SemiProgressiveCutter
from verify.simulator.thesis.published import published_rows
from verify.simulator.thesis.strokes import hand, stroke_along

SPEEDS = ("slow", "normal", "fast")
_PLACES = (-0.021, 0.003, 0.025)  # m
_FRAME = 1.0 / 60.0  # s


@dataclass(frozen=True)
class Delay:
    """One entry of Table 4.6.

    Attributes
    ----------
    tetrahedra : int
    speed_name : str
    speed : float
        Of the tool, m/s.
    elements : int
        That were crossed.
    edge : float
        Mean edge of the mesh, m.
    delay : float
        Mean time from the first edge of an element to the last one, s.
    seen : float
        Mean time from the first edge to the frame of 1/60 s in which the element opens, s.
    thesis : float
        s.
    """

    tetrahedra: int
    speed_name: str
    speed: float
    elements: int
    edge: float
    delay: float
    seen: float
    thesis: float


@dataclass(frozen=True)
class Frames:
    """The same stroke on a slower or faster machine, that is with other frames.

    Attributes
    ----------
    frame : float
        s.
    elements : int
        Split by the end.
    difference : float
        Largest difference of a delay to that with frames of 1/60 s, relative to the longest.
    seen_difference : float
        Largest time by which the element opens on the screen after it was crossed, in frames.
    """

    frame: float
    elements: int
    difference: float
    seen_difference: float


def delays(tetrahedra: Sequence[int]) -> list[Delay]:
    """Cross the hand in three parallel strokes at once, at each of three speeds.

    The thesis does not say how fast its user was. Each speed is the one at which the delay on
    the coarsest mesh is the thesis'; all other entries follow from it.
    """
    table = {int(row[0]): row[1:4] for row in published_rows("4.6")}
    found: list[Delay] = []
    speeds: dict[str, float] = {}
    for size in tetrahedra:
        stage = hand(size)
        edge = float(np.linalg.norm(stage.mesh.edge_vectors, axis=2).mean())
        if not speeds:
            at_one = float(_crossed(stage, 0.1, _FRAME).delay.mean()) * 0.1
            speeds = {n: at_one / table[size][k] for k, n in enumerate(SPEEDS)}
        for column, name in enumerate(SPEEDS):
            crossings = _crossed(stage, speeds[name], _FRAME)
            found.append(
                Delay(
                    size,
                    name,
                    speeds[name],
                    len(crossings.cell),
                    edge,
                    float(crossings.delay.mean()),
                    float((crossings.seen - crossings.entry).mean()),
                    table[size][column],
                )
            )
    return found


def with_other_frames(tetrahedra: int, speed: float, frames: Sequence[float]) -> list[Frames]:
    """Cross the hand at one speed with frames of other lengths than 1/60 s."""
    stage = hand(tetrahedra)
    usual = _crossed(stage, speed, _FRAME)
    order = np.lexsort([usual.cell, usual.stroke])
    found = []
    for frame in frames:
        other = _crossed(stage, speed, frame)
        same = np.lexsort([other.cell, other.stroke])
        if not np.array_equal(other.cell[same], usual.cell[order]):
            raise ValueError(f"frames of {frame} s split other elements than frames of 1/60 s")
        off = np.abs(other.delay[same] - usual.delay[order]).max() / usual.delay.max()
        late = float((other.seen - other.leave).max() / frame)
        found.append(Frames(frame, len(other.cell), float(off), late))
    return found


def _crossed(stage: Stage, speed: float, frame: float) -> Crossings:
    cutter = SemiProgressiveCutter(stage.mesh)
    length = float(np.linalg.norm(np.diff(stroke_along(stage, 0.0, 0.0, 1.0).blades[:, 0], axis=0)))
    duration = length / speed
    for place in _PLACES:
        cutter.begin(stroke_along(stage, place, 0.0, duration))
    for step in range(1, int(np.ceil(duration / frame)) + 2):
        cutter.advance(step * frame)
    return cutter.crossings
