"""Strokes across the hand of the thesis, and how long the tool takes to cross an element.

Table 4.6 and Figure 4.26. The thesis' own numbers are tables 4.1 to 4.6 of Gutiérrez Preciado
(CINVESTAV, 2009).
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from verify.scene import Scene, Skin, load_scene
from verify.simulator import Stage, stage_of
from verify.simulator.semi_progressive import Crossings, SemiProgressiveCutter
from verify.xfem.cuts import ToolPath


@cache
def _tables() -> dict[str, dict[str, list[list[float]]]]:
    text = files("verify.simulator.thesis").joinpath("published.json").read_text(encoding="utf-8")
    tables: dict[str, dict[str, list[list[float]]]] = json.loads(text)
    return tables


def published_rows(table: str) -> list[list[float]]:
    """Return the rows of a table as printed, such as ``"4.3"``."""
    return [list(row) for row in _tables()[table]["rows"]]


def published_source() -> str:
    """Return where they were published."""
    return str(_tables()["source"])


# m, across the hand: the middle first, then ever denser; none along another
_ACROSS = (
    0.003, -0.021, 0.025, -0.009, 0.013, -0.031, 0.034, -0.015, 0.019, -0.003, 0.008, -0.026,
    0.029, -0.012, 0.0155,
)  # fmt: skip
_SLANT, _OVER, _ABOVE = 0.003, 0.005, 0.04  # m
_DEPTH = (0.0, 0.0, -0.07)  # m
_FRAMES = 200  # of a stroke: less than an element each


@dataclass(frozen=True)
class CutHand:
    """Strokes that cut so many elements.

    Attributes
    ----------
    strokes : list of ToolPath
        The last one ends where the number was reached; all together last as long as asked.
    cuts : int
        Elements that strokes have split; one that two strokes split counts twice.
    """

    strokes: list[ToolPath]
    cuts: int


def hand(elements: int) -> Stage:
    """Return the straight incision of the thesis' hand on about so many tetrahedra."""
    scene: Scene = load_scene("thesis/hand_straight")
    assert isinstance(scene.geometry, Skin)
    geometry = scene.geometry.model_copy(update={"elements": elements})
    return stage_of(scene.model_copy(update={"geometry": geometry}))


def stroke_along(stage: Stage, place: float, begin: float, duration: float) -> ToolPath:
    """Stroke from wrist to fingers, through both borders.

    Parameters
    ----------
    stage : Stage
    place : float
        x where it crosses the middle, m.
    begin, duration : float
        s.
    """
    lower, upper = stage.mesh.points[:, 1].min() - _OVER, stage.mesh.points[:, 1].max() + _OVER
    tips = [[place - _SLANT, lower, _ABOVE], [place + _SLANT, upper, _ABOVE]]
    return ToolPath.of_tip(tips, [begin, begin + duration], _DEPTH)


def cut_hand(stage: Stage, targets: Sequence[int], duration: float) -> list[CutHand]:
    """Find the strokes, one after the other, that cut so many elements.

    Parameters
    ----------
    stage : Stage
    targets : sequence of int
        Ascending; 0 is no stroke.
    duration : float
        Of all strokes of a target together, s.

    Raises
    ------
    ValueError
        If the strokes do not cut so many.
    """
    cutter = SemiProgressiveCutter(stage.mesh)
    found = [CutHand([], 0) for target in targets if target == 0]
    wanted = [target for target in targets if target > 0]
    for number, place in enumerate(_ACROSS):
        path = stroke_along(stage, place, float(number), 1.0)
        cutter.begin(path)
        for frame in range(1, _FRAMES + 1):
            share = frame / _FRAMES
            cutter.advance(number + share)
            cuts = len(cutter.crossings.cell)
            while wanted and cuts >= wanted[0]:
                paths = [stroke.path for stroke in cutter.strokes]
                found.append(CutHand(_squeezed(paths, number + share, duration), cuts))
                wanted.pop(0)
            if not wanted:
                return found
    raise ValueError(f"the strokes cut {cuts} elements; expected {wanted[0]}")


def _squeezed(paths: Sequence[ToolPath], end: float, duration: float) -> list[ToolPath]:
    """Paths until a time, played within a duration."""
    squeezed = []
    for path in paths:
        stop = min(float(path.times[-1]), end)
        share = (stop - path.times[0]) / (path.times[-1] - path.times[0])
        tips = path.blades[0] + np.array([0.0, share])[:, None, None] * (
            path.blades[-1] - path.blades[0]
        )
        squeezed.append(ToolPath(tips, np.array([path.times[0], stop]) * (duration / end)))
    return squeezed


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
