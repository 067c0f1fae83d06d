"""The hand of the thesis at any number of tetrahedra, and parallel strokes across it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from verify.scene import Scene, Skin, load_scene
from verify.simulator import Stage, stage_of
from verify.simulator.cutting.semi_progressive import SemiProgressiveCutter
from verify.xfem.cuts import ToolPath

# m, across the hand: the middle first, then ever denser; none along another
_PLACES = (
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
    for number, place in enumerate(_PLACES):
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
